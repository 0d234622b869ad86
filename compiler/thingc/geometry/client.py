"""The client's end of the pipe: starts worker processes, sends requests, gathers answers, reads traces of crashes, and leaves
nothing alive."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import re
import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import TYPE_CHECKING, Any

from thingc.base.json_lines_process import JsonLinesProcess, Lines, ProcessLost
from thingc.geometry.key.environment_variables import environment
from thingc.geometry.record import PartFailure
from thingc.geometry.record_json import full
from thingc.geometry.worker import process_tree

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace

GRACE = 15.0
"""How long [s] after a request's own deadline the worker may be silent before it is given up itself."""
LOADING = 120.0
"""How long [s] a worker may take to load the kernel."""

SPANS = 1000
"""How many answers `busy` remembers."""

CAN_FORK = hasattr(os, "fork")

ABSENT = "absent"
"""The kind of failure of a part of which the store knows nothing."""


class WorkerBroken(Exception):
    """No worker starts: the kernel does not load (`detail` has the traceback), or the system has no process for it."""

    def __init__(self, message: str, detail: str = "") -> None:
        super().__init__(message)
        self.detail = detail


@dataclass(slots=True)
class _Process:
    """A worker process and what it has been asked."""

    process: JsonLinesProcess
    capacity: int
    deadline: float
    asked: dict[int, Mapping[str, Any]] = field(default_factory=dict)
    ready: bool = False


class Workers:
    """Worker processes for requests of one service: one that forks, where the system can, else one per job.

    Nothing is started before it is needed. `close` ends them all, and so does the end of this process. `seed` is that of Python's
    hashes in them, which the order of sets of texts follows. `there`: there are some.
    """

    there = True

    def __init__(self, jobs: int, *, forking: bool = CAN_FORK, seed: int = 0) -> None:
        self.jobs = max(1, jobs)
        self.forking = forking
        self.seed = seed
        self._owner = os.getpid()
        self._processes: list[_Process] = []
        self._lines: Lines = queue.SimpleQueue()
        self._number = 0
        self._begun: dict[str, int] = {}
        self._early: dict[int, tuple[JsonLinesProcess, dict[str, Any]]] = {}
        self._spans: deque[tuple[float, float]] = deque(maxlen=SPANS)

    def busy(self, since: float) -> float:
        """How long [s] parts have been modelled, measured and cut since a time (`time.monotonic`), as the workers say: several at once
        count once. To load the modules of parts does not count."""
        total, until = 0.0, since
        for begun, ended in sorted(self._spans):
            total += max(0.0, ended - max(begun, until))
            until = max(until, ended)
        return total

    @property
    def running(self) -> bool:
        """Whether a worker has been started and not ended."""
        return bool(self._processes)

    def warm(self) -> None:
        """Start the workers without waiting for them: they load the kernel while the caller does something else. Where none starts, `run`
        says so."""
        with contextlib.suppress(WorkerBroken):
            self.ensure()

    def _leave_others(self) -> None:
        """After a fork: the workers are the parent's, which goes on asking them; this process has none."""
        if self._owner != os.getpid():
            self._owner = os.getpid()
            self._processes, self._lines = [], queue.SimpleQueue()
            self._begun, self._early = {}, {}

    def ensure(self) -> None:
        """Start the workers that are missing. Raises `WorkerBroken`."""
        self._leave_others()
        wanted = 1 if self.forking else self.jobs
        while len(self._processes) < wanted:
            flags = ["--jobs", str(self.jobs)] if self.forking else ["--inline"]
            self._processes.append(self._start(flags, self.jobs if self.forking else 1))

    def begin(self, requests: Iterable[Mapping[str, Any]]) -> None:
        """Ask these without waiting: `run` has the answers sooner where it is asked for the same. Only workers that fork begin with
        anything; where none can be had, `run` says so."""
        if self.forking:
            with contextlib.suppress(WorkerBroken):
                self.ensure()
                for request in requests:
                    self._begun[_request_text(request)] = self._send(self._processes[0], request)

    def prepare(self, files: Sequence[str]) -> None:
        """Let workers that are there, and fork, get ready for a part whose code is in these files."""
        self._leave_others()
        for worker in self._processes if self.forking else ():
            worker.process.ask({"prepare": files})

    def forget(self, but: Iterable[Mapping[str, Any]] = ()) -> None:
        """End what was begun and is not wanted: all but these requests."""
        self._leave_others()
        wanted = set(map(_request_text, but))
        for text in [text for text in self._begun if text not in wanted]:
            number = self._begun.pop(text)
            self._early.pop(number, None)
            for worker in self._processes:
                if worker.asked.pop(number, None) is not None:
                    worker.process.ask({"forget": number})

    def run(self, requests: Iterable[Mapping[str, Any]]) -> Iterator[tuple[Mapping[str, Any], dict[str, Any]]]:
        """Every request with its answer, in the order they come: `{"answer": ...}` or `{"failed", "words", "detail"}`.

        A request has `op` and `timeout` [s]; `requests` are asked for shortly before it is their turn. Raises `WorkerBroken` when
        no worker can be had.
        """
        source = iter(requests)
        waiting: deque[Mapping[str, Any]] = deque()
        under_way: set[int] = set()
        lost = 0
        while True:
            if not (waiting or under_way):
                waiting.extend(islice(source, 1))
                if not waiting:
                    return
            self.ensure()
            self._hand_out(waiting, source, under_way)
            heard = self._heard()
            if heard is None:
                continue
            worker, answer, alive = heard
            if not alive:
                left = {number: request for number, request in worker.asked.items() if number in under_way}
                under_way -= left.keys()
                lost += 1
                if self.forking and lost <= 1:  # the server itself was lost: nobody knows why, so once more
                    waiting.extendleft(reversed(left.values()))
                else:
                    yield from ((request, dict(answer)) for request in left.values())
                continue
            number, request = self._answered(worker, answer)
            if number in under_way and request is not None:  # else of a run that was given up
                under_way.remove(number)
                yield request, answer

    def _hand_out(self, waiting: deque[Mapping[str, Any]], source: Iterator[Mapping[str, Any]], under_way: set[int]) -> None:
        """Ask each worker for as much as it can take, first of what is `waiting`, then of the `source`."""
        for worker in self._processes:
            limit = (2 if self.forking else 1) * worker.capacity - (len(worker.asked) - len(self._begun))
            waiting.extend(islice(source, max(0, limit - len(waiting))))
            for _ in range(min(limit, len(waiting))):
                request = waiting.popleft()
                under_way.add(self._send(worker, request) if (begun := self._taken(request)) is None else begun)

    def _taken(self, request: Mapping[str, Any]) -> int | None:
        """The number under which a request was begun, which is an ordinary one from now on; an answer that has come is given again."""
        number = self._begun.pop(_request_text(request), None)
        if number is not None and number in self._early:
            self._lines.put(self._early.pop(number))
        return number

    def _heard(self) -> tuple[_Process, dict[str, Any], bool] | None:
        """A worker and its answer, as soon as there is one (True), or how one failed that is ended now (False). None where something else
        came to pass. Raises `WorkerBroken`."""
        try:
            process, answer = self._lines.get(timeout=max(0.05, min(w.deadline for w in self._processes) - time.monotonic()))
        except queue.Empty:
            worker = min(self._processes, key=lambda w: w.deadline)
            if worker.deadline > time.monotonic():
                return None
            self._end(worker)
            return worker, {"failed": "hung", "words": "", "detail": ""}, False
        if not self._processes:  # closed by another thread
            raise WorkerBroken("the workers have been ended")
        known = next((one for one in self._processes if one.process is process), None)
        if known is None:
            return None
        if answer is None:
            self._end(known)
            return known, {"failed": "crashed", "words": "the worker process ended", "detail": ""}, False
        if "broken" in answer:
            self.close()
            raise WorkerBroken(f"the CAD kernel does not load: {answer['broken']}", answer.get("detail", ""))
        if "ready" in answer:
            known.ready = True
            self._put_off(known)
            return None
        return known, answer, True

    def _answered(self, worker: _Process, answer: dict[str, Any]) -> tuple[int, Mapping[str, Any] | None]:
        """The number and the request that an answer is to; None to one that was forgotten, or begun and is not asked for yet: that is put
        aside. What only this end needs is taken from the answer."""
        number: int = answer["id"]
        if number in self._begun.values():
            self._early[number] = (worker.process, answer)
            self._put_off(worker)
            return number, None
        del answer["id"]
        span = answer.pop("span", None)
        request = worker.asked.pop(number, None)
        self._put_off(worker)
        if span is not None and request is not None and request["op"] != "describe":
            self._spans.append((span[0], span[1]))
        return number, request

    def close(self) -> None:
        """End all workers and wait until they are gone."""
        self._leave_others()
        ended, self._processes = self._processes, []
        self._begun, self._early = {}, {}
        for worker in ended:
            if not worker.ready or not self.forking and worker.asked:  # it does not listen, and has no children
                worker.process.kill()
            worker.process.close()

    def _end(self, worker: _Process) -> None:
        self._processes.remove(worker)
        self._begun = {text: number for text, number in self._begun.items() if number not in worker.asked}
        self._early = {number: early for number, early in self._early.items() if number not in worker.asked}
        process_tree.stop(worker.process.pid)  # it may have lost its children out of sight
        process_tree.end_descendants(worker.process.pid)
        worker.process.kill()
        worker.process.close()

    def _send(self, worker: _Process, request: Mapping[str, Any]) -> int:
        self._number += 1
        worker.asked[self._number] = request
        self._put_off(worker)
        worker.process.ask({"id": self._number, **request})
        return self._number

    def _put_off(self, worker: _Process) -> None:
        """The worker gave a sign of life, or got work: until when the next sign must come.

        A forking worker keeps the deadlines of its children itself, so that one of them answers within a timeout.
        """
        longest = max((float(request["timeout"]) for request in worker.asked.values()), default=0.0)
        worker.deadline = time.monotonic() + longest + (GRACE if self.forking else 0.0) + (0.0 if worker.ready else LOADING)

    def _start(self, flags: Sequence[str], capacity: int) -> _Process:
        try:
            process = _server(flags, self.seed, self._lines)
        except OSError as fault:
            raise WorkerBroken(_no_process(fault)) from fault
        return _Process(process=process, capacity=capacity, deadline=time.monotonic() + LOADING)


class NoWorkers(Workers):
    """None at all: what is not in the store is `ABSENT`."""

    there = False

    def __init__(self) -> None:
        super().__init__(1)

    def warm(self) -> None:
        """Nothing to start."""

    def run(self, requests: Iterable[Mapping[str, Any]]) -> Iterator[tuple[Mapping[str, Any], dict[str, Any]]]:
        """Every request fails."""
        for request in requests:
            yield request, {"failed": ABSENT, "words": "the store does not have it", "detail": ""}


class EndingWorkers(Workers):
    """Workers that stay ended: after `end` whoever still waits for an answer gets failures, and none is started again."""

    ended = False

    def ensure(self) -> None:
        """Start those that are missing. Raises `WorkerBroken` after the end."""
        if self.ended:
            raise WorkerBroken("the workers have been ended for good")
        super().ensure()

    def end(self) -> None:
        """End them for good."""
        self.ended = True
        self.close()


def once(flags: Sequence[str], request: Mapping[str, Any]) -> dict[str, Any]:
    """One request to a short-lived worker of its own (`--assemble`): its answer, as `Workers.run` gives it."""
    try:
        process = _server(flags)
    except OSError as fault:
        return {"failed": "crashed", "words": _no_process(fault), "detail": ""}
    try:
        process.ask({"id": 0, **request})
        answer: dict[str, Any] = process.answer(float(request["timeout"]) + LOADING)
        return answer
    except ProcessLost as fault:
        return {"failed": "hung" if fault.hung else "crashed", "words": "" if fault.hung else f"of the worker {fault.words}", "detail": ""}
    finally:
        process.kill()
        process.close()


def _request_text(request: Mapping[str, Any]) -> str:
    """A request as it is compared with others: 1, 1.0 and True are not the same."""
    return json.dumps(request, sort_keys=True)


def _server(flags: Sequence[str], seed: int = 0, lines: Lines | None = None) -> JsonLinesProcess:
    words = ("--parent", str(os.getpid()), *flags)
    return JsonLinesProcess("thingc.geometry.worker.server", *words, env=environment(seed), lines=lines)


def _no_process(fault: OSError) -> str:
    return f"no worker process can be started: {fault.strerror or fault}"


_FRAME = re.compile(r'^\s*File "(?P<file>.+?)", line (?P<line>\d+)', re.MULTILINE)


def failure_of(subject: str, answer: Mapping[str, Any], timeout: float, workspace: Workspace) -> PartFailure:
    """What to say of a part that has ended its process, by the answer of the worker; `timeout` [s] is what it was given."""
    file, line = _place_of(answer.get("detail", ""), workspace)
    message = f"it was not done after {timeout:g} s" if answer["failed"] == "hung" else answer["words"]
    return PartFailure(
        subject=subject, kind=answer["failed"], message=message, file=full(file, workspace.root), line=line,
        detail=answer.get("detail") or None,
    )


def _place_of(trace: str, workspace: Workspace) -> tuple[str | None, int | None]:
    """The innermost `(file, line)` of a part folder in what `faulthandler` wrote (most recent call first)."""
    folders = tuple(os.path.join(folder, "") for folder in workspace.parts)
    # of several threads, and of a trace before the last, the one that was written last counts
    for match in _FRAME.finditer(trace[max(trace.rfind("most recent call first"), 0) :]):
        if match["file"].startswith(folders):
            return match["file"], int(match["line"])
    return None, None

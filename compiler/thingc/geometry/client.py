"""Start and end worker processes, send requests to them, collect the answers, and parse the traces of crashes."""

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
from typing import Any

from thingc.base.json_lines_process import JsonLinesProcess, Lines, ProcessLost
from thingc.documents.workspace import Workspace
from thingc.geometry.key.environment_variables import environment
from thingc.geometry.record import PartFailure
from thingc.geometry.record_json import full
from thingc.geometry.worker import process_tree

GRACE = 15.0
"""Grace period [s] after the deadline of a request. A worker that does not answer within the grace period is ended."""
LOADING = 120.0
"""Time limit [s] for a worker to load the kernel."""

SPANS = 1000
"""Number of recent answers for which the start and end times are stored, so that the method `busy` can use them."""

CAN_FORK = hasattr(os, "fork")

_ENDED = "the workers have been shut down"

ABSENT = "absent"
"""Failure kind of a part that is not in the store."""


class WorkerBroken(Exception):
    """Raised if no worker can be started, because the CAD kernel cannot be loaded (`detail` is the traceback) or the system cannot start a
    process.
    """

    def __init__(self, message: str, detail: str = "") -> None:
        super().__init__(message)
        self.detail = detail


@dataclass(slots=True)
class _Process:
    """A worker process, with the requests that it has not answered yet."""

    process: JsonLinesProcess
    capacity: int
    deadline: float
    asked: dict[int, Mapping[str, Any]] = field(default_factory=dict)
    ready: bool = False


class Workers:
    """The worker processes of one service: a single process that forks if the system supports fork, otherwise one process per job.

    Processes are started when they are first needed. `close` or the end of this process ends the worker processes. `seed` is the Python
    hash seed of the workers, which determines the iteration order of sets of strings. `there` is False if no worker will ever be started.
    """

    there = True

    def __init__(self, jobs: int, *, forking: bool = CAN_FORK, seed: int = 0) -> None:
        self.jobs = max(1, jobs)
        self.forking = forking
        self.seed = seed
        self.ended = False
        self._owner = os.getpid()
        self._processes: list[_Process] = []
        self._lines: Lines = queue.SimpleQueue()
        self._number = 0
        self._begun: dict[str, int] = {}
        self._early: dict[int, tuple[JsonLinesProcess, dict[str, Any]]] = {}
        self._spans: deque[tuple[float, float]] = deque(maxlen=SPANS)

    def busy(self, since: float) -> float:
        """Return the time [s] that workers have spent on building, measuring or slicing parts since `since` (`time.monotonic`).

        Times in which several workers are busy count only once. The time for loading part modules does not count.
        """
        total, until = 0.0, since
        for begun, ended in sorted(self._spans):
            total += max(0.0, ended - max(begun, until))
            until = max(until, ended)
        return total

    @property
    def running(self) -> bool:
        """Whether a worker process is running."""
        return bool(self._processes)

    def warm(self) -> None:
        """Start the workers without waiting, so that they load the kernel while the caller continues.

        If no worker starts, `run` raises the error later.
        """
        with contextlib.suppress(WorkerBroken):
            self.ensure()

    def _leave_others(self) -> None:
        """Discard the references to the workers in a forked child process. The workers belong to the parent process, which continues to use
        them.
        """
        if self._owner != os.getpid():
            self._owner = os.getpid()
            self._processes, self._lines = [], queue.SimpleQueue()
            self._begun, self._early = {}, {}

    def ensure(self) -> None:
        """Start worker processes that are not running yet. Raises `WorkerBroken` if no worker can be started, and after a call of `end`."""
        if self.ended:
            raise WorkerBroken(_ENDED)
        self._leave_others()
        wanted = 1 if self.forking else self.jobs
        while len(self._processes) < wanted:
            flags = ["--jobs", str(self.jobs)] if self.forking else ["--inline"]
            self._processes.append(self._start(flags, self.jobs if self.forking else 1))

    def begin(self, requests: Iterable[Mapping[str, Any]]) -> None:
        """Send requests to the workers without waiting for answers.

        A later call of `run` with the same requests then gets the answers sooner. The method does nothing if workers cannot fork. If no
        worker starts, `run` raises the error later.
        """
        if self.forking:
            with contextlib.suppress(WorkerBroken):
                self.ensure()
                for request in requests:
                    self._begun[_request_text(request)] = self._send(self._processes[0], request)

    def prepare(self, files: Sequence[str]) -> None:
        """Let running workers compile the source files of a part before the part is requested."""
        self._leave_others()
        for worker in self._processes if self.forking else ():
            worker.process.ask({"prepare": files})

    def forget(self, but: Iterable[Mapping[str, Any]] = ()) -> None:
        """Cancel the requests that `begin` sent, except the requests in `but`."""
        self._leave_others()
        wanted = set(map(_request_text, but))
        for text in [text for text in self._begun if text not in wanted]:
            number = self._begun.pop(text)
            self._early.pop(number, None)
            for worker in self._processes:
                if worker.asked.pop(number, None) is not None:
                    worker.process.ask({"forget": number})

    def run(self, requests: Iterable[Mapping[str, Any]]) -> Iterator[tuple[Mapping[str, Any], dict[str, Any]]]:
        """Yield every request with its answer when the answer arrives: `{"answer": ...}` or `{"failed", "words", "detail"}`.

        A request contains the operation `op` and the time limit `timeout` [s]. `requests` is read lazily, shortly before each request is
        sent. Raises `WorkerBroken` if no worker can be started.
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
                if self.forking and lost <= 1:  # the forking server itself ended for an unknown reason: send the request a second time
                    waiting.extendleft(reversed(left.values()))
                else:
                    yield from ((request, dict(answer)) for request in left.values())
                continue
            number, request = self._match_answer(worker, answer)
            if number in under_way and request is not None:  # otherwise the answer belongs to a run that was abandoned
                under_way.remove(number)
                yield request, answer

    def _hand_out(self, waiting: deque[Mapping[str, Any]], source: Iterator[Mapping[str, Any]], under_way: set[int]) -> None:
        """Send each worker process as many requests as it has capacity for. Requests in `waiting` come before requests from `source`."""
        for worker in self._processes:
            limit = (2 if self.forking else 1) * worker.capacity - (len(worker.asked) - len(self._begun))
            waiting.extend(islice(source, max(0, limit - len(waiting))))
            for _ in range(min(limit, len(waiting))):
                request = waiting.popleft()
                under_way.add(self._send(worker, request) if (begun := self._find_begun(request)) is None else begun)

    def _find_begun(self, request: Mapping[str, Any]) -> int | None:
        """Return the number of a request that `begin` has already sent to a worker, or None.

        The method `run` then waits for the answer to this request. An answer that has already arrived is put back into the queue.
        """
        number = self._begun.pop(_request_text(request), None)
        if number is not None and number in self._early:
            self._lines.put(self._early.pop(number))
        return number

    def _heard(self) -> tuple[_Process, dict[str, Any], bool] | None:
        """Wait for a message from any worker process.

        The result consists of a worker, its answer and True, or of a worker that was ended, its failure and False. For any other message,
        the result is None. Raises `WorkerBroken` if no worker can be started.
        """
        try:
            process, answer = self._lines.get(timeout=max(0.05, min(w.deadline for w in self._processes) - time.monotonic()))
        except queue.Empty:
            worker = min(self._processes, key=lambda w: w.deadline)
            if worker.deadline > time.monotonic():
                return None
            self._end(worker)
            return worker, {"failed": "hung", "words": "", "detail": ""}, False
        if not self._processes:  # closed by another thread
            raise WorkerBroken(_ENDED)
        known = next((one for one in self._processes if one.process is process), None)
        if known is None:
            return None
        if answer is None:
            self._end(known)
            return known, {"failed": "crashed", "words": "the worker process ended", "detail": ""}, False
        if "broken" in answer:
            self.close()
            raise WorkerBroken(f"the CAD kernel cannot be loaded: {answer['broken']}", answer.get("detail", ""))
        if "ready" in answer:
            known.ready = True
            self._put_off(known)
            return None
        return known, answer, True

    def _match_answer(self, worker: _Process, answer: dict[str, Any]) -> tuple[int, Mapping[str, Any] | None]:
        """Find the request to which a worker's answer belongs.

        Return the number of the request and the request itself. Remove `id` and `span` from the answer. The returned request is None if the
        request was cancelled. The returned request is also None if `begin` sent the request and `run` has not requested it yet. In this
        case, the answer is stored until `run` requests it.
        """
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
        """End all worker processes and wait until they have ended."""
        self._leave_others()
        ended, self._processes = self._processes, []
        self._begun, self._early = {}, {}
        for worker in ended:
            if not worker.ready or not self.forking and worker.asked:  # such a worker does not read its input
                worker.process.kill()
            worker.process.close()

    def end(self) -> None:
        """End all worker processes and do not restart them. All waiting callers get failures."""
        self.ended = True
        self.close()

    def _end(self, worker: _Process) -> None:
        self._processes.remove(worker)
        self._begun = {text: number for text, number in self._begun.items() if number not in worker.asked}
        self._early = {number: early for number, early in self._early.items() if number not in worker.asked}
        process_tree.stop(worker.process.pid)  # a stopped process cannot fork
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
        """Extend the deadline of a worker. Call this method after each message from the worker and each request to it.

        A forking worker enforces the deadlines of its children, so the worker sends an answer within each timeout.
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
    """A replacement for `Workers` that does not start processes. Each request gets a failure of the kind `ABSENT`."""

    there = False

    def __init__(self) -> None:
        super().__init__(1)

    def warm(self) -> None:
        """Do nothing, because there are no workers."""

    def run(self, requests: Iterable[Mapping[str, Any]]) -> Iterator[tuple[Mapping[str, Any], dict[str, Any]]]:
        """Yield a failure of the kind `ABSENT` for every request."""
        for request in requests:
            yield request, {"failed": ABSENT, "words": "the cache does not contain the part", "detail": ""}


def once(flags: Sequence[str], request: Mapping[str, Any]) -> dict[str, Any]:
    """Start a new worker process, send one request to it, and return its answer.

    The answer has the same form as in `Workers.run`. `flags` contains command-line options of the worker, such as `--once`.
    """
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
    """Convert a request to a string, so that two requests can be compared. The strings for 1, 1.0 and True differ."""
    return json.dumps(request, sort_keys=True)


def _server(flags: Sequence[str], seed: int = 0, lines: Lines | None = None) -> JsonLinesProcess:
    words = ("--parent", str(os.getpid()), *flags)
    return JsonLinesProcess("thingc.geometry.worker.server", *words, env=environment(seed), lines=lines)


def _no_process(fault: OSError) -> str:
    return f"cannot start a worker process: {fault.strerror or fault}"


_FRAME = re.compile(r'^\s*File "(?P<file>.+?)", line (?P<line>\d+)', re.MULTILINE)


def failure_of(subject: str, answer: Mapping[str, Any], timeout: float, workspace: Workspace) -> PartFailure:
    """Create the failure of a part whose worker process ended before it answered.

    `answer` describes how the process ended, and `timeout` [s] is the time limit of the request.
    """
    file, line = _place_of(answer.get("detail", ""), workspace)
    message = f"it took longer than {timeout:g} s" if answer["failed"] == "hung" else answer["words"]
    return PartFailure(
        subject=subject, kind=answer["failed"], message=message, file=full(file, workspace.root), line=line,
        detail=answer.get("detail") or None,
    )


def _place_of(trace: str, workspace: Workspace) -> tuple[str | None, int | None]:
    """Find the innermost line of part code in a crash trace of `faulthandler`, which lists the most recent call first.

    Return the file and the line. Return `(None, None)` if the trace contains no line of a file in a part folder.
    """
    folders = tuple(os.path.join(folder, "") for folder in workspace.parts)
    # with several threads, or after an earlier trace, use the last match
    for match in _FRAME.finditer(trace[max(trace.rfind("most recent call first"), 0) :]):
        if match["file"].startswith(folders):
            return match["file"], int(match["line"])
    return None, None

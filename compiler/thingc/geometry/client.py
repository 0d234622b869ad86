"""Start and end worker processes, send requests to them, and collect the answers."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from thingc.base.json_lines_process import JsonLinesProcess, Lines, ProcessLost
from thingc.geometry.key.environment_variables import environment
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
    deadline: float
    unanswered: dict[int, Mapping[str, Any]] = field(default_factory=dict)
    ready: bool = False


class Workers:
    """The worker processes of one service: a single process that forks if the system supports fork, otherwise one process per job.

    Only one thread may send requests. Processes are started when they are first needed. `close` or the end of this process ends the
    worker processes. `seed` is the Python hash seed of the workers, which determines the iteration order of sets of strings.
    `available` is False if no worker will ever be started.
    """

    available = True

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
        for start, end in sorted(self._spans):
            total += max(0.0, end - max(start, until))
            until = max(until, end)
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
        flags = ["--jobs", str(self.jobs)] if self.forking else ["--inline"]
        while len(self._processes) < (1 if self.forking else self.jobs):
            try:
                process = _server(flags, self.seed, self._lines)
            except OSError as fault:
                raise WorkerBroken(_no_process(fault)) from fault
            self._processes.append(_Process(process=process, deadline=time.monotonic() + LOADING))

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
        needed = set(map(_request_text, but))
        for text in [text for text in self._begun if text not in needed]:
            number = self._begun.pop(text)
            self._early.pop(number, None)
            for worker in self._processes:
                if worker.unanswered.pop(number, None) is not None:
                    worker.process.ask({"forget": number})

    def run(self, requests: Iterable[Mapping[str, Any]]) -> Iterator[tuple[Mapping[str, Any], dict[str, Any]]]:
        """Yield every request with its answer when the answer arrives: `{"answer": ...}` or `{"failed", "message", "detail"}`.

        A request contains the operation `op` and the time limit `timeout` [s]. `requests` is read lazily, shortly before each request is
        sent. Raises `WorkerBroken` if no worker can be started.
        """
        source = iter(requests)
        to_send: deque[Mapping[str, Any]] = deque()
        sent: set[int] = set()
        ended_workers = 0
        while True:
            if not (to_send or sent):
                to_send.extend(islice(source, 1))
                if not to_send:
                    return
            self.ensure()
            self._hand_out(to_send, source, sent)
            message = self._next_message()
            if message is None:
                continue
            worker, answer, is_alive = message
            if not is_alive:
                lost = {number: request for number, request in worker.unanswered.items() if number in sent}
                sent -= lost.keys()
                ended_workers += 1
                if self.forking and ended_workers == 1:  # the forking server ended for an unknown reason: send the requests a second time
                    to_send.extendleft(reversed(lost.values()))
                else:
                    yield from ((request, dict(answer)) for request in lost.values())
                continue
            number, request = self._match_answer(worker, answer)
            if number in sent and request is not None:  # otherwise the answer belongs to a run that was abandoned
                sent.remove(number)
                yield request, answer

    def _hand_out(self, to_send: deque[Mapping[str, Any]], source: Iterator[Mapping[str, Any]], sent: set[int]) -> None:
        """Send each worker process as many requests as it has capacity for. Requests in `to_send` come before requests from `source`."""
        for worker in self._processes:
            limit = (2 * self.jobs if self.forking else 1) - (len(worker.unanswered) - len(self._begun))
            to_send.extend(islice(source, max(0, limit - len(to_send))))
            for _ in range(min(limit, len(to_send))):
                request = to_send.popleft()
                number = self._begun.pop(_request_text(request), None)  # the number of a request that `begin` has sent
                if number is None:
                    number = self._send(worker, request)
                elif number in self._early:  # the answer has already arrived
                    self._lines.put(self._early.pop(number))
                sent.add(number)

    def _next_message(self) -> tuple[_Process, dict[str, Any], bool] | None:
        """Wait for a message from any worker process.

        The result consists of a worker, its answer and True, or of a worker that was ended, its failure and False. For any other message,
        the result is None. Raises `WorkerBroken` if no worker can be started.
        """
        try:
            process, answer = self._lines.get(timeout=max(0.05, min(w.deadline for w in self._processes) - time.monotonic()))
        except queue.Empty:
            slowest = min(self._processes, key=lambda w: w.deadline)
            if slowest.deadline > time.monotonic():
                return None
            self._end(slowest)
            return slowest, {"failed": "hung", "message": "", "detail": ""}, False
        if not self._processes:  # closed by another thread
            raise WorkerBroken(_ENDED)
        worker = next((known for known in self._processes if known.process is process), None)
        if worker is None:
            return None
        if answer is None:
            self._end(worker)
            return worker, {"failed": "crashed", "message": "the worker process ended", "detail": ""}, False
        if "broken" in answer:
            self.close()
            raise WorkerBroken(f"the CAD kernel cannot be loaded: {answer['broken']}", answer.get("detail", ""))
        if "ready" in answer:
            worker.ready = True
            self._extend_deadline(worker)
            return None
        return worker, answer, True

    def _match_answer(self, worker: _Process, answer: dict[str, Any]) -> tuple[int, Mapping[str, Any] | None]:
        """Find the request to which a worker's answer belongs.

        Return the number of the request and the request itself. Remove `id` and `span` from the answer. The returned request is None if the
        request was cancelled. The returned request is also None if `begin` sent the request and `run` has not requested it yet. In this
        case, the answer is stored until `run` requests it.
        """
        number: int = answer["id"]
        if number in self._begun.values():
            self._early[number] = (worker.process, answer)
            self._extend_deadline(worker)
            return number, None
        del answer["id"]
        span = answer.pop("span", None)
        request = worker.unanswered.pop(number, None)
        self._extend_deadline(worker)
        if span is not None and request is not None and request["op"] != "describe":
            self._spans.append((span[0], span[1]))
        return number, request

    def close(self) -> None:
        """End all worker processes and wait until they have ended."""
        self._leave_others()
        ended, self._processes = self._processes, []
        self._begun, self._early = {}, {}
        for worker in ended:
            if not worker.ready or not self.forking and worker.unanswered:  # such a worker does not read its input
                worker.process.kill()
            worker.process.close()

    def end(self) -> None:
        """End all worker processes and do not restart them. All waiting callers get failures."""
        self.ended = True
        self.close()

    def _end(self, worker: _Process) -> None:
        self._processes.remove(worker)
        self._begun = {text: number for text, number in self._begun.items() if number not in worker.unanswered}
        self._early = {number: early for number, early in self._early.items() if number not in worker.unanswered}
        process_tree.stop(worker.process.pid)  # a stopped process cannot fork
        process_tree.end_descendants(worker.process.pid)
        worker.process.kill()
        worker.process.close()

    def _send(self, worker: _Process, request: Mapping[str, Any]) -> int:
        self._number += 1
        worker.unanswered[self._number] = request
        self._extend_deadline(worker)
        worker.process.ask({"id": self._number, **request})
        return self._number

    def _extend_deadline(self, worker: _Process) -> None:
        """Extend the deadline of a worker. Call this method after each message from the worker and each request to it.

        A forking worker enforces the deadlines of its children, so the worker sends an answer within each timeout.
        """
        longest = max((float(request["timeout"]) for request in worker.unanswered.values()), default=0.0)
        worker.deadline = time.monotonic() + longest + (GRACE if self.forking else 0.0) + (0.0 if worker.ready else LOADING)


class NoWorkers(Workers):
    """A replacement for `Workers` that does not start processes. Each request gets a failure of the kind `ABSENT`."""

    available = False

    def __init__(self) -> None:
        super().__init__(1)

    def warm(self) -> None:
        """Do nothing, because there are no workers."""

    def run(self, requests: Iterable[Mapping[str, Any]]) -> Iterator[tuple[Mapping[str, Any], dict[str, Any]]]:
        """Yield a failure of the kind `ABSENT` for every request."""
        for request in requests:
            yield request, {"failed": ABSENT, "message": "the cache does not contain the part", "detail": ""}


def begin_once(request: Mapping[str, Any]) -> Callable[[], dict[str, Any]]:
    """Start a new worker process, and send one request to it. Return a function that waits for the answer and ends the process.

    The answer has the same form as in `Workers.run`. If the function is not called, the process ends after its answer.
    """
    try:
        process = _server(["--once"])
    except OSError as fault:
        message = _no_process(fault)
        return lambda: {"failed": "crashed", "message": message, "detail": ""}
    process.ask({"id": 0, **request})

    def wait() -> dict[str, Any]:
        try:
            answer: dict[str, Any] = process.answer(float(request["timeout"]) + LOADING)
            return answer
        except ProcessLost as fault:
            return {"failed": "hung" if fault.hung else "crashed", "message": "" if fault.hung else f"of the worker {fault}", "detail": ""}
        finally:
            process.kill()
            process.close()

    return wait


def _request_text(request: Mapping[str, Any]) -> str:
    """Convert a request to a string, so that two requests can be compared. The strings for 1, 1.0 and True differ."""
    return json.dumps(request, sort_keys=True)


def _server(flags: Sequence[str], seed: int = 0, lines: Lines | None = None) -> JsonLinesProcess:
    options = ("--parent", str(os.getpid()), *flags)
    return JsonLinesProcess("thingc.geometry.worker.server", *options, env=environment(seed), lines=lines)


def _no_process(fault: OSError) -> str:
    return f"cannot start a worker process: {fault.strerror or fault}"

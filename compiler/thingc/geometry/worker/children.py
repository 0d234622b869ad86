"""Child processes of the worker. On systems that can fork, the server forks a child process for each request.

In a child process, part code can end only its own process and change files only in its own folder. When a child process ends, the server
also ends the processes that the part started.
"""

from __future__ import annotations

import contextlib
import faulthandler
import json
import os
import select
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

from thingc.documents.workspace import DEFAULT_MEMORY
from thingc.geometry.worker import process_tree
from thingc.geometry.worker.process_tree import prctl
from thingc.geometry.worker.sandbox import PROCESSES, confine
from thingc.geometry.worker.scratch import settle

KEPT = 8192
"""Number of bytes that are read from the end of a child's standard error."""
FAREWELL = 1.0
"""Time limit [s] for the processes that a child started to end after the child has ended."""
HELPERS = ("from multiprocessing.resource_tracker import", "from multiprocessing.forkserver import")
"""Strings that identify Python's helper processes by their command lines. A helper process ends together with the process that uses it."""
LAST_WORDS = 3.0
"""Time limit [s] for a child to write a traceback and to exit."""
WATCH = 0.05
"""Interval [s] at which the children and the numbers of their processes are checked."""
ANSWER = 200_000_000
"""Maximum size of the answer of a child [bytes]."""
OUT_OF_MEMORY = 91
"""Exit status of a child that needed more memory than was available."""
_PARENT_DEATH_SIGNAL = 1
"""The option `PR_SET_PDEATHSIG` of the system call `prctl`."""


@dataclass(slots=True, kw_only=True)
class Child:
    """A running child process of the worker.

    `request` is the request that was sent to the child. `request` is empty until a request is sent. `process` is the process id of the
    child, which leads its own process group. `request_pipe` is the pipe for the request. The pipe is closed, and `request_pipe` is -1,
    after the request was sent. `pipe` is the pipe for the answer. `errors` is the standard error of the child, and `scratch` is the folder
    of the part. `status` is the wait status of the child, or None if the child has not ended.
    """

    request: Mapping[str, Any]
    process: int
    request_pipe: int
    pipe: int
    errors: Any
    scratch: str
    deadline: float
    received: bytearray
    status: int | None = None

    def ask(self, request: Mapping[str, Any]) -> None:
        """Send a request to the child process through its pipe."""
        self.request = request
        self.deadline = time.monotonic() + float(request["timeout"])
        line = json.dumps(request).encode()
        with contextlib.suppress(OSError):  # the child may have ended; another method detects this
            while line:
                line = line[os.write(self.request_pipe, line) :]
        self._close_request_pipe()

    def _close_request_pipe(self) -> None:
        if self.request_pipe >= 0:
            os.close(self.request_pipe)
            self.request_pipe = -1

    def read(self) -> bool:
        """Read the data that has arrived in the pipe for the answer. Return False if the pipe is closed."""
        try:
            data = os.read(self.pipe, 1 << 20)
        except OSError:
            data = b""
        self.received += data
        return bool(data)

    @property
    def answered(self) -> bool:
        """Return whether the child process has sent its complete answer."""
        return self.received.endswith(b"\n")

    @property
    def answer(self) -> dict[str, Any]:
        """The answer of the child process, for the client."""
        return {"id": self.request["id"], **json.loads(self.received)}

    def stop(self) -> bool:
        """Stop the child process with a stop signal. Return True if the child process has not started other processes."""
        self._kill(signal.SIGSTOP)
        return not process_tree.descendants(self.process)

    def end_reason(self, now: float) -> str | None:
        """Return the reason why a child process without an answer must be ended, or None.

        The reason is `hung`, `swarmed` (too many processes), `starved` (too much memory) or `crashed`.
        """
        if self.deadline <= now:
            return "hung"
        started = process_tree.descendants(self.process)
        if len(started) > PROCESSES:
            return "swarmed"
        if process_tree.exceeds((self.process, *started), self.request.get("memory", DEFAULT_MEMORY)):
            return "starved"
        return "crashed" if self._has_ended() else None

    def wait(self) -> dict[str, Any]:
        """Wait until the child answers or must be ended. After that, end the child, and return the same answer as `end`."""
        reason = None
        while not self.answered and reason is None:
            if not select.select([self.pipe], [], [], WATCH)[0]:
                reason = self.end_reason(time.monotonic())
            elif not self.read() or len(self.received) > ANSWER:
                reason = "crashed"
        return self.end(reason, ())

    def end(self, reason: str | None, others: Collection[int]) -> dict[str, Any]:
        """End the child and all processes that it has started, except the processes `others`, which run in parallel.

        Return the answer for the client.

        `reason` is the reason for ending the child without an answer.
        """
        if not self.answered and reason in (None, "crashed"):
            self._wait()
        elif reason in ("swarmed", "starved"):
            process_tree.stop(self.process)
            process_tree.end_descendants(self.process)
            self._kill(signal.SIGABRT)  # the signal makes the child write its traceback
            self._kill(signal.SIGCONT)
            self._wait()
        outliving = self._end_processes(others)
        self._close_request_pipe()
        os.close(self.pipe)
        try:
            if self.answered:
                return {**self.answer, **({"left": outliving} if outliving else {})}
            self.errors.seek(0, os.SEEK_END)
            self.errors.seek(max(0, self.errors.tell() - KEPT))
            tail = self.errors.read().decode("utf-8", "replace")
        finally:
            self.errors.close()
        if self.status is not None and self.status >> 8 == OUT_OF_MEMORY:
            reason = "starved"
        reason = reason or "crashed"
        reasons = {
            "hung": "", "swarmed": f"more than {PROCESSES} at once", "crashed": end_text(self.status),
            "starved": f"more than {self.request.get('memory', DEFAULT_MEMORY) / 1e9:.3g} GB",
        }
        return {"id": self.request.get("id"), "failed": reason, "message": reasons[reason], "detail": tail}

    def _end_processes(self, others: Collection[int]) -> list[str]:
        """Kill the child process and all processes that it started.

        If the child sent an answer, return the command lines of the processes that were still running.
        """
        started = process_tree.alive(process_tree.descendants(self.process)) if self.answered else []
        own_command, commands = process_tree.command(self.process), {one: process_tree.command(one) for one in started}
        self._kill(signal.SIGKILL)
        outliving = process_tree.outliving(started, FAREWELL)
        process_tree.signal_group(self.process, signal.SIGKILL)
        if self.status is None:
            with contextlib.suppress(ChildProcessError):
                os.waitpid(self.process, 0)
        process_tree.end_all_but(others)
        lines = [commands[process] for process in outliving if not any(text in commands[process] for text in HELPERS)]
        return ["" if line == own_command else line for line in lines]

    def _kill(self, number: signal.Signals) -> None:
        if self.status is None:  # otherwise, another process may already have the same id
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.process, number)

    def _has_ended(self) -> bool:
        if self.status is None:
            with contextlib.suppress(ChildProcessError):
                process, status = os.waitpid(self.process, os.WNOHANG)
                self.status = status if process else None
        return self.status is not None

    def _wait(self) -> None:
        """Wait until the child exits, for at most `LAST_WORDS` seconds."""
        last = time.monotonic() + LAST_WORDS
        while not self._has_ended() and time.monotonic() < last:
            time.sleep(process_tree.PAUSE)


def end_text(status: int | None) -> str:
    """Describe how a process ended, from its wait status."""
    if status is None:
        return "closed its pipe without exiting"
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        try:
            return f"killed by {signal.Signals(number).name}"
        except ValueError:
            return f"killed by signal {number}"
    return f"exit status {os.WEXITSTATUS(status)}"


def die_with_parent(parent: int) -> None:
    """Make the operating system kill this process when its parent process ends (Linux). Exit immediately if the parent has already
    ended.
    """
    if sys.platform == "linux":
        prctl(_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def live_without_parent() -> None:
    """Let this process continue after its parent has ended, which undoes `die_with_parent`."""
    if sys.platform == "linux":
        prctl(_PARENT_DEATH_SIGNAL, 0)


def fork_child(
    run: Callable[[Mapping[str, Any]], dict[str, Any]], nice: int, scratch: str, unused_descriptors: Sequence[int],
    readable: Sequence[str] | None = None,
) -> Child:
    """Fork a new child process. The child waits for a request (see `Child.ask`), calls `run(request)`, and writes the answer as one line.
    After that, the child waits until the server ends it.

    `scratch` is the only folder in which the child may change files. `nice` is the scheduling priority of the child. The child closes the
    file descriptors in `unused_descriptors`. `readable` is passed to `confine`.
    """
    reader, writer = os.pipe()
    request_reader, request_writer = os.pipe()
    errors = tempfile.TemporaryFile()  # noqa: SIM115 (it lives as long as the child)
    server = os.getpid()
    process = os.fork()
    if process == 0:
        status = 1
        try:
            os.setsid()  # this call also detaches the child from the terminal, so that it cannot send input to the terminal
            if sys.platform != "linux":
                _watch(server)
            die_with_parent(server)
            for descriptor in (reader, request_writer, *unused_descriptors):
                os.close(descriptor)
            settle(scratch)
            process_tree.give_priority(nice)
            process_tree.adopt_orphans()
            confine(scratch, readable)
            os.dup2(errors.fileno(), 1)
            os.dup2(errors.fileno(), 2)
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            answer = _answer(run, request_reader, errors.fileno(), scratch)
            while answer:
                answer = answer[os.write(writer, answer) :]
            status = 0
            while os.getppid() == server:  # while the child is alive, the processes that it started can be found
                signal.pause()
        except BaseException as fault:
            import traceback

            status = OUT_OF_MEMORY if isinstance(fault, MemoryError) else 1
            os.write(errors.fileno(), traceback.format_exc().encode("utf-8", "replace"))
        finally:
            os._exit(status)
    os.close(writer)
    os.close(request_reader)
    return Child(
        request={}, process=process, request_pipe=request_writer, pipe=reader, errors=errors, scratch=scratch, deadline=inf,
        received=bytearray(),
    )


def _answer(run: Callable[[Mapping[str, Any]], dict[str, Any]], reader: int, errors: int, scratch: str) -> bytes:
    """Wait for a request, run it, and return the line with the answer.

    If Python crashes or the time limit is almost reached, the traceback is written to `errors`.
    """
    with open(reader, "rb") as stream:
        request = json.loads(stream.read())
    timeout = float(request["timeout"])
    faulthandler.enable(file=errors, all_threads=False)
    faulthandler.dump_traceback_later(timeout - min(0.5, timeout / 4), file=errors)
    _without_core_dump()
    answer = json.dumps(run({**request, "scratch": scratch})).encode() + b"\n"
    faulthandler.cancel_dump_traceback_later()
    return answer


def _without_core_dump() -> None:
    with contextlib.suppress(ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _watch(server: int) -> None:
    """Start a thread that ends the child when the server ends. The thread is used on systems without a signal for the end of the parent."""
    import threading

    def watch() -> None:
        while os.getppid() == server:
            time.sleep(0.2)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()

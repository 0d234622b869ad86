"""One forked child per request, on systems that can fork: whatever part code does, it ends its own process only, changes files in
its own folder only, and nothing that it has started outlives it."""

from __future__ import annotations

import contextlib
import faulthandler
import json
import os
import resource
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
"""How many bytes of the end of a child's standard error are looked at."""
FAREWELL = 1.0
"""How long [s] after a child what it has started may take to notice and to end."""
HELPERS = ("from multiprocessing.resource_tracker import", "from multiprocessing.forkserver import")
"""What the command lines of processes hold that Python starts for itself, and that end with the one that they help."""
LAST_WORDS = 3.0
"""How long [s] a child that is about to end may take to do so, and to say where it was."""
WATCH = 0.05
"""How often [s] to look whether children run and how many processes they have."""
ANSWER = 200_000_000
"""Bytes of an answer at most, of a child that is waited for."""
OUT_OF_MEMORY = 91
"""How a child exits that asks for more memory than there is."""
_PARENT_DEATH_SIGNAL = 1
"""`PR_SET_PDEATHSIG`."""


@dataclass(slots=True, kw_only=True)
class Child:
    """A running child: what was asked of it (nothing yet: empty), its process (leader of its own group), the pipes that it is asked on
    (-1: it has been) and that its answer comes on, its standard error, and its folder. `status` is how it has ended, as far as that is
    known."""

    request: Mapping[str, Any]
    process: int
    asking: int
    pipe: int
    errors: Any
    scratch: str
    deadline: float
    received: bytearray
    status: int | None = None

    def ask(self, request: Mapping[str, Any]) -> None:
        """Ask it what it is there for."""
        self.request = request
        self.deadline = time.monotonic() + float(request["timeout"])
        line = json.dumps(request).encode()
        with contextlib.suppress(OSError):  # it has ended, which is found out as of others
            while line:
                line = line[os.write(self.asking, line) :]
        self._close_asking()

    def _close_asking(self) -> None:
        if self.asking >= 0:
            os.close(self.asking)
            self.asking = -1

    def read(self) -> bool:
        """Take what has come; False at the end."""
        try:
            data = os.read(self.pipe, 1 << 20)
        except OSError:
            data = b""
        self.received += data
        return bool(data)

    @property
    def answered(self) -> bool:
        """Whether a whole answer has come."""
        return self.received.endswith(b"\n")

    @property
    def answer(self) -> dict[str, Any]:
        """What it has answered, for the client."""
        return {"id": self.request["id"], **json.loads(self.received)}

    def stop(self) -> bool:
        """Let the child do nothing any more; whether it has started nothing that might."""
        self._kill(signal.SIGSTOP)
        return not process_tree.descendants(self.process)

    def over(self, now: float) -> str | None:
        """Whether it is time to end the child, which has not answered: `hung`, `swarmed` (too many processes), `starved` (too much memory),
        or `crashed`."""
        if self.deadline <= now:
            return "hung"
        started = process_tree.descendants(self.process)
        if len(started) > PROCESSES:
            return "swarmed"
        if process_tree.exceeds((self.process, *started), self.request.get("memory", DEFAULT_MEMORY)):
            return "starved"
        return "crashed" if self._ended() else None

    def wait(self) -> dict[str, Any]:
        """Wait for the answer, or for the time when it is over, and end the child: the answer, as of `end`."""
        over = None
        while not self.answered and over is None:
            if not select.select([self.pipe], [], [], WATCH)[0]:
                over = self.over(time.monotonic())
            elif not self.read() or len(self.received) > ANSWER:
                over = "crashed"
        return self.end(over, ())

    def end(self, over: str | None, others: Collection[int]) -> dict[str, Any]:
        """End the child and everything that it has started, but nothing of the `others` that run beside it, and say how it went: the
        answer for the client. `over`: why it is ended without an answer."""
        number = {"id": self.request.get("id")}
        if not self.answered and over in (None, "crashed"):
            self._wait()
        elif over in ("swarmed", "starved"):
            process_tree.stop(self.process)
            process_tree.end_descendants(self.process)
            self._kill(signal.SIGABRT)  # it says where it is
            self._kill(signal.SIGCONT)
            self._wait()
        left = self._end_processes(others)
        self._close_asking()
        os.close(self.pipe)
        try:
            if self.answered:
                return {**self.answer, **({"left": left} if left else {})}
            self.errors.seek(0, os.SEEK_END)
            self.errors.seek(max(0, self.errors.tell() - KEPT))
            tail = self.errors.read().decode("utf-8", "replace")
        finally:
            self.errors.close()
        if self.status is not None and self.status >> 8 == OUT_OF_MEMORY:
            over = "starved"
        words = {
            "hung": "", "swarmed": f"more than {PROCESSES} of its processes were alive at once",
            "starved": f"more than {self.request.get('memory', DEFAULT_MEMORY) / 1e9:.3g} GB",
        }
        if over in words:
            return {**number, "failed": over, "words": words[over], "detail": tail}
        return {**number, "failed": "crashed", "words": in_words(self.status), "detail": tail}

    def _end_processes(self, others: Collection[int]) -> list[str]:
        """Kill the child and all that it has started. The command lines of what was still at work after an answer."""
        started = process_tree.alive(process_tree.descendants(self.process)) if self.answered else []
        own, words = process_tree.command(self.process), {one: process_tree.command(one) for one in started}
        self._kill(signal.SIGKILL)
        left = process_tree.outliving(started, FAREWELL)
        kill_group(self.process)
        if self.status is None:
            with contextlib.suppress(ChildProcessError):
                os.waitpid(self.process, 0)
        process_tree.end_all_but(others)
        return ["" if words[one] == own else words[one] for one in left if not any(text in words[one] for text in HELPERS)]

    def _kill(self, number: signal.Signals) -> None:
        if self.status is None:  # else the number may be somebody else's by now
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.process, number)

    def _ended(self) -> bool:
        if self.status is None:
            with contextlib.suppress(ChildProcessError):
                process, status = os.waitpid(self.process, os.WNOHANG)
                self.status = status if process else None
        return self.status is not None

    def _wait(self) -> None:
        """Let it end by itself, for a while."""
        last = time.monotonic() + LAST_WORDS
        while not self._ended() and time.monotonic() < last:
            time.sleep(process_tree.PAUSE)


def in_words(status: int | None) -> str:
    """How a process ended, from its wait status."""
    if status is None:
        return "it closed its pipe and went on"
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        try:
            return f"killed by {signal.Signals(number).name}"
        except ValueError:
            return f"killed by signal {number}"
    return f"it ended the interpreter with exit status {os.WEXITSTATUS(status)}"


def kill_group(process: int) -> None:
    """Kill the process group that a child leads or has led."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process, signal.SIGKILL)


def die_with_parent(parent: int) -> None:
    """Let the system kill this process when its parent ends (Linux); ends it at once when that has happened already."""
    if sys.platform == "linux":
        prctl(_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def live_without_parent() -> None:
    """Take `die_with_parent` back."""
    if sys.platform == "linux":
        prctl(_PARENT_DEATH_SIGNAL, 0)


def start(
    run: Callable[[Mapping[str, Any]], dict[str, Any]], nice: int, scratch: str, close: Sequence[int],
    readable: Sequence[str] | None = None,
) -> Child:
    """Fork a child that waits to be asked (`Child.ask`), runs `run(request)` with the folder `scratch` for itself, the only one that it may
    change, and writes the answer as one line. Then it waits for its end. `nice`: how it is scheduled; `close`: descriptors it must not
    hold; `readable`: see `confine`."""
    reader, writer = os.pipe()
    asked, asking = os.pipe()
    errors = tempfile.TemporaryFile()  # noqa: SIM115 (it lives as long as the child)
    server = os.getpid()
    process = os.fork()
    if process == 0:
        status = 1
        try:
            os.setsid()  # also without a terminal: who has one can type into it
            if sys.platform != "linux":
                _watch(server)
            die_with_parent(server)
            for descriptor in (reader, asking, *close):
                os.close(descriptor)
            settle(scratch)
            process_tree.give_priority(nice)
            process_tree.adopt_orphans()
            confine(scratch, readable)
            os.dup2(errors.fileno(), 1)
            os.dup2(errors.fileno(), 2)
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            answer = _answer(run, asked, errors.fileno(), scratch)
            while answer:
                answer = answer[os.write(writer, answer) :]
            status = 0
            while os.getppid() == server:  # as long as it lives, everybody can see what it has started
                signal.pause()
        except BaseException as fault:
            import traceback

            status = OUT_OF_MEMORY if isinstance(fault, MemoryError) else 1
            os.write(errors.fileno(), traceback.format_exc().encode("utf-8", "replace"))
        finally:
            os._exit(status)
    os.close(writer)
    os.close(asked)
    return Child(
        request={}, process=process, asking=asking, pipe=reader, errors=errors, scratch=scratch, deadline=inf, received=bytearray(),
    )


def _answer(run: Callable[[Mapping[str, Any]], dict[str, Any]], asked: int, errors: int, scratch: str) -> bytes:
    """Wait for the request, and do it: the line to answer with. Where Python dies, or it is nearly too late, `errors` has where it was."""
    with open(asked, "rb") as stream:
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
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _watch(server: int) -> None:
    """Where the system cannot do it: a thread that ends the child when the server is gone."""
    import threading

    def watch() -> None:
        while os.getppid() == server:
            time.sleep(0.2)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()

"""One forked child per request, on systems that can fork: whatever part code does, it ends its own process only."""

from __future__ import annotations

import contextlib
import faulthandler
import json
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from thingc.realize.scratch import remove, settle

KEPT = 8192
"""How many bytes of the end of a child's standard error are looked at."""


@dataclass(slots=True, kw_only=True)
class Child:
    """A running child: its process (leader of its own group), the pipe its answer comes on, its standard error, and its folder."""

    number: int
    process: int
    pipe: int
    errors: Any
    scratch: str
    deadline: float
    received: bytearray

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

    def end(self, *, hung: bool = False) -> dict[str, Any]:
        """End the child and everything it started, and say how it went: the answer for the client."""
        status = None if self.answered or hung else self._exit_status()
        kill_group(self.process)
        with contextlib.suppress(ChildProcessError):
            os.waitpid(self.process, 0)
        os.close(self.pipe)
        remove(self.scratch)
        try:
            if self.answered:
                return {"id": self.number, **json.loads(self.received)}
            self.errors.seek(0, os.SEEK_END)
            self.errors.seek(max(0, self.errors.tell() - KEPT))
            tail = self.errors.read().decode("utf-8", "replace")
        finally:
            self.errors.close()
        if hung:
            return {"id": self.number, "failed": "hung", "words": "", "detail": tail}
        return {"id": self.number, "failed": "crashed", "words": in_words(status), "detail": tail}

    def _exit_status(self) -> int | None:
        for _ in range(200):
            try:
                process, status = os.waitpid(self.process, os.WNOHANG)
            except ChildProcessError:
                return None
            if process:
                return status
            time.sleep(0.005)
        return None


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
    """Kill a child and whatever it started (children lead a process group)."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process, signal.SIGKILL)
    with contextlib.suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)


def die_with_parent(parent: int) -> None:
    """Let the system kill this process when its parent ends (Linux); ends it at once when that has happened already."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None, use_errno=True).prctl(1, signal.SIGKILL, 0, 0, 0)  # PR_SET_PDEATHSIG
    if os.getppid() != parent:
        os._exit(1)


def live_without_parent() -> None:
    """Take `die_with_parent` back."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None, use_errno=True).prctl(1, 0, 0, 0, 0)


def start(
    request: Mapping[str, Any], run: Callable[[Mapping[str, Any]], dict[str, Any]], scratch: str, close: list[int]
) -> Child:
    """Fork a child that runs `run(request)` with the folder `scratch` for itself, and writes the answer as one line. `close`:
    descriptors it must not hold."""
    reader, writer = os.pipe()
    errors = tempfile.TemporaryFile()  # noqa: SIM115 (it lives as long as the child)
    server = os.getpid()
    timeout = float(request["timeout"])
    process = os.fork()
    if process == 0:
        status = 1
        try:
            os.setpgid(0, 0)
            if sys.platform != "linux":
                _watch(server)
            die_with_parent(server)
            for descriptor in (reader, *close):
                os.close(descriptor)
            settle(scratch)
            os.dup2(errors.fileno(), 1)
            os.dup2(errors.fileno(), 2)
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            faulthandler.enable(file=errors.fileno(), all_threads=False)
            faulthandler.dump_traceback_later(timeout - min(0.5, timeout / 4), file=errors.fileno())
            _without_core_dump()
            answer = json.dumps({"answer": run({**request, "scratch": scratch})}).encode() + b"\n"
            while answer:
                answer = answer[os.write(writer, answer) :]
            status = 0
        except BaseException:
            import traceback

            os.write(errors.fileno(), traceback.format_exc().encode("utf-8", "replace"))
        finally:
            os._exit(status)
    os.close(writer)
    with contextlib.suppress(OSError):
        os.setpgid(process, process)
    return Child(
        number=request["id"], process=process, pipe=reader, errors=errors, scratch=scratch, deadline=time.monotonic() + timeout,
        received=bytearray(),
    )


def _without_core_dump() -> None:
    import resource

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

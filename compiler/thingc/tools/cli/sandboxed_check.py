"""Run the check of an untrusted document in a sandboxed child process.

The CPU time and the memory of the child process are limited. The child process cannot start processes, open connections or write files. If
the child process ends early, the result is one diagnostic. The sandbox is a second safeguard, in addition to the limits of the compiler
passes.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import sys
from collections.abc import Callable
from typing import Any, NoReturn

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic
from thingc.driver.up_to_date import from_plain, to_plain
from thingc.tools.cli import console

MEMORY = 900_000_000
"""Address space [bytes] that the child process can allocate in addition to the address space of its parent process."""
PATIENCE = 20.0
"""Maximum idle time of the child process [s] per second of its CPU time limit.

A child process that is idle for longer is probably blocked.
"""
_REFUSED = (
    "os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.startfile", "os.system", "pty.spawn", "socket.", "subprocess.Popen",
    "os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.link", "os.symlink", "os.chmod", "os.chown", "os.truncate", "os.kill",
    "ctypes.dlopen", "webbrowser.open", "urllib.Request",
)
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


class SandboxRefusal(Exception):
    """Raised if the check of an untrusted document tries a forbidden operation, such as starting a process.

    This exception indicates a bug in thingc.
    """


def run_confined(work: Callable[[], Any], seconds: float, *, memory: int = MEMORY) -> Any | Diagnostic:
    """Call the function `work` in a sandboxed child process, and return the result of the function as JSON values.

    The child process can use `seconds` of CPU time and `memory` bytes. If the child process ends early, the result is a diagnostic. On
    Windows, which has no `os.fork`, `work` runs in this process without limits.
    """
    if not hasattr(os, "fork"):
        return _run(work)
    sys.stdout.flush()
    sys.stderr.flush()
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _in_child(work, seconds, memory, writing)
    os.close(writing)
    data, in_time = _collect(reading, child, seconds * PATIENCE)
    if not in_time:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if not in_time or status != 0:
        return _costly(in_time, status, seconds, memory)
    kind, value = json.loads(data)
    return from_plain(value) if kind == "failed" else value


def diagnose_confined(path: str, check: Callable[[], list[Diagnostic]], seconds: float) -> list[Diagnostic]:
    """Call `check` in a sandboxed process, and return the diagnostics of the file `path`, or one diagnostic if the process ends early."""
    answer = run_confined(lambda: list(map(to_plain, check())), seconds)
    return [replace(answer, path=path)] if isinstance(answer, Diagnostic) else list(map(from_plain, answer))


def _collect(reading: int, child: int, patience: float) -> tuple[bytes, bool]:
    """Read the output of the child process. Return the output, and whether the child finished.

    The second result is False if the child neither wrote output nor used CPU time for `patience` seconds.
    """
    pieces: list[bytes] = []
    computed = _cpu_time(child)
    with os.fdopen(reading, "rb", buffering=0) as stream:
        while True:
            if select.select([stream], [], [], patience)[0]:
                piece = stream.read(1 << 16)
                if not piece:
                    return b"".join(pieces), True
                pieces.append(piece)
                continue
            before, computed = computed, _cpu_time(child)
            if computed == before:
                return b"", False


def _cpu_time(child: int) -> int:
    """Return the CPU time that a process has used, in clock ticks, or 0 if unknown."""
    try:
        with open(f"/proc/{child}/stat", "rb") as stream:
            fields = stream.read().rpartition(b")")[2].split()
    except OSError:
        return 0
    return int(fields[11]) + int(fields[12])


def _costly(in_time: bool, status: int, seconds: float, memory: int) -> Diagnostic:
    ended_by = os.WTERMSIG(status) if os.WIFSIGNALED(status) else None
    if not in_time:
        message = f"the check was stopped after {seconds * PATIENCE:g} s without progress"
        help = "check the load of the machine and the access to the files of the workspace"
    elif ended_by == signal.SIGPROF:
        message = f"the check exceeded the CPU time limit ({seconds:g} s)"
        help = "make the documents smaller, or increase --time-limit"
    elif os.WIFEXITED(status) and os.WEXITSTATUS(status) == _OUT_OF_MEMORY:
        message = f"the check exceeded the memory limit ({memory // 1_000_000} MB)"
        help = "make the documents smaller"
    else:
        reason = f"by {signal.Signals(ended_by).name}" if ended_by is not None else f"with status {os.WEXITSTATUS(status)}"
        message = f"the check ended early {reason}"
        help = "do not trust these documents, and report this problem"
    return console.error(message, help, Code.TOO_COSTLY)


_OUT_OF_MEMORY = 91


def _in_child(work: Callable[[], Any], seconds: float, memory: int, writing: int) -> NoReturn:
    """Call the function `work` in the child process, and exit. This function does not return."""
    code = 1
    try:
        sys.dont_write_bytecode = True
        _limit_resources(seconds, memory)
        sys.addaudithook(_refuse)
        answer = _run(work)
        data = json.dumps(["failed", to_plain(answer)] if isinstance(answer, Diagnostic) else ["done", answer]).encode()
        view = memoryview(data)
        while view:
            view = view[os.write(writing, view):]
        code = 0
    except MemoryError:
        code = _OUT_OF_MEMORY
    except BaseException:
        code = 1
    finally:
        os._exit(code)


def _run(work: Callable[[], Any]) -> Any | Diagnostic:
    try:
        return work()
    except MemoryError:
        raise
    except Exception as fault:
        return console.of_exception(fault)


def _limit_resources(seconds: float, memory: int) -> None:
    import resource

    with contextlib.suppress(OSError, ValueError), open("/proc/self/statm", "rb") as stream:
        memory += int(stream.read().split()[0]) * resource.getpagesize()
    for kind, limit in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CORE, 0)):
        with contextlib.suppress(ValueError, OSError):  # a lower limit is already set
            resource.setrlimit(kind, (limit, limit))
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_PROF, seconds)  # CPU time; RLIMIT_CPU only supports whole seconds


def _refuse(event: str, arguments: tuple[Any, ...]) -> None:
    """The audit hook of the child process, which raises `SandboxRefusal` for forbidden operations."""
    if event == "open":
        _, mode, flags = arguments
        if isinstance(flags, int) and flags & _WRITING or isinstance(mode, str) and set(mode) & set("wax+"):
            raise SandboxRefusal("attempt to write a file")
    elif event.startswith(_REFUSED):
        raise SandboxRefusal(f"attempt to perform `{event}`")

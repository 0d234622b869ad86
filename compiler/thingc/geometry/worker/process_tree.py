"""The descendants of this process, found by their parents in any process group or session.

Linux reports the children of a process, and on request makes this process the parent of orphans. On other systems no processes are found.
"""

from __future__ import annotations

import contextlib
import functools
import os
import signal
import sys
import time
from collections.abc import Collection, Iterable
from typing import Any

PAUSE = 0.005
"""Pause [s] between checks for processes that are about to end."""
PATIENCE = 20.0
"""Time limit [s] for processes to end or stop after a signal."""

FIRST = -20
"""Nice value of the watching process. With it, the process is scheduled even beside many others."""

_SUBREAPER = 36


def adopt_orphans() -> None:
    """Become the parent of descendants whose own parent ends, instead of the system's first process."""
    if sys.platform == "linux":
        prctl(_SUBREAPER, 1)


def give_priority(nice: int) -> int:
    """Set the `nice` value of this process if permitted, and return the previous one.

    A value below the usual one requires root. Limits on the number of processes do not affect root.
    """
    usual = os.getpriority(os.PRIO_PROCESS, 0)
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, nice)
    return usual


def children(process: int) -> list[int]:
    """Return the children of a process, including zombies."""
    processes: list[int] = []
    with contextlib.suppress(OSError):
        for thread in os.listdir(f"/proc/{process}/task"):
            with contextlib.suppress(OSError), open(f"/proc/{process}/task/{thread}/children", "rb") as stream:
                processes.extend(map(int, stream.read().split()))
    return processes


def descendants(process: int) -> list[int]:
    """Return all descendants of a process."""
    processes = children(process)
    for one in processes:
        processes.extend(children(one))
    return processes


def alive(processes: Iterable[int]) -> list[int]:
    """Return the processes that have not ended."""
    return [process for process in processes if _runs(process)]


def outliving(processes: Iterable[int], seconds: float) -> list[int]:
    """Wait for processes to end, at most `seconds`, and return those that have not."""
    last = time.monotonic() + seconds
    while (left := alive(processes)) and time.monotonic() < last:
        time.sleep(PAUSE)
    return left


def command(process: int) -> str:
    """Return the command line of a process, or "" if it has ended."""
    with contextlib.suppress(OSError), open(f"/proc/{process}/cmdline", "rb") as stream:
        return stream.read().replace(b"\0", b" ").decode("utf-8", "replace").strip()
    return ""


def exceeds(processes: Collection[int], most: int) -> bool:
    """Return whether processes use more than `most` bytes of memory.

    The exact number, which counts shared memory once, is read only if necessary.
    """
    return all(_kilobytes(processes, *entry) * 1024 > most for entry in (("status", b"VmRSS:"), ("smaps_rollup", b"Pss:")))


def _kilobytes(processes: Iterable[int], file: str, key: bytes) -> int:
    total = 0
    for process in processes:
        with contextlib.suppress(OSError), open(f"/proc/{process}/{file}", "rb") as stream:
            total += sum(int(line.split()[1]) for line in stream if line.startswith(key))
    return total


def stop(process: int) -> None:
    """Stop a process, its group and all its descendants, so that none of them can start another process.

    They are stopped instead of killed, because stopped processes count against limits and dead processes do not.
    """
    last = time.monotonic() + PATIENCE
    stopped: set[int] = set()
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process, signal.SIGSTOP)
    while (running := [one for one in (process, *descendants(process)) if one not in stopped]) and time.monotonic() < last:
        for one in running:
            _signal(one, signal.SIGSTOP)
        stopped.update(running)


def end_descendants(process: int) -> None:
    """Kill all descendants of a process."""
    for one in descendants(process):
        _signal(one, signal.SIGKILL)


def end_all_but(kept: Collection[int]) -> None:
    """Kill the children of this process that are not in `kept`, with their descendants, and wait until they have ended."""
    last = time.monotonic() + PATIENCE
    while (strays := [process for process in children(os.getpid()) if process not in kept]) and time.monotonic() < last:
        for stray in strays:
            end_descendants(stray)
            _signal(stray, signal.SIGKILL)
        for stray in strays:
            with contextlib.suppress(ChildProcessError):
                os.waitpid(stray, os.WNOHANG)
        time.sleep(PAUSE / 5)


def _signal(process: int, number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.kill(process, number)


def _runs(process: int) -> bool:
    try:
        with open(f"/proc/{process}/stat", "rb") as stream:
            return stream.read().rpartition(b")")[2].split()[0] not in (b"Z", b"X")
    except (OSError, IndexError):
        return False


def prctl(option: int, argument: int) -> bool:
    """Call `prctl` for this process (`man 2 prctl`). Return True on success."""
    return bool(_libc().prctl(option, argument, 0, 0, 0) == 0)


def syscall(number: int, *arguments: Any) -> int:
    """Make a system call by its number. Return its result, -1 on failure."""
    return int(_libc().syscall(number, *arguments))


@functools.cache
def _libc() -> Any:
    import ctypes  # imported late, because the driver does not need it

    libc = ctypes.CDLL(None)
    libc.syscall.restype = ctypes.c_long
    return libc

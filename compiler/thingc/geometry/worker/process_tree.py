"""Find, limit and end the descendants of this process, in any process group or session.

Linux lists the children of a process, and can make this process the parent of orphaned descendants. On other systems, these functions do
not find any processes.
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
"""Time [s] between two checks of processes that are about to end."""
PATIENCE = 20.0
"""Time limit [s] for processes to end or to stop after a signal."""

FIRST = -20
"""Nice value of a process that watches other processes. With this value, the system schedules the process even if many other processes are
running.
"""

_SUBREAPER = 36


def adopt_orphans() -> None:
    """Make this process the parent of its descendants whose own parent ends. By default, the first process of the system would become the
    parent of such descendants.
    """
    if sys.platform == "linux":
        prctl(_SUBREAPER, 1)


def give_priority(nice: int) -> int:
    """Set the `nice` value of this process if the system permits this, and return the previous value.

    Only root can set a value below the default. For processes of root, limits on the number of processes have no effect.
    """
    usual = os.getpriority(os.PRIO_PROCESS, 0)
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, nice)
    return usual


def children(process: int) -> list[int]:
    """Return the process ids of the children of a process, including zombies."""
    processes: list[int] = []
    with contextlib.suppress(OSError):
        for thread in os.listdir(f"/proc/{process}/task"):
            with contextlib.suppress(OSError), open(f"/proc/{process}/task/{thread}/children", "rb") as stream:
                processes.extend(map(int, stream.read().split()))
    return processes


def descendants(process: int) -> list[int]:
    """Return the process ids of all descendants of a process."""
    processes = children(process)
    for one in processes:
        processes.extend(children(one))
    return processes


def alive(processes: Iterable[int]) -> list[int]:
    """Return the processes that have not ended yet."""
    return [process for process in processes if _runs(process)]


def outliving(processes: Iterable[int], seconds: float) -> list[int]:
    """Wait at most `seconds` until the given processes have ended. Return the processes that are still running."""
    last = time.monotonic() + seconds
    while (running := alive(processes)) and time.monotonic() < last:
        time.sleep(PAUSE)
    return running


def command(process: int) -> str:
    """Return the command line of a process. Return an empty string if the process has ended."""
    with contextlib.suppress(OSError), open(f"/proc/{process}/cmdline", "rb") as stream:
        return stream.read().replace(b"\0", b" ").decode("utf-8", "replace").strip()
    return ""


def exceeds(processes: Collection[int], limit: int) -> bool:
    """Return whether the given processes together use more than `limit` bytes of memory.

    The exact memory, in which shared memory counts once, is only read if necessary.
    """
    return all(_kilobytes(processes, *entry) * 1024 > limit for entry in (("status", b"VmRSS:"), ("smaps_rollup", b"Pss:")))


def _kilobytes(processes: Iterable[int], file: str, key: bytes) -> int:
    total = 0
    for process in processes:
        with contextlib.suppress(OSError), open(f"/proc/{process}/{file}", "rb") as stream:
            total += sum(int(line.split()[1]) for line in stream if line.startswith(key))
    return total


def stop(process: int) -> None:
    """Send a stop signal to a process, its process group and all its descendants, so that they cannot start other processes.

    The processes are stopped and not killed, because only processes that still exist count against the limit on processes. On Windows,
    which cannot stop processes, the function does nothing.
    """
    if not hasattr(os, "killpg"):
        return
    last = time.monotonic() + PATIENCE
    stopped: set[int] = set()
    signal_group(process, signal.SIGSTOP)
    while (running := [one for one in (process, *descendants(process)) if one not in stopped]) and time.monotonic() < last:
        for one in running:
            _signal(one, signal.SIGSTOP)
        stopped.update(running)


def signal_group(process: int, number: signal.Signals) -> None:
    """Send a signal to a process group, even if the process that leads the group has ended."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process, number)


def end_descendants(process: int) -> None:
    """Kill all descendants of a process."""
    for one in descendants(process):
        _signal(one, signal.SIGKILL)


def end_all_but(others: Collection[int]) -> None:
    """Kill the children of this process that are not in `others`, with their descendants, and wait until they have ended."""
    last = time.monotonic() + PATIENCE
    while (strays := [process for process in children(os.getpid()) if process not in others]) and time.monotonic() < last:
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
    """Make the system call `prctl` for this process (`man 2 prctl`). Return whether the call succeeded."""
    return bool(_libc().prctl(option, argument, 0, 0, 0) == 0)


def syscall(number: int, *arguments: Any) -> int:
    """Make a system call by its number. Return the result of the call, or -1 on failure."""
    return int(_libc().syscall(number, *arguments))


@functools.cache
def _libc() -> Any:
    import ctypes  # lazy import, because the driver does not need the module

    libc = ctypes.CDLL(None)
    libc.syscall.restype = ctypes.c_long
    return libc

"""The processes that this one has started, and those that these have started: told apart by their parents, whatever group or session
they have gone to.

Linux says who is whose child, and gives the orphans among the descendants of a process to it where it asks for them. Elsewhere nobody
is found here.
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
"""How long [s] to wait before looking again for processes that are about to end."""
PATIENCE = 20.0
"""How long [s] killed or stopped processes may take to be so."""

FIRST = -20
"""The nice value of who watches, to be heard among any number of processes."""

_SUBREAPER = 36


def adopt_orphans() -> None:
    """From here on a descendant whose parent ends becomes a child of this process, and not of the system's first process."""
    if sys.platform == "linux":
        prctl(_SUBREAPER, 1)


def give_priority(nice: int) -> int:
    """Let this process be scheduled with a `nice` value, where that may be asked for (below the usual one by root, whom no limit on
    processes holds); the one it had."""
    usual = os.getpriority(os.PRIO_PROCESS, 0)
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, nice)
    return usual


def children(process: int) -> list[int]:
    """The children of a process, dead ones that nobody has asked after among them."""
    processes: list[int] = []
    with contextlib.suppress(OSError):
        for thread in os.listdir(f"/proc/{process}/task"):
            with contextlib.suppress(OSError), open(f"/proc/{process}/task/{thread}/children", "rb") as stream:
                processes.extend(map(int, stream.read().split()))
    return processes


def descendants(process: int) -> list[int]:
    """Everything that a process has started, and what that has."""
    processes = children(process)
    for one in processes:
        processes.extend(children(one))
    return processes


def alive(processes: Iterable[int]) -> list[int]:
    """Those of the processes that have not ended."""
    return [process for process in processes if _runs(process)]


def outliving(processes: Iterable[int], seconds: float) -> list[int]:
    """Those of the processes that have not ended after `seconds`; at once where all have."""
    last = time.monotonic() + seconds
    while (left := alive(processes)) and time.monotonic() < last:
        time.sleep(PAUSE)
    return left


def command(process: int) -> str:
    """The command line of a process; empty where it is gone."""
    with contextlib.suppress(OSError), open(f"/proc/{process}/cmdline", "rb") as stream:
        return stream.read().replace(b"\0", b" ").decode("utf-8", "replace").strip()
    return ""


def exceeds(processes: Collection[int], most: int) -> bool:
    """Whether processes have more than `most` bytes of memory. The exact figure, which counts shared memory once, takes longer to get."""
    return all(_kilobytes(processes, *entry) * 1024 > most for entry in (("status", b"VmRSS:"), ("smaps_rollup", b"Pss:")))


def _kilobytes(processes: Iterable[int], file: str, key: bytes) -> int:
    total = 0
    for process in processes:
        with contextlib.suppress(OSError), open(f"/proc/{process}/{file}", "rb") as stream:
            total += sum(int(line.split()[1]) for line in stream if line.startswith(key))
    return total


def stop(process: int) -> None:
    """Stop a process, its group and all that it has started, so that none of them starts another: stopped processes count against
    limits, dead ones do not."""
    last = time.monotonic() + PATIENCE
    stopped: set[int] = set()
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process, signal.SIGSTOP)
    while (running := [one for one in (process, *descendants(process)) if one not in stopped]) and time.monotonic() < last:
        for one in running:
            _signal(one, signal.SIGSTOP)
        stopped.update(running)


def end_descendants(process: int) -> None:
    """Kill all that a process has started."""
    for one in descendants(process):
        _signal(one, signal.SIGKILL)


def end_all_but(kept: Collection[int]) -> None:
    """Kill the children of this process that are not `kept`, with all that they have started, and wait until they are gone."""
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
    """Have the system treat this process in another way (`man 2 prctl`); whether it does."""
    return bool(_libc().prctl(option, argument, 0, 0, 0) == 0)


def syscall(number: int, *arguments: Any) -> int:
    """Ask the system by the number of a call; what it returns, -1 where it refuses."""
    return int(_libc().syscall(number, *arguments))


@functools.cache
def _libc() -> Any:
    import ctypes  # late: the driver asks for nothing here

    libc = ctypes.CDLL(None)
    libc.syscall.restype = ctypes.c_long
    return libc

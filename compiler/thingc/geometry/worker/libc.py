"""Calls of the C library that the standard library has no words for (Linux)."""

from __future__ import annotations

import functools
from typing import Any


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

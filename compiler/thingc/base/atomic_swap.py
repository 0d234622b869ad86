"""Two folders change places in one step of the system, where it can (Linux)."""

from __future__ import annotations

import errno
import functools
import os
from typing import Any

RENAME_EXCHANGE = 2
"""Of `linux/fs.h`: both paths stay, each with what the other had."""
AT_FDCWD = -100
"""Of `fcntl.h`: paths are relative to the working folder."""


@functools.cache
def _renameat2() -> Any | None:
    """The C library's `renameat2` (Linux, glibc 2.28 and musl 1.2.6 on), or None."""
    try:
        import ctypes

        function = ctypes.CDLL(None, use_errno=True).renameat2
    except (ImportError, OSError, AttributeError):
        return None
    function.argtypes = (ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_uint)
    function.restype = ctypes.c_int
    return function


def exchange(a: str, b: str) -> None:
    """Two folders change places in one step. Raises `NotImplementedError` where the system or the file system cannot."""
    function = _renameat2()
    if function is None:
        raise NotImplementedError
    import ctypes

    if function(AT_FDCWD, os.fsencode(a), AT_FDCWD, os.fsencode(b), RENAME_EXCHANGE) != 0:
        number = ctypes.get_errno()
        if number in (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP, errno.EPERM):
            raise NotImplementedError
        raise OSError(number, os.strerror(number), a, None, b)

"""What lies on the disk, as everybody may find it: files that are no files, folders that are not there."""

from __future__ import annotations

import errno
import os
import stat
from io import BufferedReader


class NoPlainFile(OSError):
    """What is there cannot be read twice: a pipe, which is waited for until somebody writes into it, or a device."""


def opened(path: str) -> BufferedReader:
    """A file, to be read as bytes. Raises `OSError` where it cannot be, `NoPlainFile` among them."""
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise NoPlainFile(errno.EINVAL, "It is no file that can be read again", path)
    return open(path, "rb")


def beginning(path: str, most: int) -> bytes:
    """The first bytes of a file, `most` at most. Raises `OSError` as `opened` does."""
    with opened(path) as stream:
        return stream.read(most)


def listing(folder: str) -> list[str]:
    """The names in a folder, sorted; none where it cannot be read."""
    try:
        return sorted(os.listdir(folder))
    except OSError:
        return []

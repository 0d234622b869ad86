"""Read regular files only, write trees of files safely, and exchange two folders atomically."""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import re
import stat
from collections.abc import Callable, Iterable, Mapping
from io import BufferedReader
from typing import Any

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""System errors without a file name when writing to an open file: the disk is full, or a quota or limit is reached."""


class NotARegularFile(OSError):
    """Raised if a path is not a regular file, but for example a device or a pipe, which would block."""


class BadPath(OSError, ValueError):
    """Raised if a path that was read from a file is not safe to use. The message contains the reason."""


def hash_name(text: str, digits: int = 64) -> str:
    """Validate and return a hash from a file (by default a SHA-256) for use in a path. Raises `BadPath` for an invalid hash."""
    if re.fullmatch(f"[0-9a-f]{{{digits}}}", str(text)) is None:
        raise BadPath(f"expected a hash of {digits} hex digits, found {str(text)[:100]!r}")
    return text


def opened(path: str) -> BufferedReader:
    """Open a file for reading bytes. Raises `OSError`, and `NotARegularFile` for pipes and devices."""
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise NotARegularFile(errno.EINVAL, "It is not a regular file", path)
    return open(path, "rb")


def beginning(path: str, most: int) -> bytes:
    """Return at most `most` bytes from the beginning of a file. Raises `OSError` as `opened` does."""
    with opened(path) as stream:
        return stream.read(most)


def working_folder() -> str | None:
    """Return the working folder, or None if it has been deleted."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return None


def listing(folder: str) -> list[str]:
    """Return the sorted names in a folder. The result is empty if the folder cannot be read."""
    try:
        return sorted(os.listdir(folder))
    except OSError:
        return []


def check_tree(paths: Iterable[str]) -> None:
    """Check the relative paths (with `/`) of files and links before they are written below one folder.

    Raises `BadPath` if a path leaves the folder, occurs twice, or is both a file and a folder.
    """
    files, folders = set[str](), set[str]()
    for path in paths:
        parts = path.split("/")
        if path in files or any(part in ("", ".", "..") or "\0" in part for part in parts):
            raise BadPath(f"{path!r} is not a path inside the folder, or occurs twice")
        files.add(path)
        folders.update("/".join(parts[:depth]) for depth in range(1, len(parts)))
    if both := files & folders:
        raise BadPath(f"{min(both)!r} is both a file and a folder")


def write_tree(root: str, files: Mapping[str, bytes], links: Mapping[str, str]) -> None:
    """Write files, then symbolic links with their targets, below a folder. Links are not followed, and no file is replaced.

    Raises `OSError`, and `BadPath` as `check_tree` does.
    """
    check_tree((*files, *links))
    for path in (*files, *links):
        place = root
        for part in path.split("/")[:-1]:
            place = os.path.join(place, part)
            if not (os.path.isdir(place) and not os.path.islink(place)):
                os.mkdir(place)  # fails if the path is a link
        place = os.path.join(root, *path.split("/"))
        if path in links:
            os.symlink(links[path], place)
        else:
            write_new(place, files[path])


def write_new(path: str, data: bytes, mode: int = 0o666) -> None:
    """Write a file that does not exist yet, with as few system calls as possible. Raises `OSError`, also if the path is a link."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, mode)
    try:
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(descriptor, rest):]
    finally:
        os.close(descriptor)


def write_whole(path: str, data: bytes, check: Callable[[], None] = lambda: None) -> bool:
    """Write a file beside `path`, call `check`, and rename the file to `path`, unless `path` already has this content.

    Return whether the file was written.

    The mode of an existing file is preserved. A link is replaced, not followed. Raises `OSError`.
    """
    with contextlib.suppress(OSError), opened(path) as stream:
        if stream.read() == data:
            return False
    fresh = os.path.join(os.path.dirname(path), f".{os.path.basename(path)}.thingc-{os.getpid()}-{os.urandom(4).hex()}")
    try:
        there = os.path.exists(path)
        write_new(fresh, data, 0o600 if there else 0o666)
        if there:
            os.chmod(fresh, os.stat(path).st_mode & 0o7777)
        check()
        os.replace(fresh, path)
    finally:
        with contextlib.suppress(FileNotFoundError):  # the file has been renamed
            os.unlink(fresh)
    return True


RENAME_EXCHANGE = 2
"""Flag from `linux/fs.h` to exchange two paths."""
AT_FDCWD = -100
"""Value from `fcntl.h` for paths relative to the working folder."""


@functools.cache
def _renameat2() -> Any | None:
    """Return the C library's `renameat2` (Linux; glibc since 2.28, musl since 1.2.6), or None."""
    try:
        import ctypes

        function = ctypes.CDLL(None, use_errno=True).renameat2
    except (ImportError, OSError, AttributeError):
        return None
    function.argtypes = (ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_uint)
    function.restype = ctypes.c_int
    return function


def exchange(a: str, b: str) -> None:
    """Exchange two folders atomically. Raises `NotImplementedError` if the system or the file system does not support it."""
    function = _renameat2()
    if function is None:
        raise NotImplementedError
    import ctypes

    if function(AT_FDCWD, os.fsencode(a), AT_FDCWD, os.fsencode(b), RENAME_EXCHANGE) != 0:
        number = ctypes.get_errno()
        if number in (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP, errno.EPERM):
            raise NotImplementedError
        raise OSError(number, os.strerror(number), a, None, b)

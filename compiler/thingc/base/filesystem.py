"""Read regular files, write several files into a folder safely, and exchange two folders atomically."""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import re
import stat
from collections.abc import Callable, Iterable, Mapping
from io import BufferedReader
from types import ModuleType
from typing import Any

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Error numbers of a full disk, an exceeded quota, and a file that is too large. For writes to an open file, these errors have no file
name.
"""

BINARY: int = getattr(os, "O_BINARY", 0)
"""The flag of `os.open` that keeps Windows from converting line ends."""


class NotARegularFile(OSError):
    """Raised if a path is not a regular file, but for example a device or a pipe. Reading a device or pipe could block the program."""


class BadPath(OSError, ValueError):
    """Raised if a path that was read from a file is unsafe, for example because it leads out of a folder.

    The message contains the reason.
    """


def hash_name(text: str, digits: int = 64) -> str:
    """Return `text` if it is a hexadecimal hash with `digits` digits, such as a SHA-256, and can therefore be used in a path.

    Raises `BadPath` for any other string.
    """
    if re.fullmatch(f"[0-9a-f]{{{digits}}}", str(text)) is None:
        raise BadPath(f"expected a hash of {digits} hex digits, found {str(text)[:100]!r}")
    return text


def open_file(path: str) -> BufferedReader:
    """Open a regular file for reading bytes. Raises `NotARegularFile` for pipes and devices, and `OSError` for other errors."""
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise NotARegularFile(errno.EINVAL, "It is not a regular file", path)
    return open(path, "rb")


def beginning(path: str, count: int) -> bytes:
    """Return the first `count` bytes of a file, or the whole file if it is shorter. Raises the same errors as `open_file`."""
    with open_file(path) as stream:
        return stream.read(count)


def without_suffix(path: str) -> str:
    """Return the path of a document or module without its extension: `a.yaml`, `a.thingc.yaml` and `a.py` become `a`."""
    return os.path.splitext(path)[0].removesuffix(".thingc")


def working_folder() -> str | None:
    """Return the path of the current working directory, or None if the directory has been deleted."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return None


def listing(folder: str) -> list[str]:
    """Return the sorted names of the files and folders in a folder. Return an empty list if the folder cannot be read."""
    try:
        return sorted(os.listdir(folder))
    except OSError:
        return []


def check_tree(paths: Iterable[str]) -> None:
    """Check the relative paths of files and links before these are written into a folder. The separator of the paths is `/`.

    Raises `BadPath` if a path leads out of the folder, occurs twice, or is used both as a file and as a folder.
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
    """Write new files and symbolic links into the folder `root`.

    `files` maps relative paths to contents, and `links` maps paths to targets. Symbolic links in the folder are not followed, and existing
    files are not replaced. Raises `OSError`, or `BadPath` for a path that `check_tree` rejects.
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
    """Create a new file with the content `data`. Raises `OSError` if `path` already exists, even if `path` is a symbolic link.

    The function uses as few system calls as possible, because a batch writes very many files.
    """
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | BINARY, mode)  # O_EXCL does not follow links
    try:
        remaining = memoryview(data)
        while remaining:
            remaining = remaining[os.write(descriptor, remaining):]
    finally:
        os.close(descriptor)


def write_whole(path: str, data: bytes, check: Callable[[], None] = lambda: None) -> bool:
    """Replace the content of a file atomically, unless the file already has this content. Return whether the file was written.

    The new content is first written to a temporary file in the same folder. Then `check` is called, and the temporary file is renamed to
    `path`. The mode of an existing file is preserved. A symbolic link is replaced, not followed. Raises `OSError`.
    """
    with contextlib.suppress(OSError), open_file(path) as stream:
        if stream.read() == data:
            return False
    temporary = os.path.join(os.path.dirname(path), f".{os.path.basename(path)}.thingc-{os.getpid()}-{os.urandom(4).hex()}")
    try:
        exists = os.path.exists(path)
        write_new(temporary, data, 0o600 if exists else 0o666)
        if exists:
            os.chmod(temporary, os.stat(path).st_mode & 0o7777)
        check()
        os.replace(temporary, path)
    finally:
        with contextlib.suppress(FileNotFoundError):  # the file has been renamed
            os.unlink(temporary)
    return True


def lock(descriptor: int, *, wait: bool = False) -> None:
    """Lock an open file or folder until it is closed. Without `wait`, raise `BlockingIOError` if another process has locked it.

    On Windows, the function does nothing.
    """
    if fcntl is not None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))


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
    except (ImportError, OSError, AttributeError, TypeError):  # TypeError on Windows
        return None
    function.argtypes = (ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_uint)
    function.restype = ctypes.c_int
    return function


def exchange(a: str, b: str) -> None:
    """Exchange two folders atomically. Raises `NotImplementedError` if the operating system or the file system cannot exchange folders."""
    function = _renameat2()
    if function is None:
        raise NotImplementedError
    import ctypes

    if function(AT_FDCWD, os.fsencode(a), AT_FDCWD, os.fsencode(b), RENAME_EXCHANGE) != 0:
        number = ctypes.get_errno()
        if number in (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP, errno.EPERM):
            raise NotImplementedError
        raise OSError(number, os.strerror(number), a, None, b)

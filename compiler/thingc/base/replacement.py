"""Replace the contents of several files together, unless one of these files has changed since it was read."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Mapping

from thingc.base.diagnostics import Code, UserError, shown_path
from thingc.base.filesystem import NO_ROOM, lock, open_file, write_whole

Change = tuple[bytes | None, bytes | None]
"""The content of a file when it was read, and its new content. None means that the file does not exist."""
ATTEMPTS, PAUSE = 200, 0.01
"""Number of attempts to lock a folder, and the pause [s] between them.

The total time is longer than any command holds the lock.
"""


class ReplacementRefused(UserError):
    """Raised if files could not be replaced, for example because one of them has changed."""

    code = Code.OUTPUT


def replace_files(changes: Mapping[str, Change]) -> None:
    """Replace the contents of several files. If one of the files cannot be replaced, all files remain unchanged.

    `changes` maps each path to the content that was read and the new content. If a file no longer has the content that was read, for
    example because an editor has saved the file, the function raises `ReplacementRefused`. If the old and the new content of a file are
    equal, the file is not written.

    Each file is replaced by an atomic rename. Symbolic links are followed, and the modes of files are preserved. Other processes that
    replace files in the same folders wait until this function has finished.
    """
    replaced: list[str] = []
    with contextlib.ExitStack() as locks:
        for folder in sorted({os.path.dirname(os.path.realpath(path)) for path in changes}):
            _lock(folder, locks)
        try:
            for path, (old, _) in changes.items():
                _compare(path, old)
            for path, change in changes.items():
                _replace(path, *change)
                replaced.append(path)
        except BaseException as fault:
            for replaced_path in replaced:
                with contextlib.suppress(OSError, ReplacementRefused):
                    _replace(replaced_path, *reversed(changes[replaced_path]))
            if isinstance(fault, OSError):
                message = f"cannot write `{shown_path(path)}`: {(fault.strerror or str(fault)).lower()}"
                raise ReplacementRefused(message, "free disk space, or use another folder" if fault.errno in NO_ROOM else None) from fault
            raise


@contextlib.contextmanager
def provisional(files: Mapping[str, Change]) -> Iterator[Callable[[Mapping[str, Change]], None]]:
    """Write new contents to files temporarily, so that other files can be checked with the new contents.

    `files` maps each path to its old and its new content. When the context ends, the old contents are restored, except in files that have
    changed in the meantime. The yielded function keeps the new contents and also replaces the contents of further files. The context
    manager and the yielded function can raise `ReplacementRefused`.
    """
    folders = list(dict.fromkeys(folder for path in files for folder in _missing(os.path.dirname(path))))
    keep_new = False

    def keep(further: Mapping[str, Change]) -> None:
        nonlocal keep_new
        if further:
            replace_files({**{path: (new, new) for path, (_, new) in files.items()}, **further})
        keep_new = True

    try:
        for folder in folders:
            os.mkdir(folder)
        replace_files(files)
        yield keep
    finally:
        for path, (old, new) in files.items() if not keep_new else ():
            with contextlib.suppress(ReplacementRefused):
                replace_files({path: (new, old)})
        for folder in reversed(folders):
            with contextlib.suppress(OSError):  # the folder is not empty
                os.rmdir(folder)


def _missing(folder: str) -> list[str]:
    """Return the folders in the path `folder` that do not exist, including the folder itself, outermost first."""
    return [] if os.path.isdir(folder or ".") else [*_missing(os.path.dirname(folder)), folder]


def _lock(folder: str, locks: contextlib.ExitStack) -> None:
    """Lock a folder until the exit stack is closed, so that other processes cannot replace files in this folder.

    If the file system does not support locks, conflicts are detected only by comparing the contents of the files.
    """
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        locks.callback(os.close, descriptor)
        for _ in range(ATTEMPTS):
            with contextlib.suppress(BlockingIOError):
                lock(descriptor)
                break
            time.sleep(PAUSE)


def _compare(path: str, expected: bytes | None) -> None:
    content = None
    if os.path.lexists(path):
        with open_file(path) as stream:
            content = stream.read()
    if content != expected:
        raise ReplacementRefused(f"`{shown_path(path)}` changed while this command ran", "Run the command again.")


def _replace(path: str, old: bytes | None, new: bytes | None) -> None:
    target = os.path.realpath(path)
    if new is None and old is not None:
        _compare(path, old)
        os.unlink(target)
    if new is None or new == old:
        return
    write_whole(target, new, lambda: _compare(path, old))

"""Files replaced all together, unless one of them has changed since it was read."""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
from collections.abc import Callable, Iterator, Mapping

from thingc.base.diagnostics import Code, Diagnostic, Severity, shown_path
from thingc.base.filesystem import NO_ROOM, opened, write_whole

Change = tuple[bytes | None, bytes | None]
"""The bytes of a file as they were read, and as they are to be. None is a file that does not exist."""
ATTEMPTS, PAUSE = 200, 0.01
"""How often to try to lock a folder, and the pause [s] after each. Whoever holds a lock longer is no command that replaces files."""


class ReplacementRefused(Exception):
    """Files were not replaced: `diagnostic` is the reason."""

    def __init__(self, message: str, help: str | None = None) -> None:
        super().__init__(message)
        self.diagnostic = Diagnostic(code=Code.OUTPUT, severity=Severity.ERROR, message=message, help=help)


def replace_files(changes: Mapping[str, Change]) -> None:
    """Replace the contents of files, all or none, each by an atomic rename.

    Every file must still have the bytes that were read: an editor may have saved it since. One whose bytes are to stay is only compared.
    Commands that replace files in the same folders wait for each other. A link is followed, and a file keeps its mode.

    Raises `ReplacementRefused`.
    """
    done: list[str] = []
    with contextlib.ExitStack() as locks:
        for folder in sorted({os.path.dirname(os.path.realpath(path)) for path in changes}):
            _lock(folder, locks)
        try:
            for path, (before, _) in changes.items():
                _compare(path, before)
            for path, change in changes.items():
                _replace(path, *change)
                done.append(path)
        except BaseException as fault:
            for other in done:
                with contextlib.suppress(OSError, ReplacementRefused):
                    _replace(other, *reversed(changes[other]))
            if isinstance(fault, OSError):
                message = f"cannot write `{shown_path(path)}`: {(fault.strerror or str(fault)).lower()}"
                raise ReplacementRefused(message, "make room, or choose another place" if fault.errno in NO_ROOM else None) from fault
            raise


@contextlib.contextmanager
def provisional(files: Mapping[str, Change]) -> Iterator[Callable[[Mapping[str, Change]], None]]:
    """Write files that a check of other files needs, and the folders that they need.

    Afterwards they are as they were, except those that somebody has changed meanwhile, unless the callback is called: it replaces the
    other files, too. Both raise `ReplacementRefused`.
    """
    folders = list(dict.fromkeys(folder for path in files for folder in _missing(os.path.dirname(path))))
    kept = False

    def keep(others: Mapping[str, Change]) -> None:
        nonlocal kept
        if others:
            replace_files({**{path: (after, after) for path, (_, after) in files.items()}, **others})
        kept = True

    try:
        for folder in folders:
            os.mkdir(folder)
        replace_files(files)
        yield keep
    finally:
        for path, (before, after) in files.items() if not kept else ():
            with contextlib.suppress(ReplacementRefused):
                replace_files({path: (after, before)})
        for folder in reversed(folders):
            with contextlib.suppress(OSError):  # there is something in it
                os.rmdir(folder)


def _missing(folder: str) -> list[str]:
    """The folder and those that it lies in, as far as they do not exist, outermost first."""
    return [] if os.path.isdir(folder or ".") else [*_missing(os.path.dirname(folder)), folder]


def _lock(folder: str, locks: contextlib.ExitStack) -> None:
    """Lock a folder until the stack is left. Without locks (of some file systems) files are compared all the same."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
        locks.callback(os.close, descriptor)
        for _ in range(ATTEMPTS):
            with contextlib.suppress(BlockingIOError):
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            time.sleep(PAUSE)


def _compare(path: str, before: bytes | None) -> None:
    now = None
    if os.path.lexists(path):
        with opened(path) as stream:
            now = stream.read()
    if now != before:
        raise ReplacementRefused(f"`{shown_path(path)}` has changed while this command ran", "Run the command again.")


def _replace(path: str, before: bytes | None, after: bytes | None) -> None:
    target = os.path.realpath(path)
    if after is None and before is not None:
        _compare(path, before)
        os.unlink(target)
    if after is None or after == before:
        return
    write_whole(target, after, lambda: _compare(path, before))

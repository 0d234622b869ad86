"""Scratch folders: one for each worker among the system's temporary files, and in it one for each part, gone when the part is done.

A part sees its own as home and as the place for temporary files: it is empty, and nothing of another part can be met there. What
a killed worker has left is removed by the next one: a worker holds a lock on its folder, which the system takes back from the dead.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from types import ModuleType

from thingc.geometry.key.environment_variables import HOMES, TEMPORARY

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:
    fcntl = None

PREFIX = "thingc-worker-"


class Scratch:
    """The folder of one worker. `close` removes it with all that is in it. `descriptors` hold its lock, and no child must have them."""

    def __init__(self) -> None:
        base = tempfile.gettempdir()
        _sweep(base)
        self.folder, lock = _made(base)
        self.descriptors = () if lock is None else (lock,)
        self._count = 0

    def make(self) -> str:
        """A new folder for one part."""
        self._count += 1
        path = os.path.join(self.folder, str(self._count))
        os.mkdir(path, 0o700)
        return path

    def close(self) -> None:
        """Remove everything."""
        remove(self.folder)
        for descriptor in self.descriptors:
            os.close(descriptor)


def remove(folder: str) -> None:
    """Remove the folder of a part that has ended."""
    try:
        os.rmdir(folder)  # most parts write nothing
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)


def settle(folder: str) -> None:
    """Make `folder` this process's home and its place for temporary files; nothing of the worker itself is left in the
    environment."""
    for name in (*HOMES, *TEMPORARY):
        os.environ[name] = folder
    os.environ.pop("PYTHONPATH", None)
    tempfile.tempdir = None


def _made(base: str) -> tuple[str, int | None]:
    """A new folder, and the descriptor that holds its lock."""
    while True:
        folder = tempfile.mkdtemp(prefix=PREFIX, dir=base)
        if fcntl is None:
            return folder, None
        with contextlib.suppress(OSError):  # somebody who sweeps was faster
            descriptor = os.open(folder, os.O_RDONLY)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.path.samestat(os.fstat(descriptor), os.stat(folder)):
                    kept, descriptor = descriptor, -1
                    return folder, kept
            finally:
                if descriptor >= 0:
                    os.close(descriptor)


def _sweep(base: str) -> None:
    """Remove what workers have left that are no more."""
    if fcntl is None:
        return
    for name in os.listdir(base):
        if not name.startswith(PREFIX):
            continue
        with contextlib.suppress(OSError):  # in use, gone, or somebody else's
            folder = os.path.join(base, name)
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                if os.fstat(descriptor).st_uid == os.getuid():
                    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(descriptor)

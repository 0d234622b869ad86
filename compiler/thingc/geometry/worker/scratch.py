"""Scratch folders of parts. Each worker has a folder in the system's temporary folder, with a subfolder for each part.

The subfolder of a part is removed when the part is finished.

A part uses its own folder as its home folder and for temporary files. This folder is initially empty, and does not contain files of other
parts. The next worker removes the folders of workers that were killed. For this purpose, each worker holds a lock on its folder, which the
system releases when the worker ends.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile

from thingc.base.filesystem import fcntl, lock
from thingc.geometry.key.environment_variables import HOMES, TEMPORARY

PREFIX = "thingc-worker-"


class Scratch:
    """The scratch folder of one worker, which `close` removes.

    `descriptors` contains the file descriptors that hold the lock on the folder. Child processes must close these file descriptors.
    """

    def __init__(self) -> None:
        base = tempfile.gettempdir()
        _sweep(base)
        self.folder, descriptor = _make_folder(base)
        self.descriptors = () if descriptor is None else (descriptor,)
        self._count = 0

    def make(self) -> str:
        """Create a new folder for one part and return its path."""
        self._count += 1
        path = os.path.join(self.folder, str(self._count))
        os.mkdir(path, 0o700)
        return path

    def close(self) -> None:
        """Remove the scratch folder of the worker with all its contents."""
        remove(self.folder)
        for descriptor in self.descriptors:
            os.close(descriptor)


def remove(folder: str) -> None:
    """Remove the folder of a part that has ended."""
    try:
        os.rmdir(folder)  # most parts do not write files
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)


def settle(folder: str) -> None:
    """Make `folder` this process's home and temporary folder, and remove the worker's own variables from the environment."""
    for name in (*HOMES, *TEMPORARY):
        os.environ[name] = folder
    os.environ.pop("PYTHONPATH", None)
    tempfile.tempdir = None


def _make_folder(base: str) -> tuple[str, int | None]:
    """Create a new scratch folder. Return the path of the folder and the file descriptor of its lock. The descriptor is None on systems
    without locks.
    """
    while True:
        folder = tempfile.mkdtemp(prefix=PREFIX, dir=base)
        if fcntl is None:
            return folder, None
        with contextlib.suppress(OSError):  # another worker removed the folder before it was locked
            descriptor = os.open(folder, os.O_RDONLY)
            with contextlib.ExitStack() as on_failure:
                on_failure.callback(os.close, descriptor)
                lock(descriptor)
                if os.path.samestat(os.fstat(descriptor), os.stat(folder)):
                    on_failure.pop_all()
                    return folder, descriptor


def _sweep(base: str) -> None:
    """Remove the scratch folders of workers that have ended."""
    if fcntl is None:
        return
    for name in os.listdir(base):
        if not name.startswith(PREFIX):
            continue
        with contextlib.suppress(OSError):  # the folder is in use, was removed, or belongs to another user
            folder = os.path.join(base, name)
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                if os.fstat(descriptor).st_uid == os.getuid():
                    lock(descriptor)
                    shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(descriptor)

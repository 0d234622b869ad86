"""Detect changes of files by checking their modification times and sizes at regular intervals.

This method works on every system and file system, including network drives and folders shared with containers, which may not support change
notifications. Checking a hundred files takes 0.2 ms. If only the modification time of a file changes and its content stays the same, the
file does not count as changed.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from thingc.driver.up_to_date import state_of

Seen = TypeVar("Seen")

Stat = tuple[int, int, int] | None
"""Modification time [ns], size and inode of a file. The value is None if the file does not exist.

The inode changes if an editor saves the file by renaming a temporary file.
"""

SHARE = 0.2
"""Maximum share of one processor core that polling may use."""


def stat_of(path: str) -> Stat:
    """Return the modification time, size and inode number of a file or folder, or None if it does not exist.

    Adding a file to a folder changes the modification time of the folder.
    """
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def looks(look: Callable[[], Seen], stop: threading.Event, pause: float) -> Iterator[Seen]:
    """Call the function `look` repeatedly until the event `stop` is set, and yield the result of each call.

    The pause between two calls is `pause` seconds, or longer if `look` takes long.
    """
    while not stop.is_set():
        started = time.monotonic()
        seen = look()
        seconds = time.monotonic() - started
        yield seen
        stop.wait(max(pause, seconds * (1.0 / SHARE - 1.0)))


class FileWatcher:
    """Detects which files and folders have changed since the last call of `take_changes`. The files and folders need not exist."""

    def __init__(self, *paths: str) -> None:
        self._seen: dict[str, tuple[Stat, str | None]] = {}
        self.note(paths)

    @property
    def paths(self) -> frozenset[str]:
        """The paths of all files and folders that are watched."""
        return frozenset(self._seen)

    def note(self, paths: Iterable[str]) -> None:
        """Watch these paths in addition to the paths that are already watched."""
        for path in paths:
            if path not in self._seen:
                self._seen[path] = stat_of(path), state_of(path)

    def only(self, paths: Iterable[str]) -> None:
        """Watch only these paths from now on. Paths that were already watched are compared with the state that was recorded before."""
        before, self._seen = self._seen, {}
        self._seen = {path: before[path] for path in paths if path in before}
        self.note(paths)

    def take_changes(self) -> tuple[str, ...]:
        """Return the watched paths that have changed since the last call of this method."""
        changed: list[str] = []
        for path, (stat, state) in self._seen.items():
            now = stat_of(path)
            if now != stat:
                self._seen[path] = now, state_of(path)
                if self._seen[path][1] != state:
                    changed.append(path)
        return tuple(changed)

"""Detect changes of files by polling their status.

Polling of times and sizes works on every system and file system, even without change notifications (network drives, folders shared with
containers). A poll takes 0.2 ms for a hundred files. A file with a new time and the same content has not changed.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Seen = TypeVar("Seen")

Stat = tuple[int, int, int] | None
"""Modification time [ns], size and inode of a file. None if the file does not exist.

If a program saves a file by renaming, the inode changes.
"""

SHARE = 0.2
"""Maximum share of a core that polling may use."""


def stat_of(path: str) -> Stat:
    """Return the status of a file or folder without reading it. A new name in a folder changes the status of the folder."""
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def looks(look: Callable[[], Seen], stop: threading.Event, pause: float) -> Iterator[Seen]:
    """Call `look` repeatedly until `stop` is set, and yield the results. The pause is `pause` [s], or longer if `look` is slow."""
    while not stop.is_set():
        started = time.monotonic()
        seen = look()
        seconds = time.monotonic() - started
        yield seen
        stop.wait(max(pause, seconds * (1.0 / SHARE - 1.0)))


class FileWatcher:
    """Watches files and folders for changes since the last call of `changed`. The paths may be missing.

    If `content` is set, only changes of its return value count. `content` must return equal values for equal contents of a path.
    """

    def __init__(self, paths: Iterable[str] = (), content: Callable[[str], object] | None = None) -> None:
        self._content = content
        self._seen: dict[str, tuple[Stat, object]] = {}
        self.note(paths)

    @property
    def paths(self) -> frozenset[str]:
        """The paths of all files and folders that are watched."""
        return frozenset(self._seen)

    def note(self, paths: Iterable[str]) -> None:
        """Add paths to the files and folders that are watched."""
        for path in paths:
            if path not in self._seen:
                self._seen[path] = self._state(path, stat_of(path))

    def only(self, paths: Iterable[str]) -> None:
        """Watch only these paths. The recorded state of paths that were already watched does not change."""
        before, self._seen = self._seen, {}
        self._seen = {path: before[path] for path in paths if path in before}
        self.note(paths)

    def changed(self) -> tuple[str, ...]:
        """Return the paths that changed since the last call."""
        changed: list[str] = []
        for path, (stat, content) in self._seen.items():
            now = stat_of(path)
            if now != stat:
                self._seen[path] = self._state(path, now)
                if self._content is None or self._seen[path][1] != content:
                    changed.append(path)
        return tuple(changed)

    def _state(self, path: str, stat: Stat) -> tuple[Stat, object]:
        return stat, self._content(path) if self._content is not None else None

"""Locks that ensure that a part is built only once, even if several processes that share a store need the part.

A build lock is a lock on one byte of the file `build_locks` in the store. The offset of the byte is computed from the build key. The system
releases the lock when its process ends for any reason. A process never waits for a lock while it holds another lock, so deadlocks are
impossible. If locks do not work (on some network file systems and on Windows), every lock is granted. A part may then be built twice, with
the same result.
"""

from __future__ import annotations

import contextlib
import os
import time

from thingc.base.filesystem import fcntl
from thingc.geometry.store.local import Store

FILE = "build_locks"
SHORTEST, LONGEST = 0.002, 0.05
"""Pauses [s] between attempts to get a lock that another process has."""


class BuildLocks:
    """The build locks that one process holds on the parts of one store. The method `close` releases all locks."""

    def __init__(self, store: Store) -> None:
        self._path = os.path.join(store.root, FILE)
        self._descriptor: int | None = None
        self._disabled = fcntl is None

    def take(self, key: str) -> bool:
        """Lock the build key of a part (hexadecimal). Return False if another process has locked the key, and True if locks do not work."""
        descriptor = self._file()
        if descriptor is None or fcntl is None:
            return True
        try:
            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _lock_offset(key))
        except (BlockingIOError, PermissionError):
            return False
        except OSError:
            self._disabled = True
        return True

    def wait(self, key: str, limit: float) -> bool:
        """Wait until no other process holds the lock of a build key, and take the lock.

        Return False if the lock is not free after `limit` [s].
        """
        end, pause = time.monotonic() + limit, SHORTEST
        while not self.take(key):
            if time.monotonic() >= end:
                return False
            time.sleep(pause)
            pause = min(LONGEST, 2.0 * pause)
        return True

    def give_back(self, key: str) -> None:
        """Release the lock of a build key, if this process holds it."""
        if self._descriptor is not None and fcntl is not None:
            with contextlib.suppress(OSError):
                fcntl.lockf(self._descriptor, fcntl.LOCK_UN, 1, _lock_offset(key))

    def close(self) -> None:
        """Release all locks that this process holds."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)

    def _file(self) -> int | None:
        if self._descriptor is None and not self._disabled:
            try:
                os.makedirs(os.path.dirname(self._path), exist_ok=True)
                self._descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o666)
            except OSError:  # the store is missing or read-only, so results cannot be stored either
                self._disabled = True
        return None if self._disabled else self._descriptor


def _lock_offset(key: str) -> int:
    """Return the offset of the byte in the file `build_locks` that represents a build key. There are 2^60 offsets, so two keys rarely have
    the same offset.

    If two keys have the same offset, their parts are not built at the same time, which is harmless.
    """
    return int(key[:15], 16)

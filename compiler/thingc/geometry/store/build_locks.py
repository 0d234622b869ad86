"""Who is modelling what, among all processes that share a store: a part that two of them need is modelled once.

A build lock is on one byte of the store's file `build_locks`, whose place follows from the build key. The system frees it when its
process ends, however it ends. Nobody waits for one lock while holding another, so that no circle can form. Where locks do not
work (some network file systems, Windows) every one is granted, and a part may be modelled twice, with the same result.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from types import ModuleType

from thingc.geometry.store.local import Store

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:
    fcntl = None

FILE = "build_locks"
SHORTEST, LONGEST = 0.002, 0.05
"""How long [s] to wait before asking again for a lock that somebody else has."""


class BuildLocks:
    """The locks of one process on one store. `close` gives all of them back."""

    def __init__(self, store: Store) -> None:
        self._path = os.path.join(store.root, FILE)
        self._descriptor: int | None = None
        self._idle = fcntl is None

    def take(self, key: str) -> bool:
        """Lock a build key (hexadecimal), unless another process has it. True where locks do not work."""
        descriptor = self._file()
        if descriptor is None or fcntl is None:
            return True
        try:
            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _lock_offset(key))
        except (BlockingIOError, PermissionError):
            return False
        except OSError:
            self._idle = True
        return True

    def wait(self, key: str, limit: float) -> bool:
        """Lock a key when its holder has given it back; False after `limit` [s]."""
        end, pause = time.monotonic() + limit, SHORTEST
        while not self.take(key):
            if time.monotonic() >= end:
                return False
            time.sleep(pause)
            pause = min(LONGEST, 2.0 * pause)
        return True

    def give_back(self, key: str) -> None:
        """End a lock; one that was not taken may be given back, too."""
        if self._descriptor is not None and fcntl is not None:
            with contextlib.suppress(OSError):
                fcntl.lockf(self._descriptor, fcntl.LOCK_UN, 1, _lock_offset(key))

    @contextlib.contextmanager
    def given_back(self) -> Iterator[None]:
        """Give everything back in the end."""
        try:
            yield
        finally:
            self.close()

    def close(self) -> None:
        """Give all locks back."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)

    def _file(self) -> int | None:
        if self._descriptor is None and not self._idle:
            try:
                os.makedirs(os.path.dirname(self._path), exist_ok=True)
                self._descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o666)
            except OSError:  # not there or not to be written: then nothing can be kept there either
                self._idle = True
        return None if self._idle else self._descriptor


def _lock_offset(key: str) -> int:
    """The byte of a key: of 2^60 places two keys rarely share one, and then they only wait for each other."""
    return int(key[:15], 16)

"""Digests of files, which need not be worked out again for large ones that the file system says are as they were."""

from __future__ import annotations

import contextlib
import hashlib
import os
import time

from thingc.realize.store.local import Store, StoreUnusable

LARGE = 1 << 20
"""Bytes from which on a digest is worth keeping."""

SETTLED = 2_000_000_000
"""How long [ns] a file must have been as it is: another change within the grain of its times would not show in them."""


def digest_of(path: str, store: Store | None = None) -> str:
    """The SHA-256 of a file's content in hex. In `store` those of large files are kept, by their size, times and place on the disk, of
    which nobody can set back the time of the last change. Raises `OSError`."""
    with open(path, "rb") as stream:
        before = _signature(stream.fileno())
        if store is None or before[0] < LARGE:
            return hashlib.file_digest(stream, "sha256").hexdigest()
        key = os.path.abspath(path)
        kept = store.get_json("digest", key)
        if isinstance(kept, list) and kept[:-1] == before:
            return str(kept[-1])
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        if _signature(stream.fileno()) == before and time.time_ns() - max(before[1:3]) > SETTLED:
            with contextlib.suppress(StoreUnusable):
                store.put_json("digest", key, [*before, digest])
    return digest


def _signature(file: int) -> list[int]:
    state = os.fstat(file)
    return [state.st_size, state.st_mtime_ns, state.st_ctime_ns, state.st_ino, state.st_dev]

"""Digests of files, which need not be worked out again for those that the file system says are as they were."""

from __future__ import annotations

import hashlib
import os
import time
from io import BufferedReader

from thingc.base.filesystem import opened
from thingc.geometry.store.local import Store

LARGE = 1 << 20
"""Bytes from which on a digest is worth keeping."""

SETTLED = 2_000_000_000
"""How long [ns] a file must have been as it is: another change within the grain of its times would not show in them."""


FileSignature = tuple[int, int, int, int, int]
"""Size, times (of the content, of the entry), inode and device of a file: while they stand, so does its content."""

Digests = dict[FileSignature, str]
"""Those that one command has come across."""


def digest_of(path: str, store: Store | None = None, known: Digests | None = None) -> str:
    """The SHA-256 of a file's content in hex. In `store` those of large files are kept, by their size, times and place on the disk, of
    which nobody can set back the time of the last change; in `known` all, for who looks at the same files again. Raises `OSError`."""
    known = {} if known is None else known
    with opened(path) as stream:
        before = _signature(stream.fileno())
        if before not in known:
            known[before] = _digest_stream(stream) if store is None or before[0] < LARGE else _kept(stream, before, store, path)
        return known[before]


def _kept(stream: BufferedReader, before: FileSignature, store: Store, path: str) -> str:
    """The digest that the store has, or from now on has unless the file has just changed."""
    key = os.path.abspath(path)
    kept = store.get_json("digest", key)
    if isinstance(kept, list) and kept[:-1] == [*before]:
        return str(kept[-1])
    digest = _digest_stream(stream)
    if _signature(stream.fileno()) == before and time.time_ns() - max(before[1:3]) > SETTLED:
        store.note_json("digest", key, [*before, digest])
    return digest


def _digest_stream(stream: BufferedReader) -> str:
    return hashlib.file_digest(stream, "sha256").hexdigest()


def _signature(file: int) -> FileSignature:
    state = os.fstat(file)
    return state.st_size, state.st_mtime_ns, state.st_ctime_ns, state.st_ino, state.st_dev

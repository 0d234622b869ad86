"""Compute the digests of files. A digest is cached until the file system reports a change of the file."""

from __future__ import annotations

import hashlib
import os
import time
from io import BufferedReader

from thingc.base.filesystem import open_file
from thingc.geometry.store.local import Store

LARGE = 1 << 20
"""Minimum size [bytes] of files whose digests are cached."""

SETTLED = 2_000_000_000
"""Minimum time [ns] since the last change of a file before its digest is cached. The minimum exists because two changes in quick succession
may have the same file times.
"""


FileSignature = tuple[int, int, int, int, int]
"""Size, modification time, change time, inode and device of a file. Files with the same signature have the same content."""

Digests = dict[FileSignature, str]
"""A mapping that caches the digests of files during one command."""


def digest_of(path: str, store: Store | None = None, known: Digests | None = None) -> str:
    """Return the SHA-256 of a file's content in hexadecimal. Raises `OSError` if the file cannot be read.

    Digests of large files are cached in `store` by path and signature. The signature includes the change time, which programs cannot set.
    The mapping `known` caches the digests of all files, for callers that read the same files several times.
    """
    known = {} if known is None else known
    with open_file(path) as stream:
        before = _signature(stream.fileno())
        if before not in known:
            known[before] = _digest_stream(stream) if store is None or before[0] < LARGE else _digest(stream, before, store, path)
        return known[before]


def _digest(stream: BufferedReader, before: FileSignature, store: Store, path: str) -> str:
    """Return the digest of a file from the store. If the store does not contain the digest, compute it.

    A new digest is stored unless the file has changed very recently.
    """
    key = os.path.abspath(path)
    cached = store.get_json("digest", key)
    if isinstance(cached, list) and cached[:-1] == [*before]:
        return str(cached[-1])
    digest = _digest_stream(stream)
    if _signature(stream.fileno()) == before and time.time_ns() - max(before[1:3]) > SETTLED:
        store.note_json("digest", key, [*before, digest])
    return digest


def _digest_stream(stream: BufferedReader) -> str:
    return hashlib.file_digest(stream, "sha256").hexdigest()


def _signature(file: int) -> FileSignature:
    state = os.fstat(file)
    return state.st_size, state.st_mtime_ns, state.st_ctime_ns, state.st_ino, state.st_dev

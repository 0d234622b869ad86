"""A store that machines share without sharing a folder: a folder of this machine in front of any URL that fsspec knows.

What is not in the folder is fetched from the URL, and what is modelled here is sent there: first the files, then the entry that
speaks of them, so that whoever finds the entry finds the files. Both have their checksums, so a torn or damaged file counts as absent
there as it does here. Only answers about parts are shared; what concerns one machine alone stays in its folder.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
from collections.abc import Iterator
from typing import Any

from thingc.geometry.store.local import BlobMissing, Store, StoreUnusable, cache_root

CONVEX = "convex-meshes"
"""The kind of document of convex pieces. Their key has no version of thingc: rename the kind when the fields of `Mesh` change."""
SHARED = frozenset(("record", "schema", CONVEX, "slices", "step"))
"""The kinds of JSON documents that mean the same on every machine, and are worth a journey."""

WHOLE = frozenset(("s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "oss", "memory"))
"""Protocols by which a file appears as a whole; by others it is written aside and renamed."""

_SHA256 = re.compile(r"[0-9a-f]{64}")


def opened(name: str | None) -> Store:
    """The store of that name, a folder or a URL (None: `$THINGC_STORE`, else the user's). Raises `StoreUnusable` for a URL that
    cannot be used here."""
    stated = name or os.environ.get("THINGC_STORE", "")
    return SharedStore(stated) if "://" in stated else Store(name)


class SharedStore(Store):
    """The store at a URL (`s3://bucket/parts`, `sftp://host/srv/parts`, ...), with a folder of the user's cache in front.

    `root` is that folder. Unlike a folder's, reading raises `StoreUnusable`, too, when the other side does not answer: to model
    everything anew without a word would be worse.
    """

    __slots__ = ("_base", "_damaged", "_made", "_sent", "_system", "url")

    def __init__(self, url: str, root: str | None = None) -> None:
        self.url = re.sub(r"://[^/@]*@", "://", url)  # as shown: without a password
        super().__init__(root or os.path.join(cache_root(), "shared", hashlib.sha256(url.encode()).hexdigest()[:12]))
        try:
            import fsspec
        except ImportError:
            raise StoreUnusable(self.url, "the package `fsspec` is not installed: pip install 'thingc[cluster]'") from None
        with self._words():
            self._system, self._base = fsspec.core.url_to_fs(url, use_listings_cache=False)
        self._base = self._base.rstrip("/")
        self._sent: set[str] = set()
        self._damaged: set[str] = set()
        self._made: set[str] = set()

    # --- reading ---------------------------------------------------------------------------------------------------

    def has(self, sha256: str, size: int | None = None) -> bool:
        """Whether a sound blob is there; one that is only at the URL is fetched."""
        return super().has(sha256, size) or (self._fetched(sha256) and super().has(sha256, size))

    def read(self, sha256: str) -> bytes:
        """The bytes, from the folder or the URL. Raises `BlobMissing` when both have none that is sound."""
        try:
            return super().read(sha256)
        except BlobMissing:
            if not self._fetched(sha256):
                raise
            return super().read(sha256)

    def size(self, sha256: str) -> int:
        """How many bytes the blob has. Raises `BlobMissing`."""
        if not self.has(sha256):
            raise BlobMissing(sha256)
        return super().size(sha256)

    def get_json(self, kind: str, key: str) -> Any | None:
        """The value kept here, else at the URL, or None."""
        value = super().get_json(kind, key)
        if value is None and kind in SHARED:
            path = self._document(kind, key)
            data = self._fetch(path)
            if data is not None:
                self._write(path, data)
                value = super().get_json(kind, key)
        return value

    def _fetched(self, sha256: str) -> bool:
        data = self._fetch(self.path(sha256)) if _SHA256.fullmatch(sha256) else None
        if data is None or hashlib.sha256(data).hexdigest() != sha256:
            if data is not None:
                self._damaged.add(sha256)
            return False
        self._write(self.path(sha256), data, seal=True)
        return True

    def _fetch(self, path: str) -> bytes | None:
        with self._words():
            try:
                data: bytes = self._system.cat_file(self._there(path))
            except FileNotFoundError:
                return None
            return data

    # --- writing ---------------------------------------------------------------------------------------------------

    def put(self, data: bytes) -> str:
        """Keep `data` here; it is sent when an entry names it."""
        return Store(self.root).put(data)

    def put_json(self, kind: str, key: str, value: Any) -> None:
        """Keep a JSON value here and, of the kinds that are shared, at the URL, after all blobs that it names."""
        super().put_json(kind, key, value)
        if kind not in SHARED:
            return
        for sha256 in sorted(set(_hashes(value))):
            if sha256 not in self._sent and super().has(sha256):
                self._send_blob(sha256)
        path = self._document(kind, key)
        with open(path, "rb") as stream:
            self._send(path, stream.read())

    def check(self) -> None:
        """Raise `StoreUnusable` unless the folder and the URL can be written to."""
        super().check()
        with self._words():
            self._make(self._base)

    def _send_blob(self, sha256: str) -> None:
        data = super().read(sha256)
        path = self.path(sha256)
        with self._words():
            try:
                known = self._system.info(self._there(path)).get("size")
            except FileNotFoundError:
                known = None
        if known != len(data) or sha256 in self._damaged:
            self._send(path, data)
        self._sent.add(sha256)

    def _send(self, path: str, data: bytes) -> None:
        there = self._there(path)
        folder = there.rpartition("/")[0]
        with self._words():
            self._make(folder)
            if self._protocols() & WHOLE:
                self._system.pipe_file(there, data)
                return
            aside = f"{there}.{os.getpid()}-{os.urandom(6).hex()}"
            self._system.pipe_file(aside, data)
            try:
                self._system.mv(aside, there)
            except Exception:  # some servers rename onto nothing only
                if not self._system.exists(there):
                    raise
                self._system.rm_file(there)
                self._system.mv(aside, there)

    def _make(self, folder: str) -> None:
        """Make a folder and those that it lies in, one by one: others may make any of them at the same moment."""
        if not folder or folder in self._made:
            return
        if not self._system.isdir(folder):
            self._make(folder.rpartition("/")[0])
            try:
                self._system.makedirs(folder, exist_ok=True)
            except Exception:
                if not self._system.isdir(folder):
                    raise
        self._made.add(folder)

    def _protocols(self) -> set[str]:
        named = self._system.protocol
        return {named} if isinstance(named, str) else set(named)

    def _there(self, path: str) -> str:
        """Where a file of the folder lies at the URL."""
        return f"{self._base}/{os.path.relpath(path, self.root).replace(os.sep, '/')}"

    @contextlib.contextmanager
    def _words(self) -> Iterator[None]:
        """Whatever libraries of protocols raise, as `StoreUnusable`."""
        try:
            yield
        except StoreUnusable:
            raise
        except Exception as fault:
            words = " ".join(str(fault).split()) or type(fault).__name__
            raise StoreUnusable(self.url, words) from fault


def _hashes(value: Any) -> Iterator[str]:
    """Every SHA-256 that a JSON value holds."""
    if isinstance(value, str):
        if _SHA256.fullmatch(value):
            yield value
    elif isinstance(value, dict):
        for inner in value.values():
            yield from _hashes(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _hashes(inner)

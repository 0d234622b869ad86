"""A store that several machines share. The store is a local folder that caches the files at a URL. The package fsspec must support the
protocol of the URL.

Files that are not in the folder are fetched from the URL. New results are uploaded: first the files, then the entry that refers to these
files. Readers therefore never find an entry without its files. Entries and files have checksums, so an incomplete or damaged file counts as
absent.

Machines share only results for parts. Values that are valid only for one machine remain in its local folder.
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
"""Kind of the JSON documents that contain the convex pieces of meshes.

The keys of these documents do not contain the version of thingc. Therefore, rename the kind when the fields of `Mesh` change.
"""
SHARED = frozenset(("record", "schema", CONVEX, "slices", "step"))
"""Kinds of JSON documents that machines share. The values of these documents are valid on every machine, and fetching them is faster than
computing them.
"""

ATOMIC = frozenset(("s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "oss", "memory"))
"""Protocols with atomic uploads. For other protocols, a file is written under a temporary name and renamed."""

_SHA256 = re.compile(r"[0-9a-f]{64}")


def open_store(name: str | None) -> Store:
    """Open a store, which is a folder or a URL. `name` is the path of the folder or the URL. If `name` is None, the value of
    `$THINGC_STORE` is used, otherwise the user's cache.

    Raises `StoreUnusable` if the URL cannot be used.
    """
    place = name or os.environ.get("THINGC_STORE", "")
    return SharedStore(place) if "://" in place else Store(name)


class SharedStore(Store):
    """The store at a URL (`s3://bucket/parts`, `sftp://host/srv/parts`, ...), with a folder in the user's cache as a local copy.

    `root` is the local folder. Reading also raises `StoreUnusable` if the server does not answer. Without this exception, all parts would
    be rebuilt without a message.
    """

    __slots__ = ("_base", "_damaged", "_made_folders", "_sent", "_system", "url")

    def __init__(self, url: str, root: str | None = None) -> None:
        self.url = re.sub(r"://[^/@]*@", "://", url)  # remove the password from the URL in messages
        super().__init__(root or os.path.join(cache_root(), "shared", hashlib.sha256(url.encode()).hexdigest()[:12]))
        try:
            import fsspec
        except ImportError:
            raise StoreUnusable(self.url, "the package `fsspec` is not installed: pip install 'thingc[cluster]'") from None
        with self._converting_errors():
            self._system, self._base = fsspec.core.url_to_fs(url, use_listings_cache=False)
        self._base = self._base.rstrip("/")
        self._sent: set[str] = set()
        self._damaged: set[str] = set()
        self._made_folders: set[str] = set()

    # --- reading ---------------------------------------------------------------------------------------------------

    def has(self, sha256: str, size: int | None = None) -> bool:
        """Return whether a valid blob is in the store. If a blob exists only at the URL, it is fetched."""
        return super().has(sha256, size) or (self._download(sha256) and super().has(sha256, size))

    def read(self, sha256: str) -> bytes:
        """Return the content of a blob from the folder or from the URL. Raises `BlobMissing` if there is no valid copy."""
        try:
            return super().read(sha256)
        except BlobMissing:
            if not self._download(sha256):
                raise
            return super().read(sha256)

    def get_json(self, kind: str, key: str) -> Any | None:
        """Return the JSON value that is stored under a kind and a key.

        If the local folder does not contain the value, fetch it from the URL. Return None if the value does not exist.
        """
        value = super().get_json(kind, key)
        if value is None and kind in SHARED:
            path = self._document(kind, key)
            data = self._fetch(path)
            if data is not None:
                self._write(path, data)
                value = super().get_json(kind, key)
        return value

    def _download(self, sha256: str) -> bool:
        data = self._fetch(self.path(sha256)) if _SHA256.fullmatch(sha256) else None
        if data is None or hashlib.sha256(data).hexdigest() != sha256:
            if data is not None:
                self._damaged.add(sha256)
            return False
        self._write(self.path(sha256), data, seal=True)
        return True

    def _fetch(self, path: str) -> bytes | None:
        with self._converting_errors():
            try:
                data: bytes = self._system.cat_file(self._url_of(path))
            except FileNotFoundError:
                return None
            return data

    # --- writing ---------------------------------------------------------------------------------------------------

    def put(self, data: bytes) -> str:
        """Store `data` in the local folder. `put_json` uploads the data when it stores an entry that refers to the data."""
        return Store(self.root).put(data)

    def put_json(self, kind: str, key: str, value: Any) -> None:
        """Store a JSON value in the local folder. If its kind is shared, upload the value after all blobs to which it refers."""
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
        """Raise `StoreUnusable` if the folder or the URL is not writable."""
        super().check()
        with self._converting_errors():
            self._make_folder(self._base)

    def _send_blob(self, sha256: str) -> None:
        data = super().read(sha256)
        path = self.path(sha256)
        with self._converting_errors():
            try:
                size = self._system.info(self._url_of(path)).get("size")
            except FileNotFoundError:
                size = None
        if size != len(data) or sha256 in self._damaged:
            self._send(path, data)
        self._sent.add(sha256)

    def _send(self, path: str, data: bytes) -> None:
        target = self._url_of(path)
        folder = target.rpartition("/")[0]
        with self._converting_errors():
            self._make_folder(folder)
            if self._protocols() & ATOMIC:
                self._system.pipe_file(target, data)
                return
            temporary = f"{target}.{os.getpid()}-{os.urandom(6).hex()}"
            self._system.pipe_file(temporary, data)
            try:
                self._system.mv(temporary, target)
            except Exception:  # some servers do not replace an existing file
                if not self._system.exists(target):
                    raise
                self._system.rm_file(target)
                self._system.mv(temporary, target)

    def _make_folder(self, folder: str) -> None:
        """Create a folder and its parents one by one, because another process may create the same folders at the same time."""
        if not folder or folder in self._made_folders:
            return
        if not self._system.isdir(folder):
            self._make_folder(folder.rpartition("/")[0])
            try:
                self._system.makedirs(folder, exist_ok=True)
            except Exception:
                if not self._system.isdir(folder):
                    raise
        self._made_folders.add(folder)

    def _protocols(self) -> set[str]:
        named = self._system.protocol
        return {named} if isinstance(named, str) else set(named)

    def _url_of(self, path: str) -> str:
        """Return the path at the URL that corresponds to a file in the local folder."""
        return f"{self._base}/{os.path.relpath(path, self.root).replace(os.sep, '/')}"

    @contextlib.contextmanager
    def _converting_errors(self) -> Iterator[None]:
        """Return a context manager that converts exceptions of protocol libraries to `StoreUnusable`."""
        try:
            yield
        except StoreUnusable:
            raise
        except Exception as fault:
            message = " ".join(str(fault).split()) or type(fault).__name__
            raise StoreUnusable(self.url, message) from fault


def _hashes(value: Any) -> Iterator[str]:
    """Yield every SHA-256 that occurs in a JSON value."""
    if isinstance(value, str) and _SHA256.fullmatch(value):
        yield value
    elif isinstance(value, (dict, list)):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from _hashes(inner)

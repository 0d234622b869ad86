"""The content-addressed store. The store contains geometry files under the SHA-256 of their contents, and small JSON documents under a kind
and a key.

Every file is written under a temporary name and renamed, so a file is either absent or complete. Any number of processes can share a store,
and can be killed at any time. The checksum of a file is verified on every read. A damaged file counts as absent. The store does not use
pickle.

    <root>/blobs/ab/cdef...     the bytes whose SHA-256 is abcdef...
    <root>/<kind>/ab/cdef...    the JSON document whose key has that SHA-256, after a line with its checksum

The checksum of a document includes its kind and name, so that a document stored under another name is invalid.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import stat
import sys
from typing import Any

from thingc.base.exceptions import PicklableError
from thingc.base.filesystem import BINARY, hash_name, write_new

SEALED = 946_684_800
"""Modification time [s] of every complete blob (2000-01-01).

If a blob was modified later, its modification time is different, and the blob is hashed before it is used.
"""


class StoreUnusable(PicklableError):
    """Raised if the folder of the store cannot be used. `reason` is the message of the operating system."""

    def __init__(self, root: str, reason: str) -> None:
        super().__init__(f"the cache {root} cannot be used: {reason}")
        self.root = root
        self.reason = reason


class BlobMissing(PicklableError):
    """Raised if a blob is not in the store, or was damaged and has been removed."""

    def __init__(self, sha256: str) -> None:
        super().__init__(f"the cache does not contain a valid blob {sha256}")
        self.sha256 = sha256


def default_root() -> str:
    """Return the default folder of the store: the value of the environment variable `THINGC_STORE`, or the folder that `cache_root()`
    returns.
    """
    configured = os.environ.get("THINGC_STORE")
    return os.path.abspath(configured) if configured and "://" not in configured else cache_root()


def cache_root() -> str:
    """Return the folder of thingc in the user's cache folder, whose location depends on the operating system."""
    home = os.path.expanduser("~")
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or os.path.join(home, "AppData", "Local")
        return os.path.join(base, "thingc", "store")
    if sys.platform == "darwin":
        return os.path.join(home, "Library", "Caches", "thingc")
    base = os.environ.get("XDG_CACHE_HOME", "")
    return os.path.join(base if os.path.isabs(base) else os.path.join(home, ".cache"), "thingc")


class Store:
    """A content-addressed store in a folder (default: `default_root()`). The folder is created with the first write.

    Writing raises `StoreUnusable` if the folder is not writable. Reading does not raise this exception, because a file that cannot be read
    counts as absent.
    """

    __slots__ = ("root",)

    def __init__(self, root: str | None = None) -> None:
        self.root = os.path.abspath(root) if root else default_root()

    # --- blobs ---------------------------------------------------------------------------------------------------

    def path(self, sha256: str) -> str:
        """Return the path of the file for a blob, whether the file exists or not.

        Raises `BadPath`, a subclass of `OSError`, if the hash is not valid.
        """
        hash_name(sha256)
        return os.path.join(self.root, "blobs", sha256[:2], sha256[2:])

    def put(self, data: bytes) -> str:
        """Write the bytes `data` to the store, unless it already contains a valid copy. Return the SHA-256 of the data in hexadecimal."""
        sha256 = hashlib.sha256(data).hexdigest()
        if not self.has(sha256, len(data)):
            self._write(self.path(sha256), data, seal=True)
        return sha256

    def has(self, sha256: str, size: int | None = None) -> bool:
        """Return whether the store contains a valid blob with the hash `sha256` and, if given, the size `size` [bytes].

        A blob with the modification time `SEALED` is trusted. Any other blob is hashed. If its hash is correct, its modification time is
        set to `SEALED`. If the hash is not correct, the blob is removed.
        """
        try:
            path = self.path(sha256)
            status = os.stat(path)
        except OSError:
            return False
        if size is not None and status.st_size != size:
            self._discard(path)
            return False
        if int(status.st_mtime) == SEALED:
            return True
        try:
            self.read(sha256)
        except BlobMissing:
            return False
        with contextlib.suppress(OSError):
            os.utime(path, (SEALED, SEALED))
        return True

    def read(self, sha256: str) -> bytes:
        """Return the bytes of a blob, verified by their hash. Raises `BlobMissing` if the blob is absent or damaged."""
        try:
            path = self.path(sha256)
            with open(path, "rb") as stream:
                data = stream.read()
        except OSError:
            raise BlobMissing(sha256) from None
        if hashlib.sha256(data).hexdigest() != sha256:
            self._discard(path)
            raise BlobMissing(sha256)
        return data

    # --- JSON documents ------------------------------------------------------------------------------------------

    def get_json(self, kind: str, key: str) -> Any | None:
        """Return the value stored under `kind` (the name of a folder) and `key` (any string), or None."""
        try:
            with open(self._document(kind, key), "rb") as stream:
                data = stream.read()
        except OSError:
            return None
        checksum, _, payload = data.partition(b"\n")
        if _checksum(kind, _name(key), payload) != checksum:
            return None
        try:
            return json.loads(payload)
        except ValueError:
            return None

    def put_json(self, kind: str, key: str, value: Any) -> None:
        """Store a JSON value under `kind` and `key`, replacing any previous value."""
        self._write(self._document(kind, key), _seal(kind, key, value))

    def note_json(self, kind: str, key: str, value: Any) -> None:
        """Store a JSON value that is only used to save time. Write errors are ignored."""
        with contextlib.suppress(StoreUnusable):
            self._write(self._document(kind, key), _seal(kind, key, value))

    # --- files ---------------------------------------------------------------------------------------------------

    def check(self) -> None:
        """Raise `StoreUnusable` unless the store is writable."""
        probe = os.path.join(self.root, "blobs")
        try:
            os.makedirs(probe, exist_ok=True)
        except OSError as fault:
            raise StoreUnusable(self.root, fault.strerror or str(fault)) from None
        if not os.access(probe, os.W_OK | os.X_OK):
            raise StoreUnusable(self.root, os.strerror(errno.EACCES))

    def _document(self, kind: str, key: str) -> str:
        name = _name(key)
        return os.path.join(self.root, kind, name[:2], name[2:])

    def _write(self, path: str, data: bytes, *, seal: bool = False) -> None:
        temporary = f"{path}.{os.getpid()}-{os.urandom(6).hex()}"
        try:
            try:
                write_new(temporary, data, 0o644)
            except FileNotFoundError:
                os.makedirs(os.path.dirname(path), exist_ok=True)
                write_new(temporary, data, 0o644)
            if seal:
                os.utime(temporary, (SEALED, SEALED))
            os.replace(temporary, path)
        except OSError as fault:
            with contextlib.suppress(OSError):
                os.unlink(temporary)
            if seal and os.path.exists(path):  # Windows does not replace a file that another process is reading
                return
            raise StoreUnusable(self.root, fault.strerror or str(fault)) from None

    @staticmethod
    def _discard(path: str) -> None:
        with contextlib.suppress(OSError):
            os.unlink(path)


def _name(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()


def _seal(kind: str, key: str, value: Any) -> bytes:
    """Encode a JSON document for the store: a line with the checksum, followed by the value."""
    payload = json.dumps(value, separators=(",", ":"), sort_keys=True, ensure_ascii=False).encode()
    return _checksum(kind, _name(key), payload) + b"\n" + payload


def _checksum(kind: str, name: str, payload: bytes) -> bytes:
    """Compute the checksum of a JSON document in the store. The checksum covers the kind and the name of the document."""
    return hashlib.sha256(f"{kind}/{name}\n".encode() + payload).hexdigest().encode()


class Outbox(Store):
    """A replacement for the store in a process that must not write to the store.

    The outbox reads from the store in the folder `root`. `put` keeps blobs in memory and appends them to one file in `folder`, because
    one file per blob would be slower. A process with write access moves the blobs to the store with `deliver`. An outbox does not support
    JSON documents.
    """

    __slots__ = ("_held", "_path")

    def __init__(self, root: str, folder: str) -> None:
        super().__init__(root)
        self._path = os.path.join(folder, "outbox")
        self._held: dict[str, bytes] = {}

    def put(self, data: bytes) -> str:
        """Write a blob to the outbox, unless the store contains it. Return the SHA-256 of the data in hexadecimal."""
        sha256 = hashlib.sha256(data).hexdigest()
        if sha256 not in self._held and not self.has(sha256, len(data)):
            try:
                with open(self._path, "ab") as stream:
                    stream.writelines((len(data).to_bytes(_LENGTH, "little"), data))
            except OSError as fault:
                raise StoreUnusable(self._path, fault.strerror or str(fault)) from None
            self._held[sha256] = data
        return sha256

    def read(self, sha256: str) -> bytes:
        """Return the bytes of a blob in the outbox or in the store. Raises `BlobMissing` if the store does not contain the blob."""
        return self._held[sha256] if sha256 in self._held else super().read(sha256)

    def deliver(self) -> None:
        """Move all blobs from the outbox to the store under the hashes of their contents. Blobs that already exist in the store are not
        replaced.

        The process that wrote the outbox must have ended before this call. Raises `StoreUnusable` if the store is not writable.
        """
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | BINARY
        try:
            descriptor = os.open(self._path, flags)
        except OSError:  # no blobs were written
            return
        with open(descriptor, "rb") as stream:
            status = os.fstat(descriptor)
            remaining = status.st_size if stat.S_ISREG(status.st_mode) else 0
            while remaining > _LENGTH:
                size = int.from_bytes(stream.read(_LENGTH), "little")
                remaining -= _LENGTH + size
                if remaining >= 0:
                    super().put(stream.read(size))
        self._discard(self._path)


_LENGTH = 8
"""Size of the field [bytes] that contains the length of a blob in an outbox."""

"""The content-addressed store: geometry by the SHA-256 of its bytes, small JSON documents by kind and key.

Everything is written aside and renamed, so that any number of processes may share one store and be killed at any
instant: a name is either absent or whole. Whatever is read is checked, and what is damaged counts as absent. Nothing is
ever pickled.

    <root>/blobs/ab/cdef...     the bytes whose SHA-256 is abcdef...
    <root>/<kind>/ab/cdef...    the JSON document whose key has that SHA-256, behind a line with its checksum

The checksum of a document is taken over its kind and name as well: a sound document in the place of another is none.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import stat
import sys
from collections.abc import Iterator
from typing import Any

from thingc.base.filesystem import hash_name

SEALED = 946_684_800
"""The modification time [s] every blob gets when it is whole (2000-01-01): a blob that was written to afterwards shows
another time, and is hashed before it is trusted."""


class StoreUnusable(Exception):
    """The store's folder cannot be used: `root`, and the reason in the words of the system."""

    def __init__(self, root: str, reason: str) -> None:
        super().__init__(f"the store {root} cannot be used: {reason}")
        self.root = root
        self.reason = reason


class BlobMissing(Exception):
    """A blob that should be in the store is not there, or was damaged (then it has been thrown away)."""

    def __init__(self, sha256: str) -> None:
        super().__init__(f"the store has no sound blob {sha256}")
        self.sha256 = sha256


def default_root() -> str:
    """`$THINGC_STORE` where it names a folder, else `cache_root()`."""
    stated = os.environ.get("THINGC_STORE")
    return os.path.abspath(stated) if stated and "://" not in stated else cache_root()


def cache_root() -> str:
    """A folder in the user's cache as each system has it."""
    home = os.path.expanduser("~")
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or os.path.join(home, "AppData", "Local")
        return os.path.join(base, "thingc", "store")
    if sys.platform == "darwin":
        return os.path.join(home, "Library", "Caches", "thingc")
    base = os.environ.get("XDG_CACHE_HOME", "")
    return os.path.join(base if os.path.isabs(base) else os.path.join(home, ".cache"), "thingc")


class Store:
    """A store in the folder `root` (`default_root()` without one); the folder is made with the first write.

    Writing raises `StoreUnusable` where the folder cannot be written; reading never does: what cannot be read is
    not there.
    """

    __slots__ = ("_noted", "root")

    def __init__(self, root: str | None = None) -> None:
        self.root = os.path.abspath(root) if root else default_root()
        self._noted: dict[str, bytes] | None = None

    # --- blobs ---------------------------------------------------------------------------------------------------

    def path(self, sha256: str) -> str:
        """Where the blob lies, or would lie. Raises `BadPath`, an `OSError`, if the hash is not one."""
        hash_name(sha256)
        return os.path.join(self.root, "blobs", sha256[:2], sha256[2:])

    def put(self, data: bytes) -> str:
        """Keep `data`; its SHA-256 in hex. Nothing is written when a sound copy is there."""
        sha256 = hashlib.sha256(data).hexdigest()
        if not self.has(sha256, len(data)):
            self._write(self.path(sha256), data, seal=True)
        return sha256

    def has(self, sha256: str, size: int | None = None) -> bool:
        """Whether a sound blob is there (of `size` bytes, where that is known).

        A sealed blob is believed; one whose time differs is hashed, and sealed again or thrown away.
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
        """The bytes, checked against their name. Raises `BlobMissing` when they are absent or damaged."""
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

    def size(self, sha256: str) -> int:
        """How many bytes the blob has. Raises `BlobMissing`."""
        try:
            return os.stat(self.path(sha256)).st_size
        except OSError:
            raise BlobMissing(sha256) from None

    # --- JSON documents ------------------------------------------------------------------------------------------

    def get_json(self, kind: str, key: str) -> Any | None:
        """The value kept under `kind` (a word, it names a folder) and `key` (any text), or None."""
        path = self._document(kind, key)
        data = self._noted.get(path) if self._noted else None
        if data is None:
            try:
                with open(path, "rb") as stream:
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
        """Keep a JSON value under `kind` and `key`, in place of what was there."""
        self._write(self._document(kind, key), _sealed(kind, key, value))

    def note_json(self, kind: str, key: str, value: Any) -> None:
        """Keep a JSON value of a kind that only saves time: where that cannot be written, nothing is lost, and nothing is said."""
        path, data = self._document(kind, key), _sealed(kind, key, value)
        if self._noted is not None:
            self._noted[path] = data
        else:
            self._write_noted(path, data)

    @contextlib.contextmanager
    def hurried(self) -> Iterator[None]:
        """Meanwhile nothing is written of what is only noted: that is done at the end, when nobody waits any more."""
        noted: dict[str, bytes] = {}
        self._noted = noted
        try:
            yield
        finally:
            self._noted = None
            for path, data in noted.items():
                self._write_noted(path, data)

    # --- files ---------------------------------------------------------------------------------------------------

    def check(self) -> None:
        """Raise `StoreUnusable` unless the store can be written to."""
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

    def _write_noted(self, path: str, data: bytes) -> None:
        with contextlib.suppress(StoreUnusable):
            self._write(path, data)

    def _write(self, path: str, data: bytes, *, seal: bool = False) -> None:
        aside = f"{path}.{os.getpid()}-{os.urandom(6).hex()}"
        try:
            try:
                descriptor = os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o644)
            except FileNotFoundError:
                os.makedirs(os.path.dirname(path), exist_ok=True)
                descriptor = os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o644)
            with open(descriptor, "wb") as stream:
                stream.write(data)
            if seal:
                os.utime(aside, (SEALED, SEALED))
            os.replace(aside, path)
        except OSError as fault:
            with contextlib.suppress(OSError):
                os.unlink(aside)
            if seal and os.path.exists(path):  # Windows will not replace a file that another process reads
                return
            raise StoreUnusable(self.root, fault.strerror or str(fault)) from None

    @staticmethod
    def _discard(path: str) -> None:
        with contextlib.suppress(OSError):
            os.unlink(path)


def _name(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()


def _sealed(kind: str, key: str, value: Any) -> bytes:
    """A JSON document as it is written: a line with its checksum, and the value."""
    payload = json.dumps(value, separators=(",", ":"), sort_keys=True, ensure_ascii=False).encode()
    return _checksum(kind, _name(key), payload) + b"\n" + payload


def _checksum(kind: str, name: str, payload: bytes) -> bytes:
    """Of a JSON document, bound to the place where it belongs."""
    return hashlib.sha256(f"{kind}/{name}\n".encode() + payload).hexdigest().encode()


class Outbox(Store):
    """A store as a process sees it that must not write there: it reads from `root`, and what it puts is at hand for itself and lies in one
    file in `folder` (a file for each takes the system longer than to write them), until somebody who may takes it over with `deliver`.
    JSON documents are none of its business."""

    __slots__ = ("_held", "_path")

    def __init__(self, root: str, folder: str) -> None:
        super().__init__(root)
        self._path = os.path.join(folder, "outbox")
        self._held: dict[str, bytes] = {}

    def put(self, data: bytes) -> str:
        """Lay `data` down unless the store has it; its SHA-256 in hex."""
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
        """The bytes, of what was put or is in the store. Raises `BlobMissing`."""
        return self._held[sha256] if sha256 in self._held else super().read(sha256)

    def deliver(self) -> None:
        """Put everything that lies in the folder into the store, by its content, and remove it: whatever was written there, nothing comes
        into the place of something else. Nobody may be at work there any more. Raises `StoreUnusable`."""
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        try:
            descriptor = os.open(self._path, flags)
        except OSError:  # nothing was laid down
            return
        with open(descriptor, "rb") as stream:
            status = os.fstat(descriptor)
            left = status.st_size if stat.S_ISREG(status.st_mode) else 0
            while left > _LENGTH:
                size = int.from_bytes(stream.read(_LENGTH), "little")
                left -= _LENGTH + size
                if left >= 0:
                    super().put(stream.read(size))
        self._discard(self._path)


_LENGTH = 8
"""How many bytes of an outbox say how long the next blob is."""

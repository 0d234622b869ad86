"""The store: entries are complete or absent, whatever happens to its files, and an unusable store is reported."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from thingc.geometry.store.local import BlobMissing, Store, StoreUnusable, default_root


def test_blobs_are_addressed_by_content(tmp_path: Path) -> None:
    store = Store(str(tmp_path))
    sha256 = store.put(b"bytes")
    assert sha256 == hashlib.sha256(b"bytes").hexdigest()
    assert store.read(sha256) == b"bytes"
    assert Path(store.path(sha256)).read_bytes() == b"bytes"
    assert store.has(sha256, 5)
    assert not store.has(sha256[::-1])
    with pytest.raises(BlobMissing):
        store.read(sha256[::-1])


@pytest.mark.parametrize("damage", [b"", b"byte", b"bytes!", b"BYTES"])
@pytest.mark.parametrize("question", ["has", "read"])
def test_damaged_blob_is_absent_and_can_be_replaced(tmp_path: Path, damage: bytes, question: str) -> None:
    store = Store(str(tmp_path))
    sha256 = store.put(b"bytes")
    Path(store.path(sha256)).write_bytes(damage)
    if question == "has":
        assert not store.has(sha256)
    else:
        with pytest.raises(BlobMissing):
            store.read(sha256)
    assert store.put(b"bytes") == sha256
    assert store.read(sha256) == b"bytes"


def test_touched_blob_is_still_valid(tmp_path: Path) -> None:
    store = Store(str(tmp_path))
    sha256 = store.put(b"bytes")
    os.utime(store.path(sha256))
    assert store.has(sha256, 5)


def test_json_documents_round_trip(tmp_path: Path) -> None:
    store = Store(str(tmp_path))
    value = {"a": [1, 2.5, None, "é"], "b": {"c": True}}
    assert store.get_json("kind", "key") is None
    store.put_json("kind", "key", value)
    assert store.get_json("kind", "key") == value
    assert store.get_json("other", "key") is None
    store.put_json("kind", "key", [1])
    assert store.get_json("kind", "key") == [1]


@pytest.mark.parametrize("keep", [0, 10, 64, 65, -1])
def test_truncated_document_is_absent(tmp_path: Path, keep: int) -> None:
    store = Store(str(tmp_path))
    store.put_json("kind", "key", {"a": 1})
    (path,) = (tmp_path / "kind").glob("*/*")
    path.write_bytes(path.read_bytes()[:keep])
    assert store.get_json("kind", "key") is None


def test_documents_in_the_wrong_place_are_absent(tmp_path: Path) -> None:
    store = Store(str(tmp_path))
    places = [("record", "one"), ("record", "two"), ("schema", "one")]
    for number, (kind, key) in enumerate(places):
        store.put_json(kind, key, number)
    files = [Path(store._document(kind, key)) for kind, key in places]
    first, second, third = (path.read_bytes() for path in files)
    for path, content in zip(files, (second, third, first), strict=True):
        path.write_bytes(content)
    assert [store.get_json(kind, key) for kind, key in places] == [None, None, None]
    store.put_json("record", "one", "again")
    assert store.get_json("record", "one") == "again"


def test_unusable_store_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    store = Store(str(tmp_path / "file" / "store"))
    with pytest.raises(StoreUnusable) as caught:
        store.check()
    assert caught.value.root == str(tmp_path / "file" / "store")
    assert str(caught.value) == f"the cache {store.root} cannot be used: Not a directory"
    with pytest.raises(StoreUnusable):
        store.put(b"x")
    assert store.get_json("kind", "key") is None


def test_default_store_location(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("THINGC_STORE", str(tmp_path / "own"))
    assert default_root() == str(tmp_path / "own")
    monkeypatch.delenv("THINGC_STORE")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert default_root() == str(tmp_path / ".cache" / "thingc")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert default_root() == str(tmp_path / "cache" / "thingc")
    monkeypatch.setattr(sys, "platform", "darwin")
    assert default_root() == str(tmp_path / "Library" / "Caches" / "thingc")


WRITER = """
import os, sys
from thingc.geometry.store.local import Store
store = Store(sys.argv[1])
print("ready", flush=True)
k = 0
while True:
    store.put((b"%d " % (k % 50)) * 50_000)
    store.put_json("kind", str(k % 50), {"k": k % 50, "more": "x" * 20_000})
    k += 1
"""


def test_killed_writers_leave_nothing_damaged(tmp_path: Path) -> None:
    for delay in range(0, 12, 2):
        writers = [
            subprocess.Popen([sys.executable, "-c", WRITER, str(tmp_path)], stdout=subprocess.PIPE) for _ in range(2)
        ]
        for writer in writers:
            assert writer.stdout is not None
            writer.stdout.readline()
        deadline = time.monotonic() + 0.004 * delay
        while time.monotonic() < deadline:
            pass
        for writer in writers:
            writer.send_signal(signal.SIGKILL)
            writer.communicate()
    store = Store(str(tmp_path))
    names = [path.parent.name + path.name for path in (tmp_path / "blobs").glob("*/*") if "." not in path.name]
    assert names
    for name in names:
        assert hashlib.sha256(Path(store.path(name)).read_bytes()).hexdigest() == name
    found = [value for k in range(50) if (value := store.get_json("kind", str(k))) is not None]
    assert len(found) == len([path for path in (tmp_path / "kind").glob("*/*") if "." not in path.name])


def test_notes_can_be_read_by_other_stores(tmp_path: Path) -> None:
    store, other = Store(str(tmp_path)), Store(str(tmp_path))
    store.note_json("facts", "a", [1])
    assert other.get_json("facts", "a") == [1]
    store.note_json("facts", "a", [3])
    assert other.get_json("facts", "a") == [3]


def test_notes_are_dropped_if_the_store_is_unusable(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    store = Store(str(tmp_path / "file" / "store"))
    store.note_json("facts", "a", [1])
    assert store.get_json("facts", "a") is None

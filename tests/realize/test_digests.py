"""Digests of large files are cached while the files are unchanged, and always match the content."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

from thingc.geometry.store import file_digests
from thingc.geometry.store.file_digests import LARGE, digest_of
from thingc.geometry.store.local import Store


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    monkeypatch.setattr(file_digests, "SETTLED", -1)
    return Store(str(tmp_path / "store"))


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def kept(store: Store, path: Path) -> list[object] | None:
    found: list[object] | None = store.get_json("digest", str(path))
    return found


def test_large_file_is_hashed_once(store: Store, tmp_path: Path) -> None:
    path = tmp_path / "trunk.stl"
    path.write_bytes(b"a" * LARGE)
    assert digest_of(str(path), store) == sha256(path)
    known = kept(store, path)
    assert known is not None and known[-1] == sha256(path)
    store.put_json("digest", str(path), [*known[:-1], "what is kept"])
    assert digest_of(str(path), store) == "what is kept" and digest_of(str(path)) == sha256(path)


def test_changed_content_with_equal_size_and_time_is_noticed(store: Store, tmp_path: Path) -> None:
    path = tmp_path / "trunk.stl"
    path.write_bytes(b"a" * LARGE)
    os.utime(path, ns=(0, 1_000_000_000))
    before = digest_of(str(path), store)
    path.write_bytes(b"b" * LARGE)
    os.utime(path, ns=(0, 1_000_000_000))
    assert digest_of(str(path), store) == sha256(path) != before


def test_digests_of_small_or_recent_files_are_not_cached(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    small, young = tmp_path / "small.stl", tmp_path / "young.stl"
    small.write_bytes(b"a")
    assert digest_of(str(small), store) == sha256(small) and kept(store, small) is None
    monkeypatch.setattr(file_digests, "SETTLED", 3_600_000_000_000)
    young.write_bytes(b"a" * LARGE)
    assert digest_of(str(young), store) == sha256(young) and kept(store, young) is None

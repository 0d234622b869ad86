"""Files that variants share are hard links, and an incomplete line of a journal is removed."""

from __future__ import annotations

import errno
import hashlib
import os
from pathlib import Path

import pytest

from thingc.batch.folder_layout import ASSETS, VARIANTS, Journal, write_variant
from thingc.targets.artifact import StoredArtifact

MESH = b"v 0 0 0\n" * 20
SHA256 = hashlib.sha256(MESH).hexdigest()


class Blobs:
    """A store that contains one mesh."""

    def read(self, sha256: str) -> bytes:
        assert sha256 == SHA256
        return MESH


@pytest.mark.parametrize(("most", "inodes"), [(100, 1), (3, 3), (0, 6)])
def test_variants_share_meshes_as_far_as_the_file_system_allows_links(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int, inodes: int,
) -> None:
    """A file has at most `most` names (ext4: 65 000). If `most` is 0, the file system has no hard links."""
    create = os.link

    def link(source: str, target: str) -> None:
        if os.stat(source).st_nlink >= most:
            raise OSError(errno.EMLINK if most else errno.EPERM, "no further link")
        create(source, target)

    monkeypatch.setattr(os, "link", link)
    for name in (VARIANTS, ASSETS):
        (tmp_path / name).mkdir()
    for number in range(6):
        write_variant(str(tmp_path), f"{number:012x}", {"mesh.obj": StoredArtifact(sha256=SHA256, size=len(MESH))}, Blobs())
    files = sorted(tmp_path.glob(f"{VARIANTS}/*/mesh.obj"))
    assert [file.read_bytes() for file in files] == [MESH] * 6 and len({file.stat().st_ino for file in files}) == inodes
    assert [file.name for file in (tmp_path / ASSETS).iterdir()] == [SHA256]


@pytest.mark.parametrize("replaced", [0, 1, 3])
def test_link_is_repeated_while_other_processes_replace_the_shared_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, replaced: int,
) -> None:
    """Linux refuses a link with ENOENT if the file has lost its last name since its path was looked up."""
    create, refused = os.link, []

    def link(source: str, target: str) -> None:
        if len(refused) < replaced:
            refused.append(source)
            (tmp_path / "equal").write_bytes(MESH)
            os.rename(tmp_path / "equal", source)
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), source)
        create(source, target)

    monkeypatch.setattr(os, "link", link)
    for name in (VARIANTS, ASSETS):
        (tmp_path / name).mkdir()
    write_variant(str(tmp_path), "0" * 12, {"mesh.obj": StoredArtifact(sha256=SHA256, size=len(MESH))}, Blobs())
    (file,) = tmp_path.glob(f"{VARIANTS}/*/mesh.obj")
    assert file.samefile(tmp_path / ASSETS / SHA256) and len(refused) == replaced


@pytest.mark.parametrize("before", [b"", b'{"a":1}\n', b'{"a":1}\n{"b":"\xc3\xa9"}\n'])
def test_journal_loses_only_an_incomplete_line(tmp_path: Path, before: bytes) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_bytes(before + b'{"c":')
    with Journal(str(path)) as journal:
        journal.append({"d": 2})
    assert path.read_bytes() == before + b'{"d":2}\n'

"""The files of a workspace that are packed, and the result of unpacking. `tarfile` reads the archives."""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
import tarfile
import zlib
from pathlib import Path

import pytest
from msgspec.structs import replace

from thingc.base.diagnostics import Code
from thingc.batch import BatchFault, plan
from thingc.batch.cluster import workspace_archive
from thingc.batch.cluster.workspace_archive import WorkspaceArchive, pack
from variants.robots import workspace


def packed(here: Path, document: str = "sweep") -> WorkspaceArchive:
    return pack(plan(str(here / f"{document}.yaml")), str(here / "build" / document))


def names(found: WorkspaceArchive) -> set[str]:
    """Return the names in the archive, read by tarfile."""
    with tarfile.open(fileobj=io.BytesIO(zlib.decompress(found.data))) as archive:
        return set(archive.getnames())


DOCUMENTS = {f"{name}.yaml" for name in ("pendulum", "sweep", "stand", "mast", "tall_mast")} | {"thingc.toml", "parts", "parts/plates.py"}


def test_archive_is_reproducible(tmp_path: Path) -> None:
    one, two = workspace(tmp_path / "one"), workspace(tmp_path / "another")
    for path in two.rglob("*"):
        os.utime(path, (1, 1))
    assert packed(one) == replace(packed(two), root=str(one)) and names(packed(one)) == DOCUMENTS
    (two / "mast.yaml").chmod(0o755)
    assert packed(two).sha256 != packed(one).sha256
    (two / "mast.yaml").chmod(0o644)
    (two / "note.txt").write_text("a part may read it")
    assert packed(two).sha256 != packed(one).sha256 and names(packed(two)) == DOCUMENTS | {"note.txt"}


def test_unrelated_files_are_not_packed(tmp_path: Path) -> None:
    here = workspace(tmp_path)
    for name in (
        "build/arm/manifest.json", ".git/objects/pack", ".venv/pyvenv.cfg", "env/pyvenv.cfg", "env/lib/x.py", "node_modules/a.js",
        "parts/__pycache__/plates.cpython-311.pyc", "parts/old.pyc", ".cache/x", ".sweep.thingc-lock", "old/batch/variants/x",
    ):
        (here / name).parent.mkdir(parents=True, exist_ok=True)
        (here / name).write_text("x")
    (here / "old/batch/batch.json").write_text(json.dumps({"thingc": "batch/1"}))
    os.mkfifo(here / "pipe")
    (here / "empty").mkdir()
    assert names(packed(here)) == DOCUMENTS | {"old", "empty"}


def test_part_folders_and_documents_are_packed(tmp_path: Path) -> None:
    here = workspace(tmp_path)
    (here / ".shapes").mkdir()
    (here / ".shapes" / "round.py").write_text("")
    (here / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts", ".shapes"]\n')
    (here / ".robots").mkdir()
    (here / ".robots" / "sweep.yaml").write_text((here / "sweep.yaml").read_text().replace("pendulum.yaml", "pendulum_2.yaml"))
    (here / ".robots" / "pendulum_2.yaml").write_text((here / "pendulum.yaml").read_text())
    found = names(pack(plan(str(here / ".robots" / "sweep.yaml")), str(here / "build" / "sweep")))
    assert found == DOCUMENTS | {".shapes", ".shapes/round.py", ".robots/pendulum_2.yaml"}


def test_links_are_packed_as_links(tmp_path: Path) -> None:
    here = workspace(tmp_path / "robots")
    (here / "deep").mkdir()
    (here / "deep" / "relative.yaml").symlink_to("../mast.yaml")
    (here / "deep" / "absolute.yaml").symlink_to(here / "mast.yaml")
    (here / "around.yaml").symlink_to("../robots/mast.yaml")
    (here / "shapes").symlink_to("parts")
    (here / "latest").symlink_to("build/arm")
    (here / ".own").mkdir()
    (here / ".own" / "rods.py").write_text("")
    (here / "rods").symlink_to(".own")
    (here / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts", "rods"]\n')
    place = tmp_path / "elsewhere" / "work"
    packed(here).unpack(str(place))
    shutil.rmtree(here)
    assert (place / "deep" / "absolute.yaml").read_bytes() == (place / "mast.yaml").read_bytes()
    assert {str(path.relative_to(place)): os.readlink(path) for path in place.rglob("*") if path.is_symlink()} == {
        "deep/relative.yaml": "../mast.yaml", "deep/absolute.yaml": "../mast.yaml", "around.yaml": "mast.yaml", "shapes": "parts",
        "latest": "build/arm", "rods": ".own",
    }
    assert (place / "rods" / "rods.py").is_file() and not (place / ".own").is_symlink()
    assert (place / "shapes" / "plates.py").is_file() and not (place / "latest").exists()


@pytest.mark.parametrize("target", ["../outside.txt", "/etc/hostname", "..", "../hop"])
def test_links_out_of_the_workspace_are_rejected(tmp_path: Path, target: str) -> None:
    here = workspace(tmp_path / "robots")
    (tmp_path / "outside.txt").write_text("x")
    (tmp_path / "hop").symlink_to("robots/mast.yaml")  # leaves and comes back: there is no such hop elsewhere
    (here / "parts" / "link").symlink_to(target if os.path.isabs(target) else f"../{target}")
    with pytest.raises(BatchFault, match="the symbolic link `parts/link` leads outside the workspace") as caught:
        packed(here)
    assert caught.value.diagnostic.code is Code.OUTSIDE_WORKSPACE and caught.value.diagnostic.help is not None


@pytest.mark.parametrize(("bound", "value", "words"), [("MOST_BYTES", 2_000_000, "2 MB"), ("MOST_FILES", 9, "9 files")])
def test_too_large_workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bound: str, value: int, words: str) -> None:
    here = workspace(tmp_path)
    (here / "videos").mkdir()
    (here / "videos" / "walk.mp4").write_bytes(bytes(1_990_000))
    (here / "videos" / "run.mp4").write_bytes(bytes(20_000))
    monkeypatch.setattr(workspace_archive, bound, value)
    with pytest.raises(BatchFault, match=rf"exceeds the limit of --ship \({words}\).*`videos`") as caught:
        packed(here)
    assert caught.value.diagnostic.code is Code.TOO_LARGE and "thingc.toml" in str(caught.value.diagnostic.help)


def test_document_that_changes_during_packing(tmp_path: Path) -> None:
    here = workspace(tmp_path)
    planned = plan(str(here / "sweep.yaml"))
    (here / "pendulum.yaml").write_text((here / "pendulum.yaml").read_text() + "# new\n")
    with pytest.raises(BatchFault, match="`pendulum.yaml` changed during the planning of the batch") as caught:
        pack(planned, str(here / "build" / "sweep"))
    assert caught.value.diagnostic.code is Code.BATCH_CHANGED


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is unreadable to root")
def test_unreadable_file(tmp_path: Path) -> None:
    here = workspace(tmp_path)
    (here / "secret.txt").write_text("x")
    (here / "secret.txt").chmod(0)
    with pytest.raises(BatchFault, match=r"cannot read `.*secret.txt` to ship it: permission denied"):
        packed(here)


def test_file_that_is_deleted_during_the_search(tmp_path: Path) -> None:
    here = workspace(tmp_path)
    search = workspace_archive._Search(plan(str(here / "sweep.yaml")).workspace, ())
    with pytest.raises(BatchFault, match=r"cannot read `.*draft.yaml~` to ship it: no such file"):
        search._add(str(here / "draft.yaml~"))


def test_workspace_without_a_workspace_file(tmp_path: Path) -> None:
    """If it is unpacked below another workspace, it must not become part of that workspace."""
    here = workspace(tmp_path / "robots")
    (here / "thingc.toml").unlink()
    assert plan(str(here / "sweep.yaml")).workspace.origin is None
    other = workspace(tmp_path / "other")
    packed(here).unpack(str(other / "below"))
    assert plan(str(other / "below" / "sweep.yaml")).workspace.root == str(other / "below")
    assert names(packed(here)) == DOCUMENTS


@pytest.mark.parametrize("data", [b"", b"no archive", None])
def test_damaged_archive_is_not_unpacked(tmp_path: Path, data: bytes | None) -> None:
    whole = packed(workspace(tmp_path))
    with pytest.raises(ValueError, match="damaged during the transfer"):
        replace(whole, data=whole.data[:-20] if data is None else data).unpack(str(tmp_path / "place"))
    assert not (tmp_path / "place").exists()


@pytest.mark.parametrize("kind", ["above", "absolute", "link", "device", "link and folder", "twice"])
def test_unpacking_stays_in_the_folder(tmp_path: Path, kind: str) -> None:
    """Another program has created the archive."""
    member = tarfile.TarInfo({"above": "../stolen", "absolute": str(tmp_path / "stolen")}.get(kind, kind))
    member.size = 1 if kind in ("above", "absolute") else 0
    if kind == "link":
        member.type, member.linkname = tarfile.SYMTYPE, "../../stolen"
    if kind == "device":
        member.type = tarfile.CHRTYPE
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as archive:
        archive.addfile(member, io.BytesIO(b"x"))
        if kind in ("link and folder", "twice"):
            member.type, member.linkname = tarfile.SYMTYPE, "."
            archive.addfile(member)
            archive.addfile(tarfile.TarInfo("link and folder/stolen"))
    data = stream.getvalue()
    bad = WorkspaceArchive(root="/", sha256=hashlib.sha256(data).hexdigest(), data=zlib.compress(data))
    place = tmp_path / "deep" / "work"
    with pytest.raises(ValueError, match=r"."):
        bad.unpack(str(place))
    assert list(place.iterdir()) == []
    assert {path.name for path in tmp_path.iterdir()} == {"deep"} and [path.name for path in (tmp_path / "deep").iterdir()] == ["work"]

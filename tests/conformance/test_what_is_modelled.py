"""The parts that a build creates again after an edit: the parts of a changed module and of its users, and no others."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from conformance import shelf
from conformance.harness import ROOT, build, build_here, replace, thingc, thingc_here, tree


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the workspace `ws`, its `store` with all parts, and `other` files."""
    folder = tmp_path_factory.mktemp("shelf")
    shelf.workspace(folder)
    answer = build_here("shelf.yaml", "--emit", "bom", store=folder / "store", cwd=folder / "ws")
    assert set(answer["modelled"]) == shelf.EVERYTHING and answer["reused"] == []
    return folder


def rebuilt(base: Path, folder: Path, edit: Callable[[Path], None]) -> set[str]:
    """Return the parts that are built after an edit of a copy of the workspace in another folder."""
    shutil.copytree(base / "ws", folder / "ws", ignore=shutil.ignore_patterns("build"))
    edit(folder / "ws")
    answer = build_here("shelf.yaml", "--emit", "bom", store=base / "store", cwd=folder / "ws")
    assert sorted(answer["modelled"] + answer["reused"]) == sorted(shelf.EVERYTHING), "together every part, each once"
    return set(answer["modelled"])


def coded(old: str, new: str, file: str = "shelf.py") -> Callable[[Path], None]:
    return lambda root: replace(root / "parts" / file, old, new)


def comments(root: Path) -> None:
    replace(root / "parts" / "shelf.py", "WALL = 3\n", "# thick enough\n\n\nWALL = 3  # mm\n")
    replace(root / "parts" / "shelf.py", "Box(11, 12, 13)", "Box(11,\n                            12, 13)  # a box")


def written(name: str, text: str) -> Callable[[Path], None]:
    return lambda root: None if (root / name).write_text(text) else None


SHELF = {f"shelf:{name}" for name in shelf.CODE}
CODE = {
    "a dimension": (coded("Box(11, 12, 13)", "Box(11, 12, 14)"), {"shelf:Plain"}),
    "a method that others inherit and use": (
        coded("Box(width, 10, 5)", "Box(width, 10, 6)"), {f"shelf:{name}" for name in ("Base", "Derived", "User")},
    ),
    "a constant": (coded("WALL = 3", "WALL = 4"), SHELF),
    "another module": (coded("Cylinder(radius, 8)", "Cylinder(radius, 9)", "helpers.py"), {"shelf:Helped", "knobs:Knob"}),
    "a module of its own": (coded("Sphere(5)", "Sphere(6)", "knobs.py"), {"knobs:Knob"}),
    "a module that appears, which nobody imports": (written("parts/unused.py", "import shelf\n"), set()),
    "comments and blank lines": (comments, set()),
    "JSON": (written("sizes.json", "[7, 8, 10]"), {"shelf:FromJson"}),
    "JSON that appears before the other": (written("parts/sizes.json", "[1, 2, 3]"), {"shelf:FromJson"}),
    "JSON that appears": (written("parts/wish.json", "12"), {"shelf:Optional"}),
    "a file that nobody reads": (written("unread.json", "2"), set()),
}


@pytest.mark.parametrize("case", CODE)
def test_edit(base: Path, tmp_path: Path, case: str) -> None:
    edit, expected = CODE[case]
    assert rebuilt(base, tmp_path, edit) == expected


@pytest.mark.parametrize(("file", "reader"), [("motor.step", "FromStep"), ("motor.brep", "FromBrep"), ("motor.stl", "FromStl")])
def test_geometry_file(base: Path, tmp_path: Path, file: str, reader: str) -> None:
    """The class that imports the file is built again, and the part that is the file itself."""
    changed = rebuilt(base, tmp_path, lambda root: None if shutil.copy(base / "other" / file, root / "files" / file) else None)
    assert changed == {f"shelf:{reader}", f"files/{file}"}


def test_reverted_change_builds_nothing(base: Path, tmp_path: Path) -> None:
    """`wish.json` is created and deleted again. The part without it is still in the store."""
    rebuilt(base, tmp_path, written("parts/wish.json", "13"))
    (tmp_path / "ws" / "parts" / "wish.json").unlink()
    assert build_here("shelf.yaml", "--emit", "bom", store=base / "store", cwd=tmp_path / "ws")["modelled"] == []


DOCUMENT = {
    "a limit": ("upper: 45 deg", "upper: 46 deg"),
    "a pose": ("hinge: 20 deg", "hinge: 21 deg"),
    "a mass": ("'shelf:Base',", "'shelf:Base', mass: 7 g,"),
    "a colour": ("burlywood", "navy"),
    "a place": ("xyz: 50 0 0 mm", "xyz: 51 0 0 mm"),
    "a density": ("density: 500", "density: 501"),
}


def test_edit_of_the_document_builds_no_part(base: Path, tmp_path: Path) -> None:
    shutil.copytree(base / "ws", tmp_path / "ws", ignore=shutil.ignore_patterns("build"))
    output = tmp_path / "ws" / "build" / "shelf"
    build_here("shelf.yaml", "--emit", "bom,mjcf", store=base / "store", cwd=tmp_path / "ws")
    for old, new in DOCUMENT.values():
        before = tree(output)
        replace(tmp_path / "ws" / "shelf.yaml", old, new)
        answer = build_here("shelf.yaml", "--emit", "bom,mjcf", store=base / "store", cwd=tmp_path / "ws")
        assert answer["modelled"] == [] and set(answer["reused"]) == shelf.EVERYTHING
        after = tree(output)
        assert {path for path in after if after[path] != before[path]} >= {"manifest.json", "mjcf/shelf_default.xml"}, (old, new)


def test_unchanged_build_writes_nothing(base: Path, tmp_path: Path) -> None:
    """The build is repeated directly after a cold build, and once more. The output says so, and no file is replaced."""
    def stats() -> dict[str, tuple[int, int]]:
        return {path.name: (path.stat().st_mtime_ns, path.stat().st_ino) for path in (tmp_path / "out").rglob("*")}

    shutil.copytree(base / "ws", tmp_path / "ws", ignore=shutil.ignore_patterns("build"))
    words = ("build", "shelf.yaml", "-o", tmp_path / "out")
    first = thingc_here(*words, store=tmp_path / "store", cwd=tmp_path / "ws")
    assert first.code == 0 and "15 parts modelled, 0 reused" in first.err
    left = stats()
    for _ in range(2):
        again = thingc(*words, store=tmp_path / "store", cwd=tmp_path / "ws")
        assert again.code == 0 and again.out == "" and "is up to date" in again.err
        answer = build_here(*words[1:], store=tmp_path / "store", cwd=tmp_path / "ws")
        assert answer["modelled"] == [] and set(answer["reused"]) == shelf.EVERYTHING
        assert stats() == left
    (tmp_path / "out" / "shelf" / "bom.csv").write_text("spoilt")
    build_here(*words[1:], "--force", store=tmp_path / "store", cwd=tmp_path / "ws")
    assert (tmp_path / "out" / "shelf" / "bom.csv").read_text().startswith("number,"), "what was changed by hand is mended"


@pytest.mark.slow
def test_arm_has_the_same_bytes_in_other_environments(arm: Path, tmp_path: Path) -> None:
    """Another absolute folder, another store, another order of sets and dicts, and one process. Then one dimension of one class changes."""
    home = tmp_path / "some where" / "else"
    for name in ("assemblies", "parts"):
        shutil.copytree(ROOT / name, home / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "thingc.toml", home)
    more = {"PYTHONHASHSEED": "4711", "TZ": "Asia/Tokyo"}
    seen = build("assemblies/arm.yaml", "--jobs", "1", store=tmp_path / "store", cwd=home, more=more)
    assert len(seen["modelled"]) == 9
    expected, found = tree(arm), tree(home / "build" / "arm")
    assert expected.keys() == found.keys()
    assert [path for path in expected if expected[path] != found[path]] == []
    source = home / "parts" / "arm.py"
    before, brace, after = source.read_text().partition("class RotorBrace")
    assert "1.5 * thickness" in after
    source.write_text(before + brace + after.replace("1.5 * thickness", "1.4 * thickness", 1))
    answer = build_here("assemblies/arm.yaml", store=tmp_path / "store", cwd=home)
    assert answer["modelled"] == ["arm:RotorBrace"] and len(answer["reused"]) == 8

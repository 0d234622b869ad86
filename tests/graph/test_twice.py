"""`thingc build --twice`: parts with different results are reported with the differences, and no file is written."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from graph.builder import record
from thingc.base.pose import NO_POSE
from thingc.base.primitives import Primitive
from thingc.geometry.record import ActuatorRecord, DeclaredValue, Mesh, MountExpectation, MountRecord, PartRecord
from thingc.model.assembly.inconsistent_parts import FIELDS, LEFT_OUT, differences
from thingc.tools.cli.main import main

PARTS = """\
import os
import subprocess

from build123d import Box, Pos

from thingc import MountPoint, Thing

SIZES = {"1", "22", "333", "4444", "55555", "666666", "7777777", "88888888"}


class Plain(Thing):
    def result(self):
        return Box(10, 10, len(sorted(SIZES)[2]))


class Hashed(Thing):
    def result(self):
        return Box(10, 10, [len(size) for size in SIZES].index(4) + 1)


class Holes(Thing):
    def __init__(self):
        super().__init__()
        for size in SIZES:
            setattr(self, "hole_" + size, MountPoint(Pos(len(size), 0, 0)))

    def result(self):
        return Box(10, 10, 10)


class Fails(Thing):
    def result(self):
        if os.environ["PYTHONHASHSEED"] != "0":
            raise ValueError("not this time")
        return Box(10, 10, 10)


class Asks(Thing):
    def result(self):
        return Box(10, 10, int(subprocess.run(["cat", "height.txt"], capture_output=True, check=True).stdout))
"""


@pytest.fixture
def build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> Callable[..., tuple[int, str]]:
    """Build a robot from some of the parts above. Returns the exit code and standard error."""
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["."]\n')
    (tmp_path / "odd.py").write_text(PARTS)
    monkeypatch.setenv("THINGC_STORE", str(tmp_path / "store"))
    monkeypatch.chdir(tmp_path)

    def build(*names: str, options: tuple[str, ...] = ()) -> tuple[int, str]:
        rows = "".join(
            f"  {name.lower()}: {{part: 'odd:{name}', material: petg, at: {{in: base.origin, xyz: {20 * number} 0 0 mm}}}}\n"
            for number, name in enumerate(names)
        )
        materials = "materials: {petg: {density: 1270 kg/m^3}}\n"
        (tmp_path / "robot.yaml").write_text(f"thingc: assembly/1\nname: odd\n{materials}components:\n  base: {{frame: true}}\n{rows}")
        code = main(["build", "robot.yaml", "--emit", "stl", *options])
        return code, capsys.readouterr().err

    return build


def error_messages(said: str) -> list[str]:
    return [line.removeprefix("error[TC412]: ") for line in said.splitlines() if line.startswith("error")]


def test_nondeterministic_parts_are_reported(build: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    """Parts that depend on the order of a set, or fail the second time, are named with their differences, and no file is written."""
    code, said = build("Plain", "Hashed", "Holes", "Fails", options=("--twice",))
    hashed, holes, fails = error_messages(said)
    differ = r"two builds of `odd:Hashed` differ: its volume is 0\.(\d) cm\^3 in the first build and 0\.(\d) cm\^3 in the second"
    volumes = re.fullmatch(differ, hashed)
    assert volumes is not None and volumes[1] != volumes[2]
    assert holes.startswith("two builds of `odd:Holes` differ: the order of its mounts differs: `hole_")
    assert fails == "two builds of `odd:Fails` differ: the second build failed: ValueError: not this time"
    assert (code, (tmp_path / "build").exists()) == (1, False)
    assert re.search(r"--> robot\.yaml:7:3\n.*\n.*\n  note: `odd:Hashed` is defined here\n    --> odd\.py:16:1\n", said)
    assert "also different: surface, inertia, bounding box, meshes" in said
    assert re.search(r"location in the part file\n    --> odd\.py:34:1\n", said)


def test_stale_cached_part_is_reported(build: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    """A part reads a file that changed after it was cached, so the rebuilt part differs from the cached one."""
    (tmp_path / "height.txt").write_text("3")
    assert build("Plain", "Asks")[0] == 0
    (tmp_path / "height.txt").write_text("4")
    code, said = build("Plain", "Asks")
    assert (code, "is up to date" in said) == (0, True)
    before = {path: path.read_bytes() for path in (tmp_path / "build").rglob("*") if path.is_file()}
    code, said = build("Plain", "Asks", options=("--twice",))
    differ = "two builds of `odd:Asks` differ: its volume is 0.3 cm^3 in the first build and 0.4 cm^3 in the second"
    assert (code, error_messages(said)) == (1, [differ])
    assert before == {path: path.read_bytes() for path in (tmp_path / "build").rglob("*") if path.is_file()}
    (tmp_path / "height.txt").write_text("3")
    code, said = build("Plain", "Asks", options=("--twice",))
    assert (code, "2 parts built twice, with equal results\n" in said) == (0, True)
    assert "0 parts modelled, 2 reused" in said


A_MESH = Mesh(sha256="0" * 64, size=84, vertices=4, faces=4, closed=True, flat=False)
TURNED = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
OTHERS: dict[str, tuple[Any, str]] = {
    "material": ("steel", "its material is nothing in the first build and `steel` in the second"),
    "color": ("#ff0000", "its colour is nothing in the first build and `#ff0000` in the second"),
    "volume": (1.5e-6 * (1.0 + 1e-9), "its volume is 1.5 cm^3 in the first build and 1.5000000015 cm^3 in the second"),
    "area": (2e-4, "its surface is 1 cm^2 in the first build and 2 cm^2 in the second"),
    "centre": ((0.0, 0.0, 0.002), "its centre is [0, 0, 0] mm in the first build and [0, 0, 2] mm in the second"),
    "inertia": (TURNED, "its inertia differs"),
    "box": (((0.0, 0.0, 0.0), (0.01, 0.01, 0.03)),
            "its bounding box is nothing in the first build and [0, 0, 0] mm to [10, 10, 30] mm in the second"),
    "mass": (DeclaredValue(value=0.09), "its stated mass is 0.08 kg in the first build and 0.09 kg in the second"),
    "com": (DeclaredValue(value=(0.0, 0.0, 0.0)), "its stated centre of mass differs"),
    "matrix": (DeclaredValue(value=TURNED), "its stated inertia differs"),
    "density": (DeclaredValue(value=7850.0), "its stated density differs"),
    "mounts": (dict.fromkeys("ba", MountRecord(pose=NO_POSE)),
               "the order of its mounts differs: `a`, `b` in the first build and `b`, `a` in the second"),
    "expectations": (
        (MountExpectation(mount="a", text="t", label="t", child_mount="b"),), "its expected parts of mounts differs"
    ),
    "references": (("t",), "its list of expected parts differs"),
    "actuator": (ActuatorRecord(kind="servo"), "its actuator differs"),
    "bom": ({"supplier": "A"}, "its bill of materials entries differ: `supplier`"),
    "up": ((0.0, 0.0, 1.0), "its print orientation differs"),
    "apart": ((1e-6, 5e-7), "its number or volume of its solids differs"),
    "meshes": ({"hull": A_MESH}, "its meshes differ: `hull`"),
    "pieces": ((A_MESH,), "its collision geometry differs"),
    "fits": ({"box": Primitive(shape="box", size=(1.0, 1.0, 1.0), pose=NO_POSE)}, "its smallest enclosing shapes differ: `box`"),
}
"""By field of a record: another value and the expected message."""


@pytest.fixture(scope="module")
def one() -> PartRecord:
    return replace(
        record("t"), material=None, color=None, volume=1.5e-6, area=1e-4, centre=(0.0, 0.0, 0.0), box=None, mass=DeclaredValue(value=0.08),
        mounts={name: MountRecord(pose=NO_POSE) for name in ("a", "b")}, meshes={}, fits={}, pieces=(), brep=None,
    )


@pytest.mark.parametrize("name", OTHERS)
def test_each_difference_has_its_message(name: str, one: PartRecord) -> None:
    value, words = OTHERS[name]
    assert [found.words for found in differences(one, replace(one, **{name: value}))] == [words]
    assert differences(one, replace(one)) == []


def test_all_record_fields_are_compared_or_excluded() -> None:
    assert set(OTHERS) == set(FIELDS)
    assert set(PartRecord.__struct_fields__) == set(FIELDS) | LEFT_OUT and not LEFT_OUT & set(FIELDS)

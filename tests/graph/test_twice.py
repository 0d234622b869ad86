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
    differ = r"two builds of `odd:Hashed` differ in the volume \(0\.(\d) cm\^3 and 0\.(\d) cm\^3\)"
    volumes = re.fullmatch(differ, hashed)
    assert volumes is not None and volumes[1] != volumes[2]
    assert holes.startswith("two builds of `odd:Holes` differ in the order of the mounts (`hole_")
    assert fails == "the second build of `odd:Fails` failed: ValueError: not this time"
    assert (code, (tmp_path / "build").exists()) == (1, False)
    assert re.search(r"--> robot\.yaml:7:3\n.*\n.*\n  note: `odd:Hashed` is defined here\n    --> odd\.py:16:1\n", said)
    assert "also different: surface area, inertia, bounding box, meshes" in said
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
    differ = "two builds of `odd:Asks` differ in the volume (0.3 cm^3 and 0.4 cm^3)"
    assert (code, error_messages(said)) == (1, [differ])
    assert before == {path: path.read_bytes() for path in (tmp_path / "build").rglob("*") if path.is_file()}
    (tmp_path / "height.txt").write_text("3")
    code, said = build("Plain", "Asks", options=("--twice",))
    assert (code, "2 parts built twice, with equal results\n" in said) == (0, True)
    assert "0 parts modelled, 2 reused" in said


A_MESH = Mesh(sha256="0" * 64, size=84, vertices=4, faces=4, closed=True, flat=False)
TURNED = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
OTHERS: dict[str, tuple[Any, str]] = {
    "material": ("steel", "the material (nothing and `steel`)"),
    "color": ("#ff0000", "the colour (nothing and `#ff0000`)"),
    "volume": (1.5e-6 * (1.0 + 1e-9), "the volume (1.5 cm^3 and 1.5000000015 cm^3)"),
    "area": (2e-4, "the surface area (1 cm^2 and 2 cm^2)"),
    "centre": ((0.0, 0.0, 0.002), "the centre of volume ([0, 0, 0] mm and [0, 0, 2] mm)"),
    "inertia": (TURNED, "the inertia"),
    "box": (((0.0, 0.0, 0.0), (0.01, 0.01, 0.03)),
            "the bounding box (nothing and [0, 0, 0] mm to [10, 10, 30] mm)"),
    "mass": (DeclaredValue(value=0.09), "the stated mass (0.08 kg and 0.09 kg)"),
    "com": (DeclaredValue(value=(0.0, 0.0, 0.0)), "the stated centre of mass"),
    "matrix": (DeclaredValue(value=TURNED), "the stated inertia"),
    "density": (DeclaredValue(value=7850.0), "the stated density"),
    "mounts": (dict.fromkeys("ba", MountRecord(pose=NO_POSE)),
               "the order of the mounts (`a`, `b` and `b`, `a`)"),
    "expectations": (
        (MountExpectation(mount="a", text="t", label="t", child_mount="b"),), "the expected parts of mounts"
    ),
    "references": (("t",), "the list of expected parts"),
    "actuator": (ActuatorRecord(kind="servo"), "the actuator"),
    "bom": ({"supplier": "A"}, "the bill of materials entries (`supplier`)"),
    "up": ((0.0, 0.0, 1.0), "the print orientation"),
    "apart": ((1e-6, 5e-7), "the number or volume of solids"),
    "meshes": ({"hull": A_MESH}, "the meshes (`hull`)"),
    "pieces": ((A_MESH,), "the collision geometry"),
    "fits": ({"box": Primitive(shape="box", size=(1.0, 1.0, 1.0), pose=NO_POSE)}, "the smallest enclosing shapes (`box`)"),
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

"""Importing and exporting a robot repeatedly gives the same file: everything that the exporter writes is read again."""

from __future__ import annotations

import json
import random
import re
from pathlib import Path

import pytest
from trimesh.transformations import euler_matrix

import thingc
from importing.imports import write_import
from thingc.base.diagnostics import Report, Severity
from thingc.tools.importing.importing import import_robot

ROBOTS = Path(__file__).parent / "robots"
NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e[-+]\d+)?(?![\w.])")
ANGLES = re.compile(r"(?<=rpy=\")[^\"]+|(?<=<pose>)[^<]+|(?<=\">)[^<]+(?=</pose>)")
URDF, SDF = "urdf/*_source.urdf", "sdf/*_source/model.sdf"
CASES = [
    ("constructs.urdf", URDF, 0), ("shapes.urdf", URDF, 1), ("fixed.urdf", URDF, 1),
    ("constructs.sdf", URDF, 1), ("constructs.sdf", SDF, 1),
    ("constructs.xml", URDF, 1), ("constructs.xml", SDF, 1),
    *((f"{name}.xml", f"mjcf/{name}_source.xml", 1) for name in ("cables", "constructs", "cranks", "loops", "suckers", "tendons")),
    ("world.xml", "mjcf/two_arms_source.xml", 1),
]
"""A file, the location of the built output, and the number of rounds after which nothing changes: one if shapes, meshes or a base get
new names."""


def written(source: Path, where: str, folder: Path) -> Path:
    """Import a file and return the file of a format that is built from it."""
    imported = import_robot(str(source), Report())
    assert imported is not None
    return built(write_import(imported, folder), where, folder / "out")


def built(document: Path, where: str, folder: Path) -> Path:
    """Build a document and return the file of a format."""
    said = thingc.family(document).write({}, folder, emit=[where.partition("/")[0]])
    assert not [one for one in said if one.severity is Severity.ERROR]
    (found,) = folder.glob(where)
    return found


def turned(found: re.Match[str]) -> str:
    """Replace angles by a rotation matrix: if one angle is a quarter turn, the other two are not unique."""
    *place, roll, pitch, yaw = map(float, found[0].split())
    return " ".join(f"{one:.17g}" for one in (*place, *euler_matrix(roll, pitch, yaw)[:3, :3].ravel()))


@pytest.mark.parametrize(("name", "where", "rounds"), CASES)
def test_round_trip_is_stable_after_one_round(name: str, where: str, rounds: int, tmp_path: Path) -> None:
    """The last digits of values computed from rotations may differ."""
    settled(written(ROBOTS / name, where, tmp_path / "0"), where, rounds, tmp_path)


@pytest.mark.parametrize(("mode", "where"), [
    ("urdf/gripper_bench.urdf", URDF), ("sdf/gripper_bench/model.sdf", SDF), ("mjcf/gripper_bench.xml", "mjcf/gripper_bench_source.xml"),
    ("mjcf/scene_bench.xml", "mjcf/gripper_bench_source.xml"),
])
def test_round_trip_of_a_modelled_robot_is_stable(mode: str, where: str, root: Path, tmp_path: Path) -> None:
    settled(built(root / "gallery" / "gripper" / "gripper.yaml", mode, tmp_path / "0"), where, 1, tmp_path)


def test_name_that_ends_like_a_mode_is_preserved(tmp_path: Path) -> None:
    """The header of a file identifies thingc as its writer; the name does not."""
    first = tmp_path / "robot.xml"
    first.write_text((ROBOTS / "cranks.xml").read_text().replace('model="cranks"', 'model="open_source"'))
    second = written(first, "mjcf/open_source_source.xml", tmp_path)
    imported = import_robot(str(second), Report())
    assert imported is not None and imported.name == "open_source"


def test_site_with_two_names_is_one_mount() -> None:
    """The record lists both names, and which sites are the frame of a component."""
    imported = import_robot(str(ROBOTS / "suckers.xml"), Report())
    assert imported is not None
    assert json.loads(imported.files["import.json"])["names"]["sites"] == {
        "tip": "tip", "arm/tip": "tip", "left/imu": "left_imu", "right/imu": "right_imu", "right": "right.origin",
    }


def settled(first: Path, where: str, rounds: int, folder: Path) -> None:
    """Assert that another round after `rounds` rounds changes nothing."""
    files = [first]
    for number in range(rounds + 1):
        files.append(written(files[-1], where, folder / f"{number + 1}"))
    before, after = (ANGLES.sub(turned, path.read_text().split("-->", 1)[1]) for path in files[-2:])
    assert NUMBER.sub("#", after) == NUMBER.sub("#", before)
    numbers = [[float(one) for one in NUMBER.findall(text)] for text in (before, after)]
    assert numbers[1] == pytest.approx(numbers[0], rel=1e-12, abs=1e-12)
    meshes = [sorted((path.name, path.read_bytes()) for path in file.parent.glob("*/*")) for file in files[-2:]]
    assert meshes[1] == meshes[0]


def random_robot(form: str) -> str:
    """Return a chain of six links with random poses, with all digits of a double."""
    numbers = random.Random(7)

    def some(count: int, most: float) -> str:
        return " ".join(repr(numbers.uniform(-most, most)) for _ in range(count))

    if form == "mjcf":
        bodies = "".join(
            f'<body name="b{k}" pos="{some(3, 1)}" quat="{some(4, 1)}"><joint name="j{k}" axis="0 1 0" pos="{some(3, 1)}"/>'
            f'<geom type="box" size=".1 .2 .3" mass="1" pos="{some(3, 1)}" quat="{some(4, 1)}"/><site name="s{k}" quat="{some(4, 1)}"/>'
            for k in range(6)
        )
        return f'<mujoco model="m"><worldbody>{bodies}{6 * "</body>"}</worldbody></mujoco>'
    inertia = '<inertia ixx="1" iyy="2" izz="2.5" ixy=".1" ixz=".2" iyz=".3"/>'
    links = "".join(
        f'<link name="b{k}"><inertial><origin xyz="{some(3, 1)}" rpy="{some(3, 1.5)}"/><mass value="1"/>{inertia}</inertial><visual>'
        f'<origin xyz="{some(3, 1)}" rpy="{some(3, 1.5)}"/><geometry><box size="1 2 3"/></geometry></visual></link>' for k in range(6)
    )
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><origin xyz="{some(3, 1)}" rpy="{some(3, 1.5)}"/><parent link="b{k}"/>'
        f'<child link="b{k + 1}"/><axis xyz="0 1 0"/></joint>' for k in range(5)
    )
    return f'<robot name="m">{links}{joints}</robot>'


@pytest.mark.parametrize(("form", "where"), [("mjcf", "mjcf/m_source.xml"), ("urdf", URDF), ("sdf", SDF)])
def test_round_trip_is_byte_identical_after_one_round(form: str, where: str, tmp_path: Path) -> None:
    """This includes positions and rotations, however they are computed."""
    source = tmp_path / ("m.xml" if form == "mjcf" else "m.urdf")
    source.write_text(random_robot(form))
    files = [source]
    for number in range(4):
        files.append(written(files[-1], where, tmp_path / f"{number}"))
    texts = [path.read_text().split("-->", 1)[1] for path in files[1:]]
    documents = [(tmp_path / f"{number}" / "m.yaml").read_text().split("\n", 1)[1] for number in range(4)]
    assert texts[1] == texts[2] == texts[3] and documents[1] == documents[2] == documents[3]

"""Disguised robots are recognized with their maps, and robots with a small physical change are not. MuJoCo verifies the maps."""

from __future__ import annotations

import json
import math
import random
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from same.changes import KINDS, changed
from same.study import EXACT, Subject, apart, mechanism, readable, subject, true_map
from thingc.tools.cli.main import main
from thingc.tools.same.comparison import MechanismComparison, compare_mechanisms

ROBOTS = Path(__file__).resolve().parents[1] / "importing/robots"
NAMES = ("blocks.urdf", "constructs.urdf", "constructs.xml", "cranks.xml", "floating.xml", "world.xml")
# a five-bar linkage of five different bars: four hinges in the tree, and a point where the two distal bars meet
FIVE_BAR = """
<mujoco><compiler angle="radian"/><worldbody><body name="ground">
  <inertial pos="0 0.01 0.02" mass="1" fullinertia="0.01 0.02 0.025 0.001 0 0"/>
  <body name="a" pos="0 0 0"><inertial pos="0.05 0.002 0.001" mass="0.1" fullinertia="1e-5 1e-4 1.1e-4 0 0 0"/>
    <joint name="qa" type="hinge" axis="0 0 1" range="-1 2"/>
    <body name="c" pos="0.1 0 0"><inertial pos="0.06 0 0.001" mass="0.12" fullinertia="1e-5 1e-4 1.05e-4 0 0 0"/>
      <joint name="qc" type="hinge" axis="0 0 1"/><site name="pc" pos="0.15 0 0"/></body></body>
  <body name="b" pos="0.2 0 0"><inertial pos="0.04 0.003 0" mass="0.11" fullinertia="1e-5 1.2e-4 1.25e-4 0 0 0"/>
    <joint name="qb" type="hinge" axis="0 0 1" range="-2 1"/>
    <body name="d" pos="0.11 0 0"><inertial pos="0.07 0.001 0" mass="0.13" fullinertia="2e-5 1e-4 1.1e-4 0 0 0"/>
      <joint name="qd" type="hinge" axis="0 0 1"/><site name="pd" pos="0.16 0 0"/></body></body>
</body></worldbody><equality><connect site1="pc" site2="pd"/></equality></mujoco>
"""
# a gripper with two equal fingers, which a half turn about z exchanges
GRIPPER = """
<robot name="gripper">
  <link name="palm"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  {fingers}
</robot>
"""
FINGER = """
  <link name="{name}"><inertial><origin xyz="0.01 0 0.05"/><mass value="0.1"/>
    <inertia ixx="1e-4" iyy="2e-4" izz="2.5e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="j_{name}" type="prismatic"><parent link="palm"/><child link="{name}"/><origin xyz="{x} 0 0" rpy="0 0 {yaw}"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.03" effort="1" velocity="1"/></joint>
"""
WHEEL = """
<robot name="cart">
  <link name="body"><inertial><origin xyz="0.01 0.02 0.03"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.025" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="wheel"><inertial><mass value="0.2"/><inertia ixx="1e-3" iyy="2e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="spin" type="{kind}"><parent link="body"/><child link="wheel"/><origin xyz="0 0.1 0" rpy="0 {pitch} 0"/>
    <axis xyz="0 1 0"/><limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/></joint>
</robot>
"""


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Subject]:
    found = {}
    for name in (*NAMES, "five_bar.xml"):
        folder = tmp_path_factory.mktemp("robot")
        (folder / "five_bar.xml").write_text(FIVE_BAR)
        found[name] = subject(folder / name if name == "five_bar.xml" else ROBOTS / name, folder)
    return found


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    yield tmp_path


@pytest.mark.parametrize("seed", [0])  # `make same` draws a thousand
@pytest.mark.parametrize("name", [*NAMES, "five_bar.xml"])
def test_disguised_robot_is_recognized_with_its_map(robots: dict[str, Subject], name: str, seed: int, tmp_path: Path) -> None:
    robot, draw = robots[name], random.Random(f"{name} {seed}")
    disguise, _, model, other = readable(robot.graph, tmp_path, draw)
    assert compare_mechanisms(robot.original, other).same
    found = compare_mechanisms(robot.written, other)
    assert found.same and found.limits == found.properties == ()
    assert apart(robot, disguise, model, found, draw) < EXACT
    assert true_map(disguise, found) or found.maps > 1
    assert max(found.residual or (1.0,)) < EXACT


CHANGES = [*((name, kind) for name in ("constructs.xml", "cranks.xml", "five_bar.xml") for kind in KINDS if kind != "coupling")]
CHANGES.append(("constructs.xml", "coupling"))  # the others have none


@pytest.mark.parametrize(("name", "kind"), CHANGES)
def test_physical_change_is_found(robots: dict[str, Subject], name: str, kind: str, tmp_path: Path) -> None:
    """A change of 1e-4 of one property, in a disguised robot, is reported as a difference of that property."""
    robot, draw = robots[name], random.Random(f"{name} {kind}")
    new = changed(robot.graph, draw, kind)
    assert new is not None
    found = compare_mechanisms(robot.written, readable(new, tmp_path, draw)[3])
    assert not found.same
    assert found.differences
    assert {"position": "axis position", "angle": "axis angle"}.get(kind, kind) in [one.what for one in found.differences]
    if kind in ("mass", "inertia", "coupling"):
        assert [one.what for one in found.differences] == [kind]
        assert found.differences[0].by is None or 0.5e-4 < found.differences[0].by < 1.001e-4


def gripper(path: Path, first: str, second: str) -> Path:
    fingers = FINGER.format(name=first, x=0.02, yaw=0) + FINGER.format(name=second, x=-0.02, yaw=3.141592653589793)
    path.write_text(GRIPPER.format(fingers=fingers))
    return path


def test_symmetric_robot_is_ambiguous_and_keeps_names(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two assignments are possible. The one with equal names is selected."""
    gripper(here / "a.urdf", "left", "right")
    gripper(here / "b.urdf", "right", "left")
    assert main(["same", "a.urdf", "b.urdf"]) == 0
    text = capsys.readouterr().out
    assert "ambiguous: 2 assignments" in text
    assert "names:" not in text
    found = compare_mechanisms(mechanism(here / "a.urdf"), mechanism(here / "b.urdf"))
    assert (found.maps, found.assignments) == (2, 2)
    assert {one.one: one.other for one in found.joints} == {"j_left": "j_left", "j_right": "j_right"}


@pytest.mark.parametrize(("count", "complete"), [(3, True), (5, False)])
def test_equal_fingers_at_one_place_are_counted(here: Path, count: int, complete: bool) -> None:
    (here / "a.urdf").write_text(GRIPPER.format(fingers="".join(FINGER.format(name=f"f{n}", x=0.02, yaw=0) for n in range(count))))
    found = compare_mechanisms(*2 * [mechanism(here / "a.urdf")])
    assert found.same and found.complete == complete
    assert found.maps == found.assignments == 6 if complete else 6 < found.assignments <= 64


def test_coupling_resolves_symmetric_fingers(here: Path) -> None:
    def coupled(name: str, leader: str, follower: str, multiplier: float, offset: float = 0.0) -> Path:
        path = gripper(here / name, "left", "right")
        mimic = f'<mimic joint="j_{leader}" multiplier="{multiplier}" offset="{offset}"/></joint>'
        head, _, tail = path.read_text().partition(f'<joint name="j_{follower}"')
        path.write_text(f'{head}<joint name="j_{follower}"{tail.replace("</joint>", mimic, 1)}')
        return path

    one, other = mechanism(coupled("a.urdf", "left", "right", 0.5)), mechanism(coupled("b.urdf", "right", "left", 0.5))
    found = compare_mechanisms(one, other)
    assert found.same
    assert {one.one: one.other for one in found.joints} == {"j_left": "j_right", "j_right": "j_left"}
    shifted = mechanism(coupled("a.urdf", "left", "right", 0.5, 0.01))
    inverse = compare_mechanisms(shifted, mechanism(coupled("c.urdf", "right", "left", 2.0, -0.02)))
    assert inverse.same and {one.one: one.other for one in inverse.joints} == {"j_left": "j_left", "j_right": "j_right"}
    changed = compare_mechanisms(one, mechanism(coupled("d.urdf", "right", "left", 2.0002)))
    assert [(one.what, one.one, one.other, one.old, one.new) for one in changed.differences] == [
        ("coupling", "j_right", "j_right", ("j_left", 0.0, 0.5), ("j_left", 0.0, pytest.approx(1.0 / 2.0002))),
    ]
    assert not compare_mechanisms(one, mechanism(gripper(here / "e.urdf", "left", "right"))).same


def test_wheel_zero_follows_from_limits(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing else determines the zero of a rotationally symmetric wheel."""
    def cart(name: str, kind: str, lower: float, upper: float, pitch: float = 0.0) -> Path:
        (here / name).write_text(WHEEL.format(kind=kind, lower=lower, upper=upper, pitch=pitch))
        return here / name

    one = mechanism(cart("a.urdf", "revolute", -1.0, 1.0))
    moved = compare_mechanisms(one, mechanism(cart("b.urdf", "revolute", -0.75, 1.25)))
    assert moved.same and moved.limits == ()
    assert (moved.joints[0].zero, moved.joints[0].determined) == (pytest.approx(0.25), False)
    turned = compare_mechanisms(one, mechanism(cart("b.urdf", "revolute", 5.0, 7.0)))
    assert turned.same and turned.limits == () and turned.joints[0].zero == pytest.approx(6.0)
    wider = compare_mechanisms(one, mechanism(cart("c.urdf", "revolute", -1.5, 1.5)))
    assert wider.same
    assert [(limit.old, limit.new) for limit in wider.limits] == [((-1.0, 1.0), (-1.5, 1.5))]
    free = compare_mechanisms(one, mechanism(cart("d.urdf", "continuous", 0.0, 0.0, pitch=0.5)))
    assert free.same and free.joints[0].zero == 0.0
    assert main(["same", "a.urdf", "c.urdf"]) == 0
    assert "limits of spin: -57.2958 deg, 57.2958 deg -> -85.9437 deg, 85.9437 deg" in capsys.readouterr().out


def test_different_joints_and_arrangements_are_reported(robots: dict[str, Subject], here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "a.xml").write_text(FIVE_BAR)
    (here / "b.xml").write_text(FIVE_BAR[: FIVE_BAR.index("<equality>")] + "</mujoco>")
    on_ground = FIVE_BAR.replace('<body name="c"', '</body><body name="c"').replace('"0.15 0 0"/></body></body>', '"0.15 0 0"/></body>')
    (here / "c.xml").write_text(on_ground)
    (here / "d.xml").write_text(FIVE_BAR.replace('<body name="b" pos="0.2 0 0">', '<body name="b" pos="0.2 0 0.5" euler="1 0 0">'))
    lines = {
        "b.xml": ["joints: 1 ball, 4 rotation -> 4 rotation"],
        "c.xml": ["arrangement: the links and joints of the two robots cannot be matched"],
        "d.xml": ["direction of the axis of qb: differs by 57.3 deg", "position of the axis of qb: differs by 270 mm"],
    }
    for name, expected in lines.items():
        assert main(["same", "a.xml", name]) == 1
        assert capsys.readouterr().out.splitlines()[1:][: len(expected)] == [f"  {line}" for line in expected]


def test_mirror_image_is_a_different_robot(robots: dict[str, Subject], here: Path) -> None:
    source = robots["five_bar.xml"]
    assert not compare_mechanisms(source.written, robots["cranks.xml"].written).same
    mirrored = FIVE_BAR.replace('pos="0.05 0.002 0.001"', 'pos="0.05 0.002 -0.001"')
    (here / "mirror.xml").write_text(mirrored)
    found = compare_mechanisms(source.original, mechanism(here / "mirror.xml"))
    assert [(one.what, one.one, one.by) for one in found.differences] == [("centre", "a", pytest.approx(0.002))]


DOCUMENT = """
thingc: assembly/1
name: crane
components:
  mast:
    frame: true
    mass: {value: 2 kg, source: measured}
    com: 10 0 200 mm
    inertia: {ixx: 1e-2 kg*m^2, iyy: 1e-2 kg*m^2, izz: 5e-3 kg*m^2}
    mounts: {head: {xyz: 0 0 500 mm, rpy: 90 0 0 deg}}
  boom:
    frame: true
    mass: {value: 300 g, source: measured}
    com: 200 10 5 mm
    inertia: {ixx: 1e-4 kg*m^2, iyy: 4e-3 kg*m^2, izz: 4e-3 kg*m^2}
    mounts: {heel: {rpy: 90 0 0 deg}}
joints:
  luff: {type: universal, parent: mast.head, child: boom.heel}
modes:
  stand: {root: mast, base: fixed}
"""


def test_documents_builds_and_revisions_are_compared(here: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    document = here / "crane.yaml"
    document.write_text(DOCUMENT)
    for words in (["init", "-q"], ["add", "."], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "first"]):
        subprocess.run(["git", *words], check=True)
    document.write_text(DOCUMENT.replace("root: mast", "root: boom").replace("  boom:", "  jib:").replace("boom", "jib"))
    assert main(["build", "crane.yaml", "--emit", "urdf,mjcf", "--store", shared_store]) == 0
    capsys.readouterr()
    assert main(["same", "crane.yaml", "build/crane"]) == 0
    assert main(["same", "build/crane", "build/crane/mjcf/crane_stand.xml"]) == 0
    assert main(["same", "HEAD", "crane.yaml", "--store", shared_store]) == 0
    assert "the same mechanism" in capsys.readouterr().out
    assert main(["same", "HEAD", "--format", "json", "--", "crane.yaml"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["old"], found["new"]) == ("HEAD", "working tree")
    assert [one["other"] for one in found["comparisons"][0]["links"]][:2] == ["mast", "jib"]
    document.write_text(DOCUMENT.replace("300 g", "450 g"))
    assert main(["same", "HEAD", "crane.yaml", "--store", shared_store]) == 1
    out = capsys.readouterr().out
    assert "mass of boom: 0.3 kg -> 0.45 kg (differs by 50 %)" in out and "mass within 50 %, centre of mass" in out


PAIR = """
<robot name="pair">
  <link name="body"><inertial><origin xyz="0.01 0.02 0.03"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.025" ixy="0" ixz="0" iyz="0"/></inertial></link>
  {wheels}
</robot>
"""
SIDE = """
  <link name="{name}"><inertial><mass value="0.2"/><inertia ixx="1e-3" iyy="2e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="spin_{name}" type="continuous"><parent link="{on}"/><child link="{name}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/></joint>
"""


@pytest.mark.parametrize(("right", "by"), [
    ("0 -0.1 0.001", 0.001),  # no longer on the line of the left axis, which is nearer than its old place
    ("0.3 -0.1 0.4", 0.5),
])
def test_moved_wheel_is_identified(here: Path, right: str, by: float) -> None:
    for name, xyz in (("a.urdf", "0 -0.1 0"), ("b.urdf", right)):
        wheels = ((one, "body", place, "0 1 0") for one, place in (("left", "0 0.1 0"), ("right", xyz)))
        (here / name).write_text(PAIR.format(wheels=wheels_xml(*wheels)))
    found = compare_mechanisms(mechanism(here / "a.urdf"), mechanism(here / "b.urdf"))
    assert [(one.what, one.one, one.other) for one in found.differences] == [("axis position", "spin_right", "spin_right")]
    assert found.differences[0].by == pytest.approx(by)


def test_shift_along_a_joint_axis_is_reported(here: Path) -> None:
    for name, xyz in (("a.urdf", "0 0.1 0"), ("b.urdf", "0 0.11 0")):
        wheels = (("left", "body", xyz, "0 1 0"), ("right", "left", "0.2 0.1 0", "1 0 0"), ("rear", "body", "0 0.3 0.1", "1 0 0"))
        (here / name).write_text(PAIR.format(wheels=wheels_xml(*wheels)))
    found = compare_mechanisms(mechanism(here / "a.urdf"), mechanism(here / "b.urdf"))
    assert [(one.what, one.one, one.by) for one in found.differences] == [("axis position", "spin_left", pytest.approx(0.01))]


def wheels_xml(*wheels: tuple[str, str, str, str]) -> str:
    return "".join(SIDE.format(name=name, on=on, xyz=xyz, axis=axis) for name, on, xyz, axis in wheels)


def test_changed_masses_keep_the_joint_map(here: Path) -> None:
    (here / "a.xml").write_text(FIVE_BAR)
    other = FIVE_BAR.replace('pos="0 0.01 0.02"', 'pos="0.3 0.01 0.02"').replace('mass="', 'mass="1')
    twice = re.sub(r'fullinertia="(.*?)"', lambda found: f'fullinertia="{" ".join(str(2 * float(x)) for x in found[1].split())}"', other)
    (here / "b.xml").write_text(twice)
    found = compare_mechanisms(mechanism(here / "a.xml"), mechanism(here / "b.xml"))
    assert {one.one: one.other for one in found.joints} == {name: name for name in ("qa", "qb", "qc", "qd", found.joints[-1].one)}
    assert {one.what for one in found.differences} == {"mass", "inertia", "centre"}
    assert [(one.one, one.by) for one in found.differences if one.what == "centre"] == [("ground", pytest.approx(0.3))]


def commit(message: str) -> None:
    for words in (["add", "."], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", message]):
        subprocess.run(["git", *words], check=True)


@pytest.mark.parametrize("command", ["same", "diff"])
def test_revisions_of_a_robot_file_are_compared(here: Path, shared_store: str, capsys: pytest.CaptureFixture[str], command: str) -> None:
    subprocess.run(["git", "init", "-q"], check=True)
    (here / "pkg/mjcf").mkdir(parents=True)
    (here / "pkg/package.xml").write_text("<package><name>pkg</name></package>")
    (here / "pkg/mjcf/robot.xml").write_text('<mujoco><include file="../bodies.xml"/></mujoco>')
    bodies = here / "pkg/bodies.xml"
    bodies.write_text(FIVE_BAR)
    commit("first")
    bodies.write_text(FIVE_BAR.replace('mass="0.12"', 'mass="0.13"'))
    commit("second")
    bodies.write_text(FIVE_BAR.replace('mass="0.12"', 'mass="0.14"'))
    end = [] if command == "same" else ["--no-tests", "--fail-on", "mass"]
    for words, old, new in (
        (["HEAD~1..HEAD", "--", "pkg/mjcf/robot.xml"], 0.12, 0.13), (["HEAD~1", "pkg/mjcf/robot.xml"], 0.12, 0.14),
        (["pkg/mjcf/robot.xml"], 0.13, 0.14), (["HEAD", "--", "pkg/mjcf/robot.xml"], 0.13, 0.14),
    ):
        at = words.index("--") if "--" in words else len(words)
        assert main([command, *words[:at], "--store", shared_store, *end, *words[at:]]) == 1, words
        out = capsys.readouterr().out
        assert f"{old} kg -> {new} kg" in out or f"{1000 * old:g} g -> {1000 * new:g} g" in out
        assert "robot.xml" in out and "thingc-diff-" not in out
    assert main(["diff", "HEAD", "pkg/mjcf/robot.xml", "--no-code"]) == 2
    assert "cannot compare robot files" in capsys.readouterr().err


def test_revision_with_meshes_of_another_package(here: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    subprocess.run(["git", "init", "-q"], check=True)
    for name in ("pkg", "other"):
        (here / name).mkdir()
        (here / name / "package.xml").write_text(f"<package><name>{name}</name></package>")
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]])
    facets = [points[[*face]] for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))]
    corners = ["\n".join(f"vertex {x} {y} {z}" for x, y, z in facet) for facet in facets]
    text = "\n".join(f"facet normal 0 0 0\nouter loop\n{three}\nendloop\nendfacet" for three in corners)
    (here / "other/part.stl").write_text(f"solid part\n{text}\nendsolid part\n")
    mesh = '<visual><geometry><mesh filename="package://other/part.stl"/></geometry></visual></link>'
    cart = WHEEL.format(kind="continuous", lower=0, upper=0, pitch=0).replace("</link>", mesh, 1)
    (here / "pkg/cart.urdf").write_text(cart)
    commit("first")
    (here / "pkg/cart.urdf").write_text(cart.replace('mass value="0.2"', 'mass value="0.25"'))
    assert main(["diff", "pkg/cart.urdf", "--store", shared_store]) == 0
    assert "200 g -> 250 g (+25 %)" in capsys.readouterr().out


def test_options_for_robot_files(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "a.urdf").write_text(WHEEL.format(kind="continuous", lower=0, upper=0, pitch=0).replace('iyy="2e-3"', 'iyy="2.1e-3"'))
    (here / "b.urdf").write_text((here / "a.urdf").read_text().replace('"2.1e-3"', '"2e-3"'))
    assert main(["same", "a.urdf", "b.urdf"]) == 1
    assert "--repair inertia=nearest" in capsys.readouterr().out
    assert main(["same", "a.urdf", "a.urdf", "--repair", "inertia=nearest"]) == 0
    assert main(["same", "a.urdf", "b.urdf", "--repair", "inertia=nearest"]) == 1
    out = capsys.readouterr().out
    assert "inertia of wheel: differs by" in out and "a.urdf and b.urdf are different mechanisms" in out


PROPERTIES = {"effort": 3.0, "velocity": 2.0, "damping": 0.1, "friction": 0.2, "armature": 0.01, "stiffness": 5.0}


def test_changed_properties_of_joints_are_reported(here: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A change of 1e-4 of any property is reported in the new coordinate, and a property that only one robot specifies is not."""
    def crane(name: str, lower: float, upper: float, rest: float, values: dict[str, float], more: str = "") -> Path:
        e, v, d, f, a, s = (f"{key}: {value}" for key, value in values.items())
        joint = (
            f"type: revolute, {more}limit: {{lower: {lower} rad, upper: {upper} rad, {e} N*m, {v} rad/s}}, "
            f"dynamics: {{{d} N*m*s/rad, {f} N*m, {a} kg*m^2, {s} N*m/rad, rest: {rest} rad}},"
        )
        (here / name).write_text(DOCUMENT.replace("type: universal,", joint))
        return here / name

    one = mechanism(crane("a.yaml", -1.0, 0.5, 0.25, PROPERTIES))
    reversed_joint = compare_mechanisms(one, mechanism(crane("b.yaml", -0.5, 1.0, -0.25, PROPERTIES, "reverse: true, ")))
    assert reversed_joint.same and reversed_joint.joints[0].sign == -1 and reversed_joint.limits == reversed_joint.properties == ()
    for what, value in PROPERTIES.items():
        new = value * 1.0001
        found = compare_mechanisms(one, mechanism(crane("b.yaml", -0.5, 1.0, -0.25, PROPERTIES | {what: new}, "reverse: true, ")))
        assert found.same
        assert [(one.what, one.old, one.new) for one in found.properties] == [(what, pytest.approx(value), pytest.approx(new))]
    found = compare_mechanisms(one, mechanism(crane("b.yaml", -0.5, 1.0001, -0.2501, PROPERTIES, "reverse: true, ")))
    assert [(one.what, one.old, one.new) for one in (*found.limits, *found.properties)] == [
        ("limits", pytest.approx((-0.5, 1.0)), pytest.approx((-0.5, 1.0001))), ("rest", pytest.approx(-0.25), pytest.approx(-0.2501)),
    ]
    crane("b.yaml", -1.0, 0.5, 0.25, PROPERTIES | {"effort": 3.0003})
    assert main(["same", "a.yaml", "b.yaml", "--store", shared_store]) == 0
    out = capsys.readouterr().out
    assert out.startswith("b.yaml: the same mechanism\n")
    assert "  effort of luff: 3 N*m -> 3.0003 N*m\n" in out
    (here / "b.yaml").write_text(DOCUMENT.replace("type: universal,", "type: revolute, limit: {lower: -1 rad, upper: 0.5 rad},"))
    assert main(["same", "a.yaml", "b.yaml", "--store", shared_store]) == 0


def test_screw_zero_includes_the_travel(here: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A rotation by 30 deg with its travel of 3 mm is only another zero. Without the travel, it is a difference."""
    screw = DOCUMENT.replace("type: universal,", "type: screw, lead: 36 mm, limit: {lower: -1 rad, upper: 1 rad},")
    (here / "a.yaml").write_text(screw)
    (here / "d.yaml").write_text(screw.replace("lead: 36 mm", "lead: 37 mm"))
    screw = screw.replace("lower: -1 rad, upper: 1 rad", f"lower: {math.pi / 6 - 1} rad, upper: {math.pi / 6 + 1} rad")
    # a turn by 30 deg, with and without the travel of 3 mm that belongs to it
    (here / "b.yaml").write_text(screw.replace("head: {xyz: 0 0 500 mm, rpy: 90 0 0 deg}", "head: {xyz: 0 3 500 mm, rpy: 90 30 0 deg}"))
    (here / "c.yaml").write_text(screw.replace("head: {xyz: 0 0 500 mm, rpy: 90 0 0 deg}", "head: {xyz: 0 0 500 mm, rpy: 90 30 0 deg}"))
    assert main(["same", "a.yaml", "b.yaml", "--store", shared_store]) == 0
    assert "zeros: luff +30 deg" in capsys.readouterr().out
    assert main(["same", "a.yaml", "c.yaml", "--store", shared_store]) == 1
    assert main(["same", "a.yaml", "d.yaml", "--store", shared_store]) == 1
    assert "lead of luff: differs by 0.159 mm" in capsys.readouterr().out
    assert main(["build", "a.yaml", "--emit", "mjcf", "--store", shared_store]) == 0
    assert main(["same", "b.yaml", "build/crane", "--store", shared_store]) == 0


def test_diff_reports_the_same_mechanism_first(here: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    revolute = DOCUMENT.replace("type: universal", "type: continuous")
    (here / "a.yaml").write_text(revolute)
    (here / "b.yaml").write_text(revolute.replace("{heel: {rpy: 90 0 0 deg}}", "{heel: {rpy: 90 30 0 deg}}"))
    (here / "c.yaml").write_text(revolute.replace("200 10 5 mm", "200 11 5 mm"))
    line = "the same mechanism; zeros: luff +30 deg"
    assert main(["diff", "a.yaml", "b.yaml", "--store", shared_store]) == 0
    assert f"\n  {line}\n" in capsys.readouterr().out
    assert main(["diff", "a.yaml", "b.yaml", "--store", shared_store, "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["same_mechanism"] == {"b.yaml": line}
    assert main(["diff", "a.yaml", "c.yaml", "--store", shared_store, "--format", "json"]) == 0
    assert "same_mechanism" not in json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(("words", "code", "message"), [
    (["a.urdf", "missing.urdf"], 2, "is not a file, a folder or a revision"),
    (["a.urdf"], 2, "`HEAD` is not a file, a folder or a revision"),
    (["a.urdf", "parts.lock.json"], 2, "cannot be compared"),
    (["a.urdf", "broken.urdf"], 1, "error"),
    (["a.urdf", "a.urdf", "--tolerance", "1"], 2, "--tolerance"),
    (["a.urdf", "a.urdf", "--repair", "mass=nearest"], 2, "expected `inertia=nearest` or `inertia=shapes`"),
])
def test_invalid_input_is_reported(here: Path, words: list[str], code: int, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    gripper(here / "a.urdf", "left", "right")
    (here / "broken.urdf").write_text("<robot name='x'><link name='a'></robot>")
    (here / "parts.lock.json").write_text("{}")
    assert main(["same", *words]) == code
    out, err = capsys.readouterr()
    assert message in out + err


def test_reversed_wheel_has_reversed_limits(here: Path) -> None:
    for name, axis, lower, upper in (("a.urdf", 1, -1.0, 0.5), ("b.urdf", -1, -0.3, 1.2)):
        (here / name).write_text(WHEEL.format(kind="revolute", lower=lower, upper=upper, pitch=0).replace('"0 1 0"', f'"0 {axis} 0"'))
    found = compare_mechanisms(mechanism(here / "a.urdf"), mechanism(here / "b.urdf"))
    assert found.same and found.limits == found.properties == ()
    assert (found.joints[0].sign, found.joints[0].zero) == (-1, pytest.approx(0.2))


def test_loop_closing_point_is_compared(robots: dict[str, Subject], here: Path) -> None:
    (here / "moved.xml").write_text(FIVE_BAR.replace('name="pd" pos="0.16 0 0"', 'name="pd" pos="0.1601 0 0"'))
    found = compare_mechanisms(robots["five_bar.xml"].original, mechanism(here / "moved.xml"))
    assert [(one.what, one.by) for one in found.differences] == [("axis position", pytest.approx(1e-4))]


LOOP = """
thingc: assembly/1
name: four_bar
components:
  ground:
    frame: true
    mass: {value: 1 kg, source: measured}
    inertia: {ixx: 1e-2 kg*m^2, iyy: 1.1e-2 kg*m^2, izz: 5e-3 kg*m^2}
    mounts: {a: {xyz: 0 0 0 mm}, d: {xyz: 100 0 0 mm}}
  crank:
    frame: true
    mass: {value: 100 g, source: measured}
    com: 20 3 0 mm
    inertia: {ixx: 1e-5 kg*m^2, iyy: 4e-5 kg*m^2, izz: 4.5e-5 kg*m^2}
    mounts: {a: {xyz: 0 0 0 mm}, b: {xyz: 40 0 0 mm}}
  rod:
    frame: true
    mass: {value: 110 g, source: measured}
    com: 40 2 0 mm
    inertia: {ixx: 1e-5 kg*m^2, iyy: 4e-5 kg*m^2, izz: 4.5e-5 kg*m^2}
    mounts: {b: {xyz: 0 0 0 mm}, c: {xyz: 80 0 0 mm}}
  rocker:
    frame: true
    mass: {value: 120 g, source: measured}
    com: 30 1 0 mm
    inertia: {ixx: 1e-5 kg*m^2, iyy: 4e-5 kg*m^2, izz: 4.5e-5 kg*m^2}
    mounts: {d: {xyz: 0 0 0 mm}, c: {xyz: 70 0 0 mm}}
joints:
  qa: {type: continuous, parent: ground.a, child: crank.a}
  qb: {type: continuous, parent: crank.b, child: rod.b}
  qd: {type: continuous, parent: ground.d, child: rocker.d}
  qc: {type: continuous, parent: rod.c, child: rocker.c, loop: true}
modes:
  stand: {root: ground, base: fixed}
"""


def test_loop_may_be_cut_at_another_joint(here: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    other = LOOP.replace("child: rod.b}", "child: rod.b, loop: true}").replace("child: rocker.c, loop: true}", "child: rocker.c}")
    other = other.replace("parent: rod.c, child: rocker.c}", "parent: rocker.c, child: rod.c}")
    (here / "a.yaml").write_text(LOOP)
    (here / "b.yaml").write_text(other)
    (here / "c.yaml").write_text(other.replace("c: {xyz: 70 0 0 mm}", "c: {xyz: 70 0 0.1 mm}"))
    assert main(["same", "a.yaml", "b.yaml", "--store", shared_store, "--format", "json"]) == 0
    joints = json.loads(capsys.readouterr().out)["comparisons"][0]["joints"]
    # exchanging parent and child reverses the axis, because mated z axes are opposite, and the motion
    assert {one["one"]: (one["other"], one["sign"], round(one["zero"], 9)) for one in joints} == {
        name: (name, 1, 0.0) for name in ("qa", "qb", "qc", "qd")
    }
    assert main(["build", "a.yaml", "--emit", "mjcf", "--store", shared_store]) == 0
    assert main(["same", "a.yaml", "build/four_bar", "--store", shared_store]) == 0
    assert main(["same", "b.yaml", "build/four_bar", "--store", shared_store]) == 0
    assert main(["same", "a.yaml", "c.yaml", "--store", shared_store]) == 1


def test_loop_hinge_is_two_connects_in_mjcf(here: Path, shared_store: str) -> None:
    """MuJoCo has no hinge that closes a loop. The connected points may be any two points of the axis."""
    (here / "a.yaml").write_text(LOOP.replace("c: {xyz: 70 0 0 mm}", "c: {xyz: 70 0 0 mm, rpy: 0 0 30 deg}"))
    original = mechanism(here / "a.yaml")
    assert main(["build", "a.yaml", "--emit", "mjcf", "--store", shared_store]) == 0
    xml = (here / "build/four_bar/mjcf/four_bar_stand.xml").read_text()
    def compared(*replacements: tuple[str, str]) -> MechanismComparison:
        text = xml
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new)
        (here / "other.xml").write_text(text)
        return compare_mechanisms(original, mechanism(here / "other.xml"))

    found = compared()
    assert found.same and (found.joints[-1].sign, found.joints[-1].zero) == (1, pytest.approx(0.0))
    assert compared(("0.08 0 0.04", "0.08 0 0.1"), ("0.07 0 -0.04", "0.07 0 -0.1")).same
    exchanged = 'site1="qc:parent" site2="qc:child"', 'site1="qc:child" site2="qc:parent"'
    assert compared(("0.08 0 0.04", "0.08 0 -0.1"), ("0.07 0 -0.04", "0.07 0 0.1"), exchanged).same
    moved = compared(("0.08 0 0", "0.0801 0 0"))
    assert [(one.what, one.by) for one in moved.differences] == [("axis position", pytest.approx(1e-4))]
    tilted = compared(("0.08 0 0.04", "0.080004 0 0.04"))  # by 1e-4 rad
    assert [(one.what, one.by) for one in tilted.differences] == [("axis angle", pytest.approx(1e-4))]
    assert compared(("0.07 0 -0.04", "0.07 0 -0.0399")).differences[0].new == "2 ball, 3 rotation"  # no pose closes both


def test_links_fixed_by_a_loop_are_one_link(here: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    rod = LOOP[LOOP.index("  rod:") : LOOP.index("  rocker:")]
    halves = """
  right:
    frame: true
    mass: {value: 50 g, source: measured}
    com: -20 3 1 mm
    inertia: {ixx: 1e-5 kg*m^2, iyy: 2e-5 kg*m^2, izz: 2.5e-5 kg*m^2}
    mounts: {m: {rpy: 180 0 -90 deg}, c: {xyz: 0 0 0 mm}}
  left:
    frame: true
    mass: {value: 60 g, source: measured}
    com: 20 2 0 mm
    inertia: {ixx: 1e-5 kg*m^2, iyy: 2e-5 kg*m^2, izz: 2.5e-5 kg*m^2}
    mounts: {b: {xyz: 0 0 0 mm}, m: {xyz: 80 0 0 mm}}
"""
    masses, centres = np.array([0.06, 0.05]), np.array([[0.02, 0.002, 0.0], [0.06, 0.003, 0.001]])
    centre = masses @ centres / masses.sum()
    total = 2.0 * np.diag([1e-5, 2e-5, 2.5e-5])
    for mass, away in zip(masses, centres - centre, strict=True):
        total += mass * (away @ away * np.eye(3) - np.outer(away, away))
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    entries = zip(names, ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)), strict=True)
    inertia = ", ".join(f"{name}: {float(total[entry])!r} kg*m^2" for name, entry in entries)
    whole = f"""
  rod:
    frame: true
    mass: {{value: 110 g, source: measured}}
    com: {" ".join(repr(1000.0 * float(x)) for x in centre)} mm
    inertia: {{{inertia}}}
    mounts: {{b: {{xyz: 0 0 0 mm}}, c: {{xyz: 80 0 0 mm}}}}
"""
    (here / "whole.yaml").write_text(LOOP.replace(rod, whole.lstrip("\n")))
    joints = LOOP.replace(rod, halves.lstrip("\n"))
    joints = joints.replace("parent: ground.a, child: crank.a", "parent: crank.a, child: ground.a")
    joints = joints.replace("parent: crank.b, child: rod.b", "parent: left.b, child: crank.b")
    joints = joints.replace("parent: rod.c, child: rocker.c, loop: true}", "parent: rocker.c, child: right.c}")
    (here / "halves.yaml").write_text(joints.replace("modes:", "  m: {type: fixed, parent: left.m, child: right.m, loop: true}\nmodes:"))
    assert main(["same", "whole.yaml", "halves.yaml", "--store", shared_store]) == 0, capsys.readouterr()

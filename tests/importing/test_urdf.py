"""URDF as used in practice: materials, versions 1.1 and 1.2, unknown limits, encodings, Windows paths and free bases."""

from __future__ import annotations

import codecs
import re
from pathlib import Path

import mujoco
import pytest

import thingc
from importing.imports import write_import
from thingc import Compiled
from thingc.base.diagnostics import Report
from thingc.tools.importing.importing import Imported, import_robot

WEIGHT = '<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
MATERIALS = """<robot name="r">
  <material name="red"><color rgba="1 0 0 1"/></material>
  <link name="base">
    <visual><geometry><box size="1 1 1"/></geometry><material name="blue"><color rgba="0 0 1 1"/></material></visual>
    <visual><geometry><box size="2 1 1"/></geometry><material name="red"><color rgba="0 1 0 1"/></material></visual>
    <visual><geometry><box size="3 1 1"/></geometry><material name="blue"/></visual>
    <visual><geometry><box size="4 1 1"/></geometry><material name="blu"/></visual>
    <visual><geometry><box size="5 1 1"/></geometry><material name="blu"/></visual>
    <visual><geometry><box size="6 1 1"/></geometry><material name="a"><color rgba="0 1 1 1"/></material><material name="red"/></visual>
    <visual><geometry><box size="7 1 1"/></geometry><material name="later"/></visual>
    <visual><geometry><box size="8 1 1"/></geometry><material name=""><color rgba="1 1 0 1"/></material></visual>
    <visual><geometry><box size="9 1 1"/></geometry><material name="later"><color rgba="1 0 1 1"/></material></visual>
  </link>
</robot>"""


def imported(text: str | bytes, folder: Path) -> tuple[Imported, Report]:
    """Import a file with this content."""
    path, report = folder / "r.urdf", Report()
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    found = import_robot(str(path), report)
    assert found is not None, report.diagnostics
    return found, report


def compiled(robot: Imported, folder: Path) -> Compiled:
    """Compile the document of an import."""
    found = thingc.compile(write_import(robot, folder))
    assert found.diagnostics == ()
    return found


def test_first_material_definition_is_used_as_in_urdfdom(tmp_path: Path) -> None:
    robot, report = imported(MATERIALS, tmp_path)
    document = robot.files["r.yaml"].decode()
    colors = dict(re.findall(r'box: (\d)000 .*?(?:color: "#(.*?)")?}', document))
    expected = {"1": "0000ff", "2": "ff0000", "3": "0000ff", "6": "00ffff", "7": "ff00ff", "8": "ffff00", "9": "ff00ff"}
    assert colors == {**expected, "4": "", "5": ""}
    assert [(one.what, one.where.line) for one in robot.losses] == [
        ("the colour of material `red`", 5), ("material `blu`", 7), ("a second `<material>` of a `<visual>`", 9),
    ]
    (warning,) = report.diagnostics
    assert (warning.code.name, warning.span.line, warning.help) == ("SOURCE_DOUBT", 7, "did you mean `blue`?")


def hinge(origin: str, limit: str = 'effort="2" velocity="3"', kind: str = "revolute") -> str:
    """Return a robot with one joint."""
    return (
        f'<robot name="r" version="1.2">\n<link name="base">{WEIGHT}</link><link name="arm">{WEIGHT}'
        '<collision><geometry><capsule radius="0.05" length="0.2"/></geometry></collision></link>\n'
        f'<joint name="hinge" type="{kind}"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.1" {origin}/>'
        f'<axis xyz="0 0 1"/>\n<limit lower="-1" upper="1" {limit}/></joint></robot>'
    )


@pytest.mark.parametrize("quaternion", ["0.70710678 0 0 0.70710678", "2 0 0 2", "-1e-3 0 0 -1e-3"])
def test_quaternion_equals_its_angles(quaternion: str, tmp_path: Path) -> None:
    robot, _ = imported(hinge(f'quat_xyzw="{quaternion}"'), tmp_path)
    document = robot.files["r.yaml"].decode()
    assert "hinge: {xyz: 0 0 100 mm, rpy: 90 0 0 deg}" in document and robot.losses == ()
    model = compiled(robot, tmp_path).modes["source"].model()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert data.xaxis[0] == pytest.approx([0.0, -1.0, 0.0]), "z, turned by 90 degrees about x"
    (geom,) = (k for k in range(model.ngeom) if model.geom_contype[k])
    assert model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE and model.geom_size[geom][:2] == pytest.approx([0.05, 0.1])


@pytest.mark.parametrize(("origin", "said"), [
    ('quat_xyzw="0 0 0 0"', "the quaternion of a pose must not be 0 0 0 0"),
    ('quat_xyzw="0 0 1"', "`quat_xyzw` of `<origin>`: expected 4 numbers separated by spaces, found 3"),
    ('rpy="0 0 0" quat_xyzw="0 0 0 1"', "`<origin>` has both `rpy` and `quat_xyzw`"),
])
def test_invalid_quaternions_are_reported(origin: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(hinge(origin))
    report = Report()
    assert import_robot(str(tmp_path / "r.urdf"), report) is None
    assert [(one.message, one.span.line) for one in report.diagnostics if one.span is not None] == [(said, 3)]


@pytest.mark.parametrize("elsewhere", ["", '<transmission name="t"><joint name="hinge"/></transmission>'])
def test_all_zero_limits_are_unknown(elsewhere: str, tmp_path: Path) -> None:
    text = hinge("", 'effort="0" velocity="0"').replace("</robot>", f"{elsewhere}</robot>")
    robot, report = imported(text, tmp_path)
    document = robot.files["r.yaml"].decode()
    assert "limit: {lower: -1 rad, upper: 1 rad}\n" in document and ("drive:" in document) == bool(elsewhere)
    assert [one.where.line for one in robot.losses] == [4] and [one.span.line for one in report.diagnostics if one.span] == [4]
    robot, report = imported(hinge("", 'effort="0" velocity="3"'), tmp_path)
    assert robot.losses == () and report.diagnostics == [], "a joint that turns freely, but not too fast"
    robot, _ = imported(hinge("", 'effort="2" velocity="1e9"'), tmp_path)
    assert "limit: {lower: -1 rad, upper: 1 rad}\n" in robot.files["r.yaml"].decode(), "1e9 is written for an unlimited joint"


@pytest.mark.parametrize(("encoding", "mark"), [
    ("ISO-8859-1", b""), ("windows-1252", b""), ("Shift_JIS", b""), ("GB18030", b""), ("UTF-8", codecs.BOM_UTF8),
    ("UTF-16LE", codecs.BOM_UTF16_LE),
])
def test_declared_encodings_are_decoded(encoding: str, mark: bytes, tmp_path: Path) -> None:
    name = "グリッパ" if encoding in ("Shift_JIS", "GB18030") else "Fuß"
    declared = encoding[:6] if encoding.startswith("UTF-16") else encoding
    text = f'<?xml version="1.0" encoding="{declared}"?><robot name="r"><link name="{name}" x="1"/></robot>'
    robot, _ = imported(mark + text.encode(encoding), tmp_path)
    assert [link.name for link in robot.robot.links] == [name]
    column = robot.losses[0].where.column
    assert "UTF-16" in encoding or column == text.index("<link") + 1 + len(mark[:1])


@pytest.mark.parametrize(("text", "said", "line"), [
    (b'<?xml version="1.0" encoding="Shift_JIS"?>\n<robot>\n<link name="\x81"/></robot>', "'shift_jis' codec can't decode byte", 3),
    (b'<?xml version="1.0" encoding="klingon"?><robot name="r"/>', "unknown encoding: klingon", 1),
    (b'<?xml version="1.0" encoding="punycode"?><robot name="r"/>', "unknown encoding", 1),
    (b'<?xml version="1.0" encoding="rot13"?><robot name="r"/>', "'rot13' is not a text encoding", 1),
])
def test_undecodable_files_are_reported(text: bytes, said: str, line: int, tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_bytes(text)
    report = Report()
    assert import_robot(str(tmp_path / "r.urdf"), report) is None
    (fault,) = report.diagnostics
    assert fault.message.startswith(f"cannot decode the file: {said}") and fault.span is not None and fault.span.line == line


def test_windows_path_gets_a_hint(tmp_path: Path) -> None:
    text = f'<robot name="r"><link name="a">{WEIGHT}<visual><geometry><mesh filename="meshes\\a.stl"/></geometry></visual></link></robot>'
    (tmp_path / "r.urdf").write_text(text)
    report = Report()
    assert import_robot(str(tmp_path / "r.urdf"), report) is None
    assert [one.help for one in report.diagnostics] == ["write `/` between folders: `meshes/a.stl`"]


def cube(library: str) -> str:
    """Return a closed OBJ file that refers to a material library."""
    corners = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
    faces = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    return f"mtllib {library}\n{corners}usemtl paint\n" + "".join(f"f {' '.join(map(str, face))}\n" for face in faces)


def test_mesh_material_libraries_are_copied(tmp_path: Path) -> None:
    for folder, color in (("a", "1 0 0"), ("b", "0 0 1")):
        (tmp_path / "meshes" / folder).mkdir(parents=True)
        (tmp_path / "meshes" / folder / "paint.mtl").write_text(f"newmtl paint\nKd {color}\n")
    (tmp_path / "meshes" / "a" / "one.obj").write_text(cube("paint.mtl"))
    (tmp_path / "meshes" / "b" / "two.obj").write_text(cube("paint.mtl").replace("v 1", "v 2"))
    (tmp_path / "meshes" / "b" / "three.obj").write_text(cube("gone.mtl").replace("v 1", "v 3"))
    shapes = "".join(
        f'\n<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        for name in ("meshes/a/one.obj", "meshes/b/two.obj", "meshes/b/three.obj")
    )
    robot, report = imported(f'<robot name="r"><link name="a">{WEIGHT}{shapes}</link></robot>', tmp_path)
    assert robot.files["meshes/paint.mtl"] == b"newmtl paint\nKd 1 0 0\n" and "meshes/gone.mtl" not in robot.files
    assert [(one.where.line, one.why) for one in robot.losses] == [
        (3, "another mesh has a different `paint.mtl`"), (4, "`gone.mtl` cannot be read"),
    ]
    (tmp_path / "out").mkdir()
    model = compiled(robot, tmp_path / "out").modes["source"].model()
    assert any(tuple(rgba) == pytest.approx((1, 0, 0, 1), abs=0.01) for rgba in (*model.mat_rgba, *model.geom_rgba))


@pytest.mark.parametrize("base", ["free", "fixed"])
def test_base_of_an_exported_urdf_round_trips(base: str, tmp_path: Path) -> None:
    robot, _ = imported(hinge(""), tmp_path)
    document = robot.files["r.yaml"].decode().replace("base: fixed", f"base: {base}")
    (tmp_path / "r.yaml").write_text(document)
    assert not thingc.family(tmp_path / "r.yaml").write({}, tmp_path / "out", emit=["urdf"])
    again, _ = imported((tmp_path / "out" / "urdf" / "r_source.urdf").read_bytes(), tmp_path)
    assert again.robot.base == base and f"base: {base}" in again.files["r.yaml"].decode()
    assert [one.what for one in again.losses] == ["`<option>` of `<mujoco>`"]


@pytest.mark.parametrize(("inside", "link"), [(WEIGHT, "b"), ("<visual><geometry><box size='1 1 1'/></geometry></visual>", "b"), ("", "a")])
@pytest.mark.parametrize("kind", ["imu", "camera"])
def test_sensor_of_an_empty_frame_moves_to_its_link(kind: str, inside: str, link: str, tmp_path: Path) -> None:
    """A sensor on a link with mass or shapes stays on that link."""
    text = f"""<robot name="r"><link name="a">{WEIGHT}</link><link name="b">{inside}</link>
      <joint name="j" type="fixed"><parent link="a"/><child link="b"/><origin xyz="0.1 0 0"/></joint>
      <gazebo reference="b"><sensor name="s" type="{kind}"><pose>0 0.2 0 0 0 0</pose></sensor></gazebo></robot>"""
    (sensor,) = (robot := imported(text, tmp_path)[0].robot).sensors
    sites = {site.name: (one.name, site.pose) for one in robot.links for site in one.sites}
    held, pose = (sensor.link, sensor.pose) if sensor.site is None else sites[sensor.site]
    assert held == link and pose.translation == pytest.approx((0.1 if link == "a" else 0.0, 0.2, 0.0))

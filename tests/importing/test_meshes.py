"""Meshes are copied unchanged, deduplicated by content, and have the unit and scale that MuJoCo uses."""

from __future__ import annotations

import json
import re
from pathlib import Path

import mujoco
import numpy
import pytest
import trimesh

import thingc
from importing.imports import write_import
from thingc.base.diagnostics import Report
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import import_robot

ROBOT = """<robot name="meshes">
  <link name="base">
    <inertial><mass value="2"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>
    <visual><origin xyz="0.1 0 0" rpy="0.3 0.2 0.1"/><geometry><mesh filename="package://bot/meshes/a/part.stl"/></geometry></visual>
    <collision><geometry><mesh filename="package://bot/meshes/b/part.stl" scale="0.001 0.001 0.001"/></geometry></collision>
    <visual><origin xyz="0 0.5 0"/><geometry><mesh filename="../meshes/c/copy.stl" scale="1 -2 3"/></geometry></visual>
  </link>
</robot>"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """Return the file of a robot with chiral wedges as meshes: two have the same name, and two the same content."""
    corners = numpy.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0.05, 0.02, 0.1]])
    wedge = trimesh.convex.convex_hull(corners)
    for name, scale in (("a/part", 1.0), ("b/part", 500.0), ("c/copy", 1.0)):
        path = tmp_path / "bot" / "meshes" / f"{name}.stl"
        path.parent.mkdir(parents=True)
        path.write_bytes(trimesh.exchange.stl.export_stl(wedge.copy().apply_scale(scale)))
    path = tmp_path / "bot" / "urdf" / "meshes.urdf"
    path.parent.mkdir()
    path.write_text(ROBOT)
    return path


def boxes(model: mujoco.MjModel) -> list[tuple[bool, list[list[float]], list[float]]]:
    """Return for every mesh geom whether it collides, the corners of its bounding box in the world, and its middle vertex."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = []
    for k in range(model.ngeom):
        mesh = model.geom_dataid[k]
        at, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        points = model.mesh_vert[at : at + count] @ data.geom_xmat[k].reshape(3, 3).T + data.geom_xpos[k]
        box = numpy.round([points.min(0), points.max(0)], 6).tolist()
        found.append((bool(model.geom_contype[k]), box, points.mean(0).round(6).tolist()))
    return sorted(found)


def test_imported_meshes_have_the_same_pose(robot: Path, tmp_path: Path) -> None:
    report = Report()
    imported = import_robot(str(robot), report)
    assert imported is not None and report.diagnostics == [] and imported.losses == ()
    assert [name for name in imported.files if name.startswith("meshes/")] == ["meshes/part.stl", "meshes/part_2.stl"]
    assert sorted(json.loads(imported.files["import.json"])["meshes"]) == ["meshes/part.stl", "meshes/part_2.stl"]
    assert imported.files["meshes/part.stl"] == (robot.parents[1] / "meshes" / "a" / "part.stl").read_bytes()
    text = imported.files["meshes.yaml"].decode()
    assert "- {mesh: meshes/part.stl, unit: m, at: {xyz: 100 0 0 mm, rpy: 0.3 0.2 0.1 rad}, for: visual}" in text
    assert "- {mesh: meshes/part_2.stl, unit: mm, for: collision}" in text
    assert "- {mesh: meshes/part.stl, unit: m, scale: [1, -2, 3], at: {xyz: 0 500 0 mm}, for: visual}" in text
    ours = thingc.compile(write_import(imported, tmp_path / "out")).modes["source"].model()
    folder = robot.parents[1] / "meshes"
    given = {f"{name.replace('/', '_')}.stl": (folder / f"{name}.stl").read_bytes() for name in ("a/part", "b/part", "c/copy")}
    plain = re.sub(r'filename="[^"]*/(\w)/(\w+).stl"', r'filename="\1_\2.stl"', ROBOT)
    extension = '<mujoco><compiler fusestatic="false" discardvisual="false" strippath="false"/></mujoco></robot>'
    theirs = mujoco.MjModel.from_xml_string(plain.replace("</robot>", extension), given)
    for one, other in zip(boxes(ours), boxes(theirs), strict=True):
        assert one[0] == other[0]
        assert numpy.allclose(one[1], other[1], atol=1e-5) and numpy.allclose(one[2], other[2], atol=1e-5)


def test_missing_meshes_are_errors_or_omitted(robot: Path) -> None:
    (robot.parents[1] / "meshes" / "c" / "copy.stl").unlink()
    robot.write_text(robot.read_text().replace("package://bot/meshes/b/part.stl", "package://lamp/part.abc"))
    report = Report()
    assert import_robot(str(robot), report) is None
    found = report.sorted_diagnostics()
    said = [(d.code.code, d.span.line, *d.message.partition(" (searched: ")[::2]) for d in found if d.span is not None]
    assert [one[:3] for one in said] == [
        ("TC956", 5, "`package://lamp/part.abc` is not a supported mesh: `.stl`, `.obj`, `.dae`, `.ply`, `.glb`"),
        ("TC956", 6, "there is no file `../meshes/c/copy.stl`"),
    ]
    assert said[1][3].endswith("/bot/meshes/c/copy.stl`)")
    report = Report()
    imported = import_robot(str(robot), report, ImportRequest(meshes=False))
    assert imported is not None and [(loss.what, loss.where.line) for loss in imported.losses] == [
        ("mesh `package://bot/meshes/a/part.stl`", 4), ("mesh `package://lamp/part.abc`", 5), ("mesh `../meshes/c/copy.stl`", 6),
    ]
    assert "frame: true" in imported.files["meshes.yaml"].decode()


def stl(scale: float, *, open_: bool = False) -> bytes:
    """Return a box of 0.3 x 0.2 x 0.1 m about (0.1, 0, 0), optionally without one triangle."""
    box = trimesh.creation.box((0.3, 0.2, 0.1)).apply_translation((0.1, 0.0, 0.0)).apply_scale(scale)
    if open_:
        box.update_faces(numpy.arange(len(box.faces)) > 0)
    return bytes(trimesh.exchange.stl.export_stl(box))


def arm(tmp_path: Path, data: bytes, *, mesh: str = 'filename="part.stl"', inertia: str = "") -> tuple[Path, Report]:
    (tmp_path / "part.stl").write_bytes(data)
    path = tmp_path / "arm.urdf"
    path.write_text(f"""<robot name="arm"><link name="base"/>
      <link name="arm"><inertial><mass value="6"/>{inertia}</inertial><visual><geometry><sphere radius="1"/></geometry></visual>
        <collision><origin xyz="0 0 0.5" rpy="0 0 1.5707963267948966"/><geometry><mesh {mesh}/></geometry></collision></link>
      <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.1"/></joint></robot>""")
    return path, Report()


def test_shapes_repair_uses_meshes(tmp_path: Path) -> None:
    """A box of 6 kg, by the textbook: m/12 (b^2 + c^2), rotated by a quarter turn about z."""
    path, report = arm(tmp_path, stl(1000.0), mesh='filename="part.stl" scale="0.001 0.001 0.001"')
    imported = import_robot(str(path), report, ImportRequest(repair="shapes"))
    assert imported is not None and report.diagnostics == []
    new = json.loads(imported.files["import.json"])["repaired"][0]["new"]
    assert new["mass"] == 6.0 and numpy.allclose(new["com"], [0.0, 0.1, 0.5])
    assert numpy.allclose(new["inertia"], numpy.diag([0.05, 0.025, 0.065]), rtol=1e-6)
    text = imported.files["arm.yaml"].decode()
    assert "    mass: 6 kg\n" in text and re.search(r"    inertia: \{value: \{ixx: 0\.0\d+ kg\*m\^2, .*\}, source: repaired\}\n", text)
    (tmp_path / "arm.yaml").write_text(text)
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "part.stl").write_bytes(stl(1000.0))
    compiled = thingc.compile(tmp_path / "arm.yaml")
    assert compiled.modes and compiled.diagnostics == ()


def test_open_mesh_cannot_repair_an_inertia(tmp_path: Path) -> None:
    path, report = arm(tmp_path, stl(1.0, open_=True))
    assert import_robot(str(path), report, ImportRequest(repair="shapes")) is None
    help = "use `--repair inertia=nearest` for links without closed shapes"
    assert report.diagnostics[0].help == help


@pytest.mark.parametrize(("data", "said"), [
    (b"", "`part.stl` is empty"), (b"x" * 50, "`part.stl` is truncated: expected at least 84 bytes, found 50"),
    (stl(1.0)[:-30], "`part.stl` is truncated: expected 12 triangles, found bytes for 11.4"),
])
def test_truncated_meshes_are_reported_at_their_reference(data: bytes, said: str, tmp_path: Path) -> None:
    path, report = arm(tmp_path, data, inertia='<inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/>')
    assert import_robot(str(path), report) is None
    assert [(d.code.code, d.span.line, d.message) for d in report.diagnostics if d.span is not None] == [("TC956", 3, said)]


def test_mesh_in_millimetres_read_as_metres_is_a_warning(tmp_path: Path) -> None:
    inertia = '<inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/>'
    far = "the size of `part.stl` (250 m) is implausible for joints at distances of at most 0.1 m"
    for scale, said in ((1.0, []), (1000.0, [far])):
        path, report = arm(tmp_path, stl(scale), inertia=inertia)
        assert import_robot(str(path), report) is not None
        assert [(d.code.code, d.message) for d in report.diagnostics] == [("TC955", message) for message in said]
    assert report.diagnostics[0].span is not None and report.diagnostics[0].span.line == 3

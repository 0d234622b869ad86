"""File references of robot files are resolved as in ROS and Gazebo, and files outside the robot's packages are not copied."""

from __future__ import annotations

import os
from pathlib import Path

import mujoco
import pytest

import thingc
from thingc.base.diagnostics import Report
from thingc.tools.cli.main import main
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import Imported, import_robot
from thingc.tools.importing.packages import NotFound, Packages

SOLID = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def ground(tmp_path: Path) -> Path:
    """Return a folder with a package `arm` that has a robot and a mesh, with meshes of other packages, and with files outside every
    package."""
    names = (
        "arm/urdf/arm.urdf", "arm/meshes/link.stl", "hand_description/meshes/hand.stl", "hand_description/model.config",
        "ros/gripper/a.stl", "ament/share/eye/a.stl", "elsewhere/tool/a.stl", "secret.stl",
    )
    for name in names:
        path = tmp_path / "ws" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    (tmp_path / "ws" / "arm" / "package.xml").write_text("<package><name>the_arm</name></package>")
    (tmp_path / "ws" / "arm" / "meshes" / "link_to_secret.stl").symlink_to(tmp_path / "ws" / "secret.stl")
    return tmp_path / "ws"


def packages(ground: Path, given: dict[str, str] | None = None, roots: tuple[str, ...] = ()) -> Packages:
    environment = {"ROS_PACKAGE_PATH": f"{ground / 'nowhere'}:{ground / 'ros'}", "AMENT_PREFIX_PATH": str(ground / "ament")}
    return Packages(str(ground / "arm" / "urdf" / "arm.urdf"), given or {}, environment, roots)


@pytest.mark.parametrize(("uri", "found"), [
    ("../meshes/link.stl", "arm/meshes/link.stl"),
    ("package://arm/meshes/link.stl", "arm/meshes/link.stl"),
    ("package:///arm/meshes/link.stl", "arm/meshes/link.stl"),
    ("package:///arm.urdf", "arm/urdf/arm.urdf"),
    ("package://the_arm/meshes/link.stl", "arm/meshes/link.stl"),
    ("model://hand_description/meshes/hand.stl", "hand_description/meshes/hand.stl"),
    ("package://gripper/a.stl", "ros/gripper/a.stl"),
    ("package://eye/a.stl", "ament/share/eye/a.stl"),
    ("package://tool/a.stl", "elsewhere/tool/a.stl"),
])
def test_uri_is_resolved(ground: Path, uri: str, found: str) -> None:
    assert packages(ground, {"tool": str(ground / "elsewhere" / "tool")}).find(uri) == str(ground / found)


@pytest.mark.parametrize("uri", [
    "../../secret.stl", "/etc/hostname", "{ws}/secret.stl", "file://{ws}/secret.stl", "file://localhost{ws}/secret.stl", "package://{ws}/secret.stl",
    "model://{ws}/secret.stl", "package://../../secret.stl", "model://../../secret.stl", "package://ws/secret.stl",
    "package://arm/../secret.stl", "package://elsewhere/tool/a.stl", "../meshes/link_to_secret.stl", "package://arm/meshes/link_to_secret.stl",
])
def test_file_outside_every_package_is_refused(ground: Path, uri: str) -> None:
    with pytest.raises(NotFound) as fault:
        packages(ground).find(uri.format(ws=ground))
    assert "--mesh-root DIR" in (fault.value.help or "") or "--package" in (fault.value.help or "")
    roots = (str(ground), "/etc")
    assert os.path.isfile(packages(ground, roots=roots).find(uri.format(ws=ground)))


@pytest.mark.parametrize(("uri", "found"), [
    ("../../../gone/elsewhere/tool/a.stl", "elsewhere/tool/a.stl"), ("package://gone/tool/a.stl", "elsewhere/tool/a.stl"),
    ("../x/gripper/a.stl", "ros/gripper/a.stl"), ("C:/parts/secret.stl", "secret.stl"),
])
def test_missing_file_is_found_by_the_end_of_its_path(ground: Path, uri: str, found: str) -> None:
    roots = tuple(str(ground / one) for one in ("elsewhere", "ros", "."))
    assert packages(ground, roots=roots).find(uri) == str(ground / found)


def test_given_package_name_is_found_inside_a_path(ground: Path) -> None:
    given = {"menagerie": str(ground / "elsewhere")}
    assert packages(ground, given).find("../../../menagerie/tool/a.stl") == str(ground / "elsewhere" / "tool" / "a.stl")


@pytest.mark.parametrize("folder", ["robot", "robot/urdf"])
def test_robot_folder_is_the_package_if_there_is_no_manifest(tmp_path: Path, folder: str) -> None:
    """If the robot is in a folder `urdf`, its parent folder counts."""
    for name in ("robot/urdf/a.urdf", "robot/meshes/a.stl", "secret.stl"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    found = Packages(str(tmp_path / folder / "a.urdf"), {}, {})
    assert found.find(f"file://{tmp_path}/robot/meshes/a.stl")
    with pytest.raises(NotFound, match="is outside the robot's folder"):
        found.find(f"file://{tmp_path}/secret.stl")


URDF = """<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><geometry><mesh filename="{uri}"/></geometry></visual></link></robot>"""
SDF = """<sdf version="1.9"><model name="r"><link name="a">
<visual name="v"><geometry><mesh><uri>{uri}</uri></mesh></geometry></visual></link>
</model></sdf>"""
MJCF = """<mujoco model="r"><compiler meshdir="{folder}"/><asset><mesh name="m" file="{file}"/></asset><worldbody><body name="a">
<freejoint/><geom type="mesh" mesh="m" density="100"/><geom size=".1" mass="2"/></body></worldbody></mujoco>"""
INCLUDING = """<mujoco model="r"><worldbody><include file="{uri}"/></worldbody></mujoco>"""


@pytest.mark.parametrize(("name", "text"), [
    ("r.urdf", URDF), ("r.sdf", SDF), ("r.xml", MJCF), ("included.xml", INCLUDING),
])
@pytest.mark.parametrize("uri", ["file://{other}/m.obj", "../other/m.obj", "m.obj"])
def test_no_format_copies_files_from_outside(tmp_path: Path, name: str, text: str, uri: str) -> None:
    (tmp_path / "robot").mkdir()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "m.obj").write_text(SOLID if text != INCLUDING else "<mujoco><body name='a'><geom size='1'/></body></mujoco>")
    (tmp_path / "robot" / "m.obj").symlink_to(tmp_path / "other" / "m.obj")
    uri = uri.format(other=tmp_path / "other")
    folder, _, file = uri.rpartition("/")
    (tmp_path / "robot" / name).write_text(text.format(uri=uri, folder=folder, file=file))

    def read(**options: object) -> tuple[Imported | None, Report]:
        report = Report()
        return import_robot(str(tmp_path / "robot" / name), report, ImportRequest(**options)), report  # type: ignore[arg-type]

    imported, report = read()
    assert imported is None and [one.code.code for one in report.diagnostics] == ["TC956"]
    assert "--mesh-root DIR" in (report.diagnostics[0].help or "")
    imported, report = read(mesh_roots=[str(tmp_path / "other")])
    assert imported is not None and not report.failed
    assert imported.files.get("meshes/m.obj", SOLID.encode()) == SOLID.encode()


def test_mjcf_without_meshes(tmp_path: Path) -> None:
    """The mass of a missing mesh is omitted and listed as a loss; the mass of an existing mesh is used."""
    (tmp_path / "r.xml").write_text(MJCF.format(folder="../gone", file="m.obj"))
    for there, mass in ((False, 2.0), (True, 2.0 + 100.0 / 6.0)):
        if there:
            (tmp_path / "m.obj").write_text(SOLID)
            (tmp_path / "r.xml").write_text(MJCF.format(folder="", file="m.obj"))
        imported = import_robot(str(tmp_path / "r.xml"), Report(), ImportRequest(meshes=False))
        assert imported is not None and not [name for name in imported.files if name.startswith("meshes/")]
        assert imported.robot.links[0].weight is not None
        assert imported.robot.links[0].weight.properties.mass == pytest.approx(mass, rel=1e-6)
        assert ("the mass of mesh `m`" in [loss.what for loss in imported.losses]) is not there


def test_mesh_root_option(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "robot").mkdir()
    (tmp_path / "parts").mkdir()
    (tmp_path / "robot" / "r.urdf").write_text(URDF.format(uri="../../gone/parts/m.obj"))
    (tmp_path / "parts" / "m.obj").write_text(SOLID)
    monkeypatch.chdir(tmp_path)
    assert main(["import", "robot/r.urdf", "--mesh-root", "nowhere"]) == 2
    assert main(["import", "robot/r.urdf", "--mesh-root", "parts"]) == 0
    model = thingc.compile("r/r.yaml").modes["source"].model()
    assert isinstance(model, mujoco.MjModel) and model.nmesh == 1


@pytest.mark.parametrize(("uri", "said"), [
    ("../../secret.stl", "`../../secret.stl` is outside the robot's folder (`"),
    ("package://arm/meshes/none.stl", "the package `arm` does not contain `meshes/none.stl` (searched: "),
    ("package:///none.stl", "there is no file `package:///none.stl` (searched: "),
    ("package://..", "`package://..` is outside the robot's folder"),
    ("package://lamp/a.stl", "there is no package `lamp` (searched: "),
    ("../meshes", "`../meshes` is not a file"),
    ("../meshes/none.stl", "there is no file `../meshes/none.stl` (searched: "),
    ("https://example.org/a.stl", "`https://example.org/a.stl` is not a local file"),
])
def test_missing_files_are_reported(ground: Path, uri: str, said: str) -> None:
    with pytest.raises(NotFound, match="^") as fault:
        packages(ground).find(uri)
    assert str(fault.value).startswith(said)
    if "lamp" in uri:
        assert fault.value.help == "specify the folder of the package: `--package lamp=DIR`" and "arm/urdf/lamp" in str(fault.value)


def test_given_package_folder_takes_precedence(ground: Path) -> None:
    with pytest.raises(NotFound, match="the package `arm` does not contain"):
        packages(ground, {"arm": str(ground / "elsewhere")}).find("package://arm/meshes/link.stl")


def test_too_large_file_is_refused(ground: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thingc.tools.importing.packages.MOST_BYTES", 5)
    with pytest.raises(NotFound, match="exceeds the maximum \\(5 bytes\\)"):
        packages(ground).find("../meshes/link.stl")

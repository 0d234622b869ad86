"""Files that a robot names are found where ROS finds them, and nowhere else; what was looked for is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from thingc.importing.packages import NotFound, Packages


@pytest.fixture
def ground(tmp_path: Path) -> Path:
    """A package `arm` with a robot and a mesh; meshes of others, and what nobody may read."""
    names = (
        "arm/urdf/arm.urdf", "arm/meshes/link.stl", "hand_description/meshes/hand.stl", "ros/gripper/a.stl", "ament/share/eye/a.stl",
        "elsewhere/tool/a.stl", "secret.stl",
    )
    for name in names:
        path = tmp_path / "ws" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    (tmp_path / "ws" / "arm" / "package.xml").write_text("<package><name>the_arm</name></package>")
    return tmp_path / "ws"


def packages(ground: Path, given: dict[str, str] | None = None) -> Packages:
    environment = {"ROS_PACKAGE_PATH": f"{ground / 'nowhere'}:{ground / 'ros'}", "AMENT_PREFIX_PATH": str(ground / "ament")}
    return Packages(str(ground / "arm" / "urdf" / "arm.urdf"), given or {}, environment)


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
def test_where_it_is(ground: Path, uri: str, found: str) -> None:
    assert packages(ground, {"tool": str(ground / "elsewhere" / "tool")}).find(uri) == str(ground / found)


def test_a_file_by_its_whole_path(ground: Path) -> None:
    assert packages(ground).find(f"file://{ground / 'secret.stl'}") == str(ground / "secret.stl")


@pytest.mark.parametrize(("uri", "said"), [
    ("../../secret.stl", "`../../secret.stl` leads out of the robot's folder"),
    ("/etc/passwd", "`/etc/passwd` leads out of the robot's folder"),
    ("package://arm/../secret.stl", "`package://arm/../secret.stl` leads out of its package"),
    ("package://arm/meshes/none.stl", "the package `arm` has no `meshes/none.stl`; looked in"),
    ("package:///none.stl", "there is no file `none.stl`; looked for"),
    ("package://..", "`..` leads out of the robot's folder"),
    ("package://lamp/a.stl", "there is no package `lamp`; looked for"),
    ("../meshes", "`../meshes` is no file"),
    ("../meshes/none.stl", "there is no file `../meshes/none.stl`; looked for"),
    ("https://example.org/a.stl", "`https://example.org/a.stl` is no file of this machine"),
])
def test_what_is_not_there(ground: Path, uri: str, said: str) -> None:
    with pytest.raises(NotFound, match="^") as fault:
        packages(ground).find(uri)
    assert str(fault.value).startswith(said)
    if "lamp" in uri:
        assert fault.value.help == "say where it is: `--package lamp=DIR`" and "arm/urdf/lamp" in str(fault.value)


def test_what_is_given_goes_first_and_alone(ground: Path) -> None:
    with pytest.raises(NotFound, match="the package `arm` has no"):
        packages(ground, {"arm": str(ground / "elsewhere")}).find("package://arm/meshes/link.stl")


def test_too_large(ground: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thingc.importing.packages.MOST_BYTES", 5)
    with pytest.raises(NotFound, match="and 5 are read at most"):
        packages(ground).find("../meshes/link.stl")

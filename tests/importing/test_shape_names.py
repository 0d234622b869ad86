"""Visuals and collisions of an imported URDF or SDF file keep their names in built files, or import.json lists the new names."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

import thingc
from importing.imports import write_import
from thingc.base.diagnostics import Report
from thingc.tools.importing.importing import import_robot

BOX, BALL = '<geometry><box size="1 1 1"/></geometry>', '<geometry><sphere radius="0.3"/></geometry>'
URDF = f"""<robot name="r">
  <link name="base">
    <inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <visual name="chassis_look">{BOX}</visual><collision name="chassis">{BOX}</collision>
    <visual name="both">{BALL}</visual><collision name="both">{BALL}</collision>
    <collision name="bumper col">{BALL.replace("0.3", "0.4")}</collision>
    <visual>{BOX.replace("1 1 1", "1 2 1")}</visual>
    <visual name="twice">{BOX.replace("1 1 1", "1 3 1")}</visual>
  </link>
  <link name="arm">
    <inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <visual name="twice">{BOX}</visual>
  </link>
  <joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>
</robot>"""


def names(file: Path) -> dict[str, list[str]]:
    """Return the names of visuals and collisions of a URDF or SDF file."""
    root = ElementTree.parse(file).getroot()
    return {tag: [one.attrib["name"] for one in root.iter(tag)] for tag in ("visual", "collision")}


def imported(source: Path, folder: Path) -> dict[str, str]:
    """Import a file into the folder and return the shape names listed in `import.json`."""
    found = import_robot(str(source), Report())
    assert found is not None
    write_import(found, folder)
    geoms: dict[str, str] = json.loads(found.files["import.json"])["names"].get("geoms", {})
    return geoms


def built(folder: Path, emit: str) -> Path:
    assert thingc.family(folder / "r.yaml").write({}, folder / "out", emit=[emit]) == ()
    (file,) = (folder / "out").glob("urdf/*.urdf" if emit == "urdf" else "sdf/*/model.sdf")
    return file


@pytest.mark.parametrize("emit", ["urdf", "sdf"])
def test_shapes_keep_their_names(emit: str, tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(URDF)
    listed = imported(tmp_path / "r.urdf", tmp_path / "in")
    assert listed.pop("base/twice") == "base:visual_3" and listed.pop("arm/twice") == "arm"
    assert listed == {name: name for name in ("chassis_look", "chassis", "both", "bumper col")}
    file = built(tmp_path / "in", emit)
    found = names(file)
    assert [name for name in found["visual"] if not name.startswith(("base", "arm"))] == ["chassis_look", "both"]
    assert found["collision"] == ["chassis", "both", "bumper col"]
    assert len(found["visual"]) == 5 == len(set(found["visual"]))
    file.rename(tmp_path / f"again.{emit}")
    again = imported(tmp_path / f"again.{emit}", tmp_path / "again")
    assert {"chassis_look", "chassis", "both", "bumper col"} <= again.keys(), "and again"
    assert names(built(tmp_path / "again", emit)) == found


def test_generated_shape_names_are_not_imported(tmp_path: Path) -> None:
    """The names that thingc generates for unnamed shapes are not imported as their names."""
    source = tmp_path / "r.urdf"
    source.write_text(URDF.replace(' name="chassis_look"', "").replace(' name="chassis"', ""))
    for number, emit in enumerate(("urdf", "sdf", "urdf")):
        folder = tmp_path / f"{number}"
        imported(source, folder)
        text = (folder / "r.yaml").read_text()
        assert "- {box: 1000 1000 1000 mm}\n" in text and text.count("name:") == 3 and text.count("both") == 1
        source = built(folder, emit)

"""Elements of an imported MJCF file keep their source names in the built model."""

from __future__ import annotations

from pathlib import Path

import mujoco
import pytest

import thingc
from importing.imports import write_import
from thingc.base.diagnostics import Report
from thingc.tools.importing.importing import Imported, import_robot

NAMED = """\
<mujoco model="named">
  <worldbody>
    <body name="torso" pos="0 0 0.5">
      <freejoint/>
      <geom name="torso" type="box" size="0.1 0.1 0.05" mass="2"/>
      <geom name="shin" type="sphere" size="0.01" mass="0" contype="0" conaffinity="0"/>
      <geom type="sphere" size="0.02" mass="0"/>
      <body name="shin" pos="0 0.1 0">
        <joint name="knee" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.1"/>
        <geom name="foot.L" type="sphere" pos="0 0 -0.2" size="0.03" group="3"/>
        <geom name="foot look" type="sphere" pos="0 0 -0.2" size="0.03" contype="0" conaffinity="0" mass="0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def imported_from(text: str, folder: Path) -> Imported:
    """Import a text; the files are written into the folder."""
    (folder / "source.xml").write_text(text)
    imported = import_robot(str(folder / "source.xml"), Report())
    assert imported is not None
    write_import(imported, folder)
    return imported


def built_from(text: str, folder: Path, mode: str = "source") -> mujoco.MjModel:
    """Return the model of a mode of the imported document."""
    return thingc.compile(folder / imported_from(text, folder).document).modes[mode].model()


def test_geoms_keep_their_names(tmp_path: Path) -> None:
    theirs, ours = mujoco.MjModel.from_xml_string(NAMED), built_from(NAMED, tmp_path)
    for name in ("torso", "shin", "foot.L", "foot look"):
        one, other = theirs.geom(name), ours.geom(name)
        assert theirs.body(one.bodyid[0]).name == ours.body(other.bodyid[0]).name
        assert (one.type, one.contype, one.conaffinity) == (other.type, other.contype, other.conaffinity)
    assert {"torso:visual", "foot.L", "shin:collision"} <= {ours.geom(k).name for k in range(ours.ngeom)}


TIED = """\
<mujoco model="tied">
  <worldbody>
    <body name="palm">
      <geom size="0.1"/>
      <body name="a"><joint name="first.L" axis="0 1 0"/><geom size="0.05"/><site name="s"/></body>
      <body name="b"><joint name="second" axis="0 1 0"/><geom size="0.05"/></body>
      <body name="c"><joint name="third" axis="0 1 0"/><geom size="0.05"/></body>
    </body>
  </worldbody>
  <equality>
    <joint name="couple" joint1="first.L" joint2="second" solref="0.05 1"/>
    <connect name="clo-se" body1="b" body2="c" anchor="0 0 0.1" solref="0.06 1"/>
  </equality>
</mujoco>
"""


def test_equalities_keep_their_names(tmp_path: Path) -> None:
    theirs, ours = mujoco.MjModel.from_xml_string(TIED), built_from(TIED, tmp_path)
    for name in ("couple", "clo-se"):
        assert [*ours.equality(name).solref] == [*theirs.equality(name).solref] and ours.equality(name).type == theirs.equality(name).type


LEG = """\
thingc: assembly/1
name: leg
components:
  foot:
    link: true
    mass: 1 kg
    com: 0 0 0 mm
    inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}
    shapes: [{sphere: {radius: 20 mm}, name: sole}]
"""
PAIR = """\
thingc: assembly/1
name: pair
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
  left: {assembly: leg.yaml}
  right: {assembly: leg.yaml}
joints:
  a: {type: continuous, parent: base.origin, child: left.foot.origin, axis: [0, 0, 1]}
  b: {type: continuous, parent: base.origin, child: right.foot.origin, axis: [0, 0, 1]}
modes:
  stand: {root: base, at: {xyz: 0 0 1 m}}
"""


def test_nested_shape_names_include_the_component_path(tmp_path: Path) -> None:
    (tmp_path / "leg.yaml").write_text(LEG)
    (tmp_path / "pair.yaml").write_text(PAIR)
    compiled = thingc.compile(tmp_path / "pair.yaml")
    model = compiled.modes["stand"].model()
    names = {model.geom(k).name for k in range(model.ngeom)}
    assert names == {f"{leg}/sole{mark}" for leg in ("left", "right") for mark in ("", ":visual")}



@pytest.mark.parametrize("order", [("table.xml", "arm.xml"), ("arm.xml", "table.xml")])
def test_robot_is_named_after_the_file_that_contains_it(order: tuple[str, str], tmp_path: Path) -> None:
    """Other files that the scene includes also have a model name."""
    (tmp_path / "arm.xml").write_text(
        '<mujoco model="arm"><worldbody><body name="one"><geom size="0.1"/></body></worldbody></mujoco>',
    )
    (tmp_path / "table.xml").write_text('<mujoco model="table"><asset><material name="wood"/></asset></mujoco>')
    included = "".join(f'<include file="{file}"/>' for file in order)
    assert imported_from(f'<mujoco model="scene">{included}</mujoco>', tmp_path).document == "arm.yaml"

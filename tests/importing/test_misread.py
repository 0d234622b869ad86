"""Mutation tests of the comparison: if the importer misread one element of a file, the comparison with MuJoCo would detect it."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import mujoco
import pytest

import thingc
from importing.as_original import Pair, in_files
from importing.imports import write_import
from thingc.base.diagnostics import Report
from thingc.tools.importing.importing import import_robot

ROBOTS = Path(__file__).parent / "robots"
EXACT = 1e-9
URDF = '<mujoco><compiler fusestatic="false" balanceinertia="false"/></mujoco></robot>'
MISREAD = {
    "a mesh for another": ("constructs.xml", 'mesh="wedge"', 'mesh="turned"', "shapes"),
    "a mesh as large as its file": ("constructs.xml", ' scale="0.1 0.1 0.1"', "", "shapes"),
    "an inertia in the axes of its link": ("constructs.xml", ' quat="1 0.8 0.5 0.2" mass', " mass", "mass matrix"),
    "degrees for radians": ("constructs.xml", ' angle="degree"', ' angle="radian"', "poses"),
    "an axis and an angle as angles": ("constructs.xml", 'axisangle="0 1 0 20"', 'euler="0 1 0"', "poses"),
    "angles in another order": ("constructs.xml", ' eulerseq="zyx"', "", "shapes"),
    "no default class": ("constructs.xml", ' childclass="arm"', "", "dynamics"),
    "an axis the other way": ("constructs.xml", 'name="elbow" axis="0 1 0"', 'name="elbow" axis="0 -1 0"', "poses"),
    "a gear of 1": ("constructs.xml", 'joint="left" gear="30"', 'joint="left"', "actuators"),
    "no friction": ("constructs.xml", ' frictionloss="0.02"', "", "dynamics"),
    "an inertial that is not turned, of URDF": ("constructs.urdf", r'(<inertial>\s*<origin[^>]*?) rpy="[^"]*"', r"\1", "mass matrix"),
    "an axis the other way, of URDF": ("constructs.urdf", r'<axis xyz="([^- ]+) ', r'<axis xyz="-\1 ', "poses"),
    "limits in degrees, of URDF": ("constructs.urdf", r'lower="-0.4" upper="2"', 'lower="-0.00698" upper="0.0349"', "limits"),
    "a joint that is not turned, of URDF": ("constructs.urdf", r'(<joint[^>]*revolute.*?<origin[^>]*?) rpy="[^"]*"', r"\1", "poses"),
    "no damping, of URDF": ("constructs.urdf", r' damping="[^"]*"', "", "dynamics"),
}
"""A misreading: the file, a pattern in it, its replacement, and the quantity that then differs."""


def differences(name: str, text: str, folder: Path) -> set[str]:
    """Return the quantities in which the robot imported from `text` differs from MuJoCo's reading of the file with that name."""
    shutil.copytree(ROBOTS / "parts", folder / "parts")
    (folder / name).write_text(text)
    imported = import_robot(str(folder / name), Report())
    assert imported is not None
    ours = thingc.compile(write_import(imported, folder / "out")).modes["source"].model()
    source = (ROBOTS / name).read_text().replace("</robot>", URDF)
    (folder / "source.xml").write_text(source)
    spec = mujoco.MjSpec.from_file(str(folder / "source.xml"))
    model = spec.compile()
    named = {
        "body": {one.id: one.name for one in spec.bodies}, "joint": {one.id: one.name or f"{one.parent.name}_joint" for one in spec.joints},
        "site": {one.id: one.name for one in spec.sites}, "actuator": {one.id: one.name or one.target for one in spec.actuators},
        "tendon": {},
    }
    worst = Pair(model, ours, named, in_files(imported)).compare(states=5, steps=0)
    return {kind for kind, far in worst.items() if not far <= (EXACT if kind not in ("contacts", "shapes") else 1e-6)}


@pytest.mark.parametrize("name", MISREAD)
def test_misreading_is_detected(name: str, tmp_path: Path) -> None:
    file, there, read, differs = MISREAD[name]
    text = (ROBOTS / file).read_text()
    changed = re.sub(there, read, text, flags=re.DOTALL)
    assert changed != text
    assert differs in differences(file, changed, tmp_path)


@pytest.mark.parametrize("file", ["constructs.xml", "constructs.urdf"])
def test_correct_reading_has_no_differences(file: str, tmp_path: Path) -> None:
    found = differences(file, (ROBOTS / file).read_text(), tmp_path)
    assert not found & {differs for of, *_, differs in MISREAD.values() if of == file}

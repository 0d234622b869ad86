"""Transmissions in URDF, ROS 2, SDF and USD, and their import with `thingc import`."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

import thingc
from thingc.base.diagnostics import Report
from thingc.tools.cli.main import main
from thingc.tools.importing.importing import import_robot

GEARED = """\
thingc: assembly/1
name: geared
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}
  upper: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}
  yoke: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}
  hand: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}
joints:
  knee: {type: continuous, parent: base.origin, child: upper.origin}
  pitch: {type: continuous, parent: upper.origin, child: yoke.origin, axis: [1, 0, 0], limit: {velocity: 3 rad/s}}
  roll: {type: continuous, parent: yoke.origin, child: hand.origin, axis: [0, 1, 0]}
transmissions:
  belt: {actuator: {kind: motor, effort: 0.5 N*m, velocity: 90 rad/s}, joint: knee, ratio: -9, efficiency: 80 %, backlash: 0.1 rad}
  wrist:
    differential:
      actuators: [{kind: motor, effort: 2 N*m, armature: 1e-3 kg*m^2}, {kind: motor, effort: 2 N*m, armature: 1e-3 kg*m^2}]
      joints: [pitch, roll]
      matrix: MATRIX
modes: {m: {root: base, base: fixed}, other: {root: hand, base: fixed, actuators: [knee]}}
"""
TARGETS = ("mjcf", "urdf", "ros", "sdf", "usd")
DIFFERENTIAL, FOUR_BAR, NEITHER = "[[3, 6], [4, -8]]", "[[3, 0], [4, -8]]", "[[3, 1], [4, -8]]"


def build_targets(folder: Path, matrix: str) -> Path:
    (folder / "geared.yaml").write_text(GEARED.replace("MATRIX", matrix))
    words = ["build", str(folder / "geared.yaml"), "-o", str(folder / "out"), "--store", str(folder / "store")]
    assert main([*words, *(word for target in TARGETS for word in ("--emit", target))]) == 0
    return folder / "out" / "geared"


def losses(folder: Path) -> set[tuple[str, str, str, str]]:
    found = json.loads((folder / "manifest.json").read_text())["losses"]
    own = ("knee", "wrist", "wrist_0", "wrist_1")
    return {(one["target"], one["path"], one["what"], one["how"]) for one in found if one["path"] in own}


def positions(plugin: str, a: list[float], j: list[float]) -> np.ndarray:
    """Matrix from joint to actuator positions, computed with the formulas in the headers of ros2_control."""
    if plugin.endswith("SimpleTransmission"):
        return np.array([[a[0] * j[0]]])
    if plugin.endswith("DifferentialTransmission"):
        return np.array([[a[0] * j[0], a[0] * j[1]], [a[1] * j[0], -a[1] * j[1]]])
    assert plugin.endswith("FourBarLinkageTransmission")
    return np.array([[a[0] * j[0], 0.0], [a[1], a[1] * j[1]]])


@pytest.mark.parametrize(("matrix", "plugin"), [(DIFFERENTIAL, "Differential"), (FOUR_BAR, "FourBarLinkage")])
def test_ros_transmission_has_the_same_matrix(matrix: str, plugin: str, tmp_path: Path) -> None:
    """The reductions in the `ros2_control` block give the matrix of the document. The mode with one drive has one transmission, in both
    formats."""
    out = build_targets(tmp_path, matrix)
    block = ElementTree.parse(out / "ros/geared_description/urdf/geared_m.urdf").getroot().find("ros2_control")
    assert block is not None
    found = {one.get("name"): one for one in block.findall("transmission")}
    assert list(found) == ["belt", "wrist"]
    matrices = {}
    for name, one in found.items():
        reductions = {
            tag: [float(inner.findtext("mechanical_reduction", "1")) for inner in one.findall(tag)] for tag in ("actuator", "joint")
        }
        for tag in reductions:
            assert [inner.get("role") for inner in one.findall(tag)] == [f"{tag}{k + 1}" for k in range(len(reductions[tag]))]
        matrices[name] = positions(one.findtext("plugin", ""), reductions["actuator"], reductions["joint"])
    assert found["wrist"].findtext("plugin") == f"transmission_interface/{plugin}Transmission"
    assert matrices["belt"].tolist() == [[-9.0]] and matrices["wrist"] == pytest.approx(np.array(json.loads(matrix)))
    assert [joint.get("name") for joint in found["wrist"].findall("joint")] == ["pitch", "roll"]
    commanded = [joint.get("name") for joint in block.findall("joint") if joint.find("command_interface") is not None]
    assert commanded == ["knee", "pitch", "roll"]
    other = ElementTree.parse(out / "ros/geared_description/urdf/geared_other.urdf").getroot()
    assert [one.get("name") for one in other.iter("transmission")] == ["belt", "belt"], "the mode has one drive, in both forms"


def test_urdf_efforts_are_joint_efforts(tmp_path: Path) -> None:
    """Expected: 9 x 0.8 x 0.5 N m at the knee; 3 x 2 + 4 x 2 and 6 x 2 + 8 x 2 at the wrist."""
    root = ElementTree.parse(build_targets(tmp_path, DIFFERENTIAL) / "urdf/geared_m.urdf").getroot()
    limits = {joint.get("name"): joint.find("limit") for joint in root.findall("joint") if joint.find("limit") is not None}
    efforts = {name: float(limit.get("effort", "")) for name, limit in limits.items() if limit is not None}
    assert efforts == pytest.approx({"knee": 3.6, "pitch": 14.0, "roll": 28.0})
    assert limits["knee"] is not None and float(limits["knee"].get("velocity", "")) == pytest.approx(10.0)
    belt = next(one for one in root.findall("transmission") if one.get("name") == "belt")
    assert belt.findtext("actuator/mechanicalReduction") == "-9"


def test_unsupported_transmissions_are_losses(tmp_path: Path) -> None:
    """Backlash, general differentials and their armature are export losses of the formats that do not support them."""
    lost = losses(build_targets(tmp_path, NEITHER))
    backlash = {(target, "knee", "the backlash of 0.1 rad", "omitted") for target in ("urdf", "ros", "sdf", "usd")}
    assert backlash | {("mjcf", "knee", "the backlash of 0.1 rad", "carried as custom data")} <= lost
    symmetric = "the transmission of the differential: ROS supports only two actuators and a symmetric matrix"
    assert {(target, "wrist", symmetric, "omitted") for target in ("urdf", "ros")} <= lost
    for target in ("sdf", "usd"):
        assert {(target, f"wrist_{k}", "the drive of the differential `wrist`", "omitted") for k in range(2)} <= lost
    assert {(target, "wrist_0", "the armature of 0.001 kg m^2", "omitted") for target in ("urdf", "ros")} <= lost
    assert not any(target == "mjcf" and path.startswith("wrist") for target, path, _, _ in lost)


@pytest.mark.parametrize("file", ["urdf/geared_m.urdf", "ros/geared_description/urdf/geared_m.urdf"])
@pytest.mark.parametrize("matrix", [DIFFERENTIAL, FOUR_BAR])
def test_urdf_import_keeps_transmissions(file: str, matrix: str, tmp_path: Path) -> None:
    """Importing the exported URDF keeps ratios, matrices and efforts at the joints."""
    report = Report()
    found = import_robot(str(build_targets(tmp_path, matrix) / file), report)
    assert found is not None and report.diagnostics == []
    text = found.files["geared.yaml"].decode()
    again = tmp_path / "again"
    again.mkdir()
    (again / "geared.yaml").write_text(text)
    robot = thingc.compile(again / "geared.yaml")
    edges = {joint.path: joint for mate in robot.assembly.mates for joint in mate.joints}
    drive = edges["knee"].actuator
    assert drive is not None and (drive.transmission, drive.ratio) == ("belt", -9.0) and edges["knee"].limit.effort == 3.6
    rows = [list(tendon.moves.values()) for tendon in robot.assembly.tendons]
    assert np.array(rows) == pytest.approx(np.array(json.loads(matrix))) and edges["pitch"].actuator is None
    assert [tendon.path for tendon in robot.assembly.tendons] == ["wrist_0", "wrist_1"]
    assert [loss.what for loss in found.losses if "reduction" in loss.what] == []


@pytest.mark.parametrize(("old", "new", "why"), [
    ("<mechanicalReduction>-9</mechanicalReduction>", "<mechanicalReduction>0</mechanicalReduction>", "unknown type, or a reduction of 0"),
    ("DifferentialTransmission", "HarmonicTransmission", "unknown type, or a reduction of 0"),
    ('name="wrist"', 'name="belt"', "another transmission has the same name or joints"),
])
def test_invalid_reductions_are_import_losses(old: str, new: str, why: str, tmp_path: Path) -> None:
    """A reduction of 0, an unknown type or a duplicate name is one import loss, and the imported document compiles."""
    path = build_targets(tmp_path, DIFFERENTIAL) / "urdf/geared_m.urdf"
    text = path.read_text()
    assert old in text
    copy = tmp_path / "copy.urdf"
    copy.write_text(text.replace(old, new))
    found = import_robot(str(copy), Report())
    assert found is not None
    lost = [loss for loss in found.losses if loss.why == why]
    assert len(lost) == 1 and re.match(r"the reductions of transmission `\w+`", lost[0].what)
    (tmp_path / "copy").mkdir()
    (tmp_path / "copy" / "geared.yaml").write_bytes(found.files["geared.yaml"])
    assert thingc.compile(tmp_path / "copy" / "geared.yaml").diagnostics is not None


def test_mjcf_import_keeps_tendons_and_gear(tmp_path: Path) -> None:
    """Tendons, their armatures and the efforts are kept. `gear` of MuJoCo is converted to the joint."""
    out = build_targets(tmp_path, DIFFERENTIAL)
    source = out / "mjcf/geared_m.xml"
    text = source.read_text()
    written = next(line for line in text.splitlines() if '<motor name="knee"' in line)
    geared = re.sub(r'ctrlrange="[^"]*"', 'ctrlrange="-0.4 0.4"', written.replace('gear="1"', 'gear="9"'))
    (tmp_path / "source.xml").write_text(text.replace(written, geared))
    found = import_robot(str(tmp_path / "source.xml"), Report())
    assert found is not None
    name = next(name for name in found.files if name.endswith(".yaml"))
    (tmp_path / "again.yaml").write_bytes(found.files[name])
    robot = thingc.compile(tmp_path / "again.yaml")
    model = robot.modes["source"].model()
    assert model.tendon_armature == pytest.approx([1e-3, 1e-3]) and model.nu == 3
    edges = {joint.path: joint for mate in robot.assembly.mates for joint in mate.joints}
    assert edges["knee"].limit.effort == pytest.approx(3.6)
    assert model.actuator("knee").gear[0] == 9.0, "a raw attribute, so that commands are those of the source"

"""Blocks for Gazebo, ROS and MuJoCo in URDF files: imported if documents support them, otherwise a loss with its line and reason."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import mujoco
import pytest

import thingc
from importing.imports import import_cleanly
from thingc.base.diagnostics import Report
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import Imported, import_robot

SOURCE = Path(__file__).parent / "robots" / "blocks.urdf"


@pytest.fixture(scope="module")
def imported() -> Imported:
    return import_cleanly(SOURCE)


def test_friction_and_drives_are_imported(imported: Imported, tmp_path: Path) -> None:
    text = imported.files["blocks.yaml"].decode()
    assert "- {box: 200 200 200 mm, friction: {slide: 0.8}}\n" in text
    (tmp_path / "blocks.yaml").write_text(text)
    model = thingc.compile(tmp_path / "blocks.yaml").modes["source"].model()
    touching = [k for k in range(model.ngeom) if model.geom_contype[k]]
    assert len(touching) == 2 and [model.geom_friction[k][0] for k in touching] == [0.8, 0.8]
    assert [model.actuator(k).name for k in range(model.nu)] == ["shoulder", "wrist"], "what has no command is not driven"
    assert "    actuator: {kind: motor}\n    joint: shoulder\n    ratio: -50\n" in text


def test_sensor_poses_are_imported(imported: Imported, tmp_path: Path) -> None:
    """At q = 0 the camera looks along y with z up. Its vertical field of view is 2 atan(tan(45 deg) / 2)."""
    text = imported.files["blocks.yaml"].decode()
    assert "  imu: {type: imu, at: imu_link}\n  gyro: {type: imu, at: gyro}\n" in text
    (tmp_path / "blocks.yaml").write_text(text)
    compiled = thingc.compile(tmp_path / "blocks.yaml")
    assert [d for d in compiled.diagnostics if d.code.code != "TC610"] == []
    model = compiled.modes["source"].model()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    assert data.site("imu_link").xpos == pytest.approx([0.2, 0.0, 0.6]) and data.site("gyro").xpos == pytest.approx([0.1, 0.0, 0.3])
    assert data.site("gyro").xmat.reshape(3, 3)[:, 0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    turned = data.cam_xmat[0].reshape(3, 3)
    assert data.cam_xpos[0] == pytest.approx([0.2, 0.0, 0.7])
    assert -turned[:, 2] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12) and turned[:, 1] == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    assert model.cam_fovy[0] == pytest.approx(math.degrees(2.0 * math.atan(0.5)))


def test_losses_have_a_line_and_a_reason(imported: Imported) -> None:
    lost = [(one["line"], one["what"], one["why"]) for one in json.loads(imported.files["import.json"])["losses"]]
    assert lost == [
        (4, "`boundmass` of `<compiler>`", "masses and shapes are imported as they are in the file"),
        (5, "`<option>` of `<mujoco>`", "not imported"),
        (20, "`<safety_controller>` of `<joint>`", "not imported"),
        (31, '`<kp>` of `<gazebo reference="base">`', "contact stiffness depends on the simulator"),
        (32, '`<material>` of `<gazebo reference="base">`', "a reference to a Gazebo material"),
        (34, "rate, noise and plugins of sensor `imu`", "sensors in a document only have a type and a mount"),
        (41, "sensor `laser`", "sensors of type `ray` are not supported"),
        (44, '`<gazebo reference="hnad">`', "the link or joint does not exist"),
        (45, "`<plugin>` of `<gazebo>`", "Gazebo plugins are not imported"),
        (52, "`<hardware>` of `<ros2_control>`", "ROS plugins are not imported"),
        (53, "the position command interface of joint `wrist`", "the gains of the controller are unknown"),
        (54, "the command limits of joint `wrist`", "the limits of the joint apply"),
    ]


def test_invalid_friction_values_are_reported(tmp_path: Path) -> None:
    path, report = tmp_path / "robot.urdf", Report()
    path.write_text(SOURCE.read_text().replace("<mu1>0.8", "<mu1>much").replace('value="0.8"', 'value="-1"'))
    assert import_robot(str(path), report) is None
    assert [(d.span.line, d.message) for d in report.sorted_diagnostics() if d.span is not None] == [
        (29, "`<mu1>`: expected a number, found `much`"), (30, "`<mu2>`: expected a number of at least 0, found -1"),
    ]


def test_meshes_are_found_in_the_mujoco_meshdir(tmp_path: Path) -> None:
    mesh = '<visual><geometry><mesh filename="package://nowhere/a/part.stl"/></geometry></visual>'
    path = tmp_path / "robot" / "robot.urdf"
    (path.parent / "assets").mkdir(parents=True)
    path.write_text(SOURCE.read_text().replace('<link name="tip">', f'<link name="tip">{mesh}'))
    report = Report()
    assert import_robot(str(path), report) is None and "there is no package `nowhere`" in report.diagnostics[0].message
    (path.parent / "assets" / "part.stl").write_bytes(b"solid")
    imported = import_robot(str(path), Report())
    assert imported is not None and imported.files["meshes/part.stl"] == b"solid"
    path.write_text(path.read_text().replace('meshdir="assets"', 'meshdir="../.."'))
    (tmp_path.parent / "part.stl").write_bytes(b"solid")
    assert import_robot(str(path), Report()) is None, "it stays in the folder above"


def test_mimic_of_a_missing_joint_is_a_warning(tmp_path: Path) -> None:
    """The joint then moves independently, as in pinocchio: `benchmarks/importing/run.py` has read alex_psyonic_hands with it."""
    path, report = tmp_path / "robot.urdf", Report()
    text = (SOURCE.parent / "constructs.urdf").read_text()
    line = next(number for number, one in enumerate(text.splitlines(), start=1) if "<mimic" in one)
    path.write_text(re.sub('<mimic joint="', '<mimic joint="no_', text, count=1))
    imported = import_robot(str(path), report)
    assert imported is not None and [(one.code.code, one.span.line) for one in report.diagnostics if one.span] == [("TC955", line)]
    assert "not a moving joint" in report.diagnostics[0].message and "did you mean" in (report.diagnostics[0].help or "")
    assert [loss.why for loss in imported.losses if "mimic of" in loss.what] == ["the other joint does not move"]
    alone = [joint for one in imported.robot.attachments for joint in one.joints if joint.follows is None]
    assert len(alone) == len([joint for one in imported.robot.attachments for joint in one.joints]) - text.count("<mimic") + 1


@pytest.mark.parametrize("block", [
    '<ros2_control name="c"><joint name="JOINT"><command_interface name="effort"/></joint></ros2_control>',
    '<transmission name="t"><joint name="JOINT"><hardwareInterface>EffortJointInterface</hardwareInterface></joint></transmission>',
])
def test_drive_of_a_missing_joint_is_a_warning_and_a_loss(block: str, tmp_path: Path) -> None:
    path, found = tmp_path / "robot.urdf", []
    links = '<link name="a"/><joint name="yaw" type="continuous"><parent link="a"/><child link="b"/></joint><link name="b"/>'
    for name in ("yaw", "yah"):
        report = Report()
        path.write_text(f'<robot name="r">{links}\n{block.replace("JOINT", name)}</robot>')
        imported = import_robot(str(path), report, ImportRequest(repair="nearest"))
        assert imported is not None
        (joint,) = (joint for one in imported.robot.attachments for joint in one.joints)
        warned = [(one.message, one.help, one.span and one.span.line) for one in report.diagnostics]
        found.append((joint.drive is not None, warned, [loss.what for loss in imported.losses if "drive of" in loss.what]))
    said = ("the driven joint `yah` does not exist", "did you mean `yaw`?", 2)
    assert found == [(True, [], []), (False, [said], ["the drive of joint `yah`"])]

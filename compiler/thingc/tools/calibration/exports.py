"""Write the calibration of a robot in the formats of other programs."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pprint import pformat

from thingc.base.diagnostics import Code, Report, Severity, UserError, shown_path
from thingc.model.robot.types import Robot
from thingc.targets.name_mangling import safe
from thingc.targets.ros.control import ros2_control
from thingc.targets.ros.joints import joints
from thingc.targets.xml_writer import write
from thingc.tools.calibration.calibration import CalibratedJoint, Calibration

Joints = Sequence[CalibratedJoint]


class ExportRefused(UserError):
    """Raised if a format cannot express a calibration."""


def lerobot(calibration: Joints, robot: Robot) -> str:
    """Return the calibration file of LeRobot as JSON: `MotorCalibration` by name of the motor.

    `homing_offset` makes the middle of the range the middle of the encoder: the motor reports the encoder value minus `homing_offset`.
    """
    return json.dumps({safe(one.joint.path): _homing_values(one) for one in calibration}, indent=4) + "\n"


def _homing_values(one: CalibratedJoint) -> dict[str, int]:
    if one.modulus is None:
        message = f"LeRobot does not support the `resolution` of joint `{one.joint.name}`"
        raise ExportRefused(message, "write `ticks_per_turn` for the joint, or use --emit python")
    homing, half = (one.lowest + one.highest) // 2 - (one.modulus - 1) // 2, one.modulus // 2
    return {
        "id": one.id, "drive_mode": int(one.sign < 0), "homing_offset": (homing + half) % one.modulus - half,
        "range_min": one.lowest - homing, "range_max": one.highest - homing,
    }


def lerobot_motors(calibration: Joints, robot: Robot) -> str:
    """Return the motor mapping of LeRobot as JSON: the arguments of `Motor`, keyed by motor name."""
    nameless = next((one for one in calibration if one.model is None), None)
    if nameless is not None:
        raise ExportRefused(f"LeRobot requires the motor model of joint `{nameless.joint.name}`", "write, for example, `model: sts3215`")
    motors = {safe(one.joint.path): {"id": one.id, "model": one.model, "norm_mode": "degrees"} for one in calibration}
    return json.dumps(motors, indent=4) + "\n"


def warn_reversed(calibration: Calibration, robot: str, report: Report) -> None:
    """Warn about motors with `sign: -1`, because LeRobot ignores `drive_mode` if `norm_mode` is `degrees`. `robot` is a document."""
    for one in (one for one in calibration.joints if one.sign < 0):
        message = f"LeRobot ignores `sign: -1` and moves joint `{one.joint.name}` in the wrong direction"
        span = calibration.document.span(("joints", str(one.joint.name), "sign"))
        help = f"run `thingc rezero {robot} --flip {one.joint.name} --calibration {shown_path(calibration.document.path)}`"
        report.add(Code.COMMAND_LINE, message, span, help=help, severity=Severity.WARNING)


def ros2_control_block(calibration: Joints, robot: Robot) -> str:
    """Return the `<ros2_control>` block of the robot, in which each joint also has the parameters of its motor."""
    block, motors = ros2_control(robot), {one.joint.path: one for one in calibration}
    if block is None:
        raise ExportRefused("the robot has no moving joints", "use --emit python")
    names = {joint.name: joint.move.joint.path for joint in joints(robot)}
    for element in block.children:
        one = motors.get(names.get(element.get("name"), ""))
        if element.tag == "joint" and one is not None:
            for name, value in (("id", one.id), ("offset", one.offset), ("sign", one.sign), ("ticks_per_unit", one.ticks)):
                element.add_text("param", value, {"name": name})
    return write(block, "Parameters of motors: ticks = offset + sign * q * ticks_per_unit [1/rad or 1/m]").text


def python(calibration: Joints, robot: Robot) -> str:
    """Return a Python module with the dictionary `JOINTS`."""
    entries = {
        one.joint.path: {
            "id": one.id, "model": one.model, "sign": one.sign, "offset": one.offset, "ticks_per_unit": one.ticks,
            "range": (one.lowest, one.highest) if one.lowest < one.highest else None,  # a joint without limits, several turns
            "limits": (one.joint.limit.lower, one.joint.limit.upper),
        } for one in calibration
    }
    head = f'"""Motors of the robot {robot.name}: ticks = offset + sign * q * ticks_per_unit [1/rad or 1/m]."""\n\n'
    return f"{head}JOINTS = {pformat(entries, sort_dicts=False)}\n"


EXPORTS: Mapping[str, Callable[[Joints, Robot], str]] = {
    "lerobot": lerobot, "lerobot_motors": lerobot_motors, "ros2_control": ros2_control_block, "python": python,
}
"""The formats of the option `--emit`."""

"""Read a `calibration/1` document: the motors and encoders of a physical robot, checked against the joints of the robot."""

from __future__ import annotations

import math

from thingc.base.diagnostics import Code, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document
from thingc.base.suggestions import did_you_mean
from thingc.base.units import ANGLE
from thingc.documents.load.documents import load
from thingc.documents.spec.calibration import CalibrationSpec, MotorSpec
from thingc.documents.spec.validation import validate_one
from thingc.documents.workspace import Workspace
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import Assembly, JointEdge


class CalibratedJoint(FrozenStruct):
    """A joint with its motor. The encoder value is `offset + sign * q * ticks`.

    `ticks` is the number of encoder values per unit of q [1/rad or 1/m]. `lowest` and `highest` are the encoder values at the ends of the
    range, and `modulus` the number of encoder values per turn, or None for encoders that count several turns.
    """

    joint: JointEdge
    id: int
    offset: int
    sign: int
    ticks: float
    lowest: int
    highest: int
    modulus: int | None
    model: str | None


class Calibration(FrozenStruct):
    """A calibration document, and its joints without errors."""

    document: Document
    joints: tuple[CalibratedJoint, ...] = ()


def read_calibration(path: str, assembly: Assembly, report: Report) -> Calibration | None:
    """Read a calibration document. Errors are added to `report`. Return None if the file cannot be read."""
    workspace = Workspace.find(path, report)
    documents = load(path, workspace, report, kinds=("calibration",)) if workspace is not None else None
    return None if documents is None else check_calibration(documents.root, assembly, report)


def check_calibration(document: Document, assembly: Assembly, report: Report) -> Calibration:
    """Check a calibration document against a robot. Errors are added to `report`."""
    spec = validate_one(document, report)
    if not isinstance(spec, CalibrationSpec):
        return Calibration(document=document)
    reader = _Reader(document, assembly, report)
    joints = (reader.calibrated_joint(name, motor) for name, motor in spec.joints.items())
    return Calibration(document=document, joints=tuple(one for one in joints if one is not None))


class _Reader:
    def __init__(self, document: Document, assembly: Assembly, report: Report) -> None:
        self.document, self.report = document, report
        self.joints: dict[str, JointEdge] = {joint.name: joint for joint in joints_of(assembly)}

    def _error(self, code: Code, message: str, *keys: str | int, help: str, name: str) -> None:
        at = ("joints", name, *keys)
        self.report.add(code, message, self.document.span(at, key=not keys), help=help, path=".".join(map(str, at)))

    def calibrated_joint(self, name: str, motor: MotorSpec) -> CalibratedJoint | None:
        """Return the joint with its motor. Return None after errors, which are reported."""
        count, joint = len(self.report.diagnostics), self.joints.get(name)
        if joint is None:
            place, help = self.document.span(("joints", name), key=True), did_you_mean(name, self.joints, what="joints")
            self.report.add(Code.UNKNOWN_JOINT, f"the robot has no joint `{name}`", place, help=help)
            return None
        if joint.mimic is not None or joint.kind.at_once:
            problem = f"mimics `{joint.mimic.joint}`" if joint.mimic is not None else "ball joint"
            self._error(Code.JOINT_FIELD, f"joint `{name}` cannot have a motor ({problem})", help="remove the joint", name=name)
            return None
        ticks = self._scale(name, motor, joint)
        if len(self.report.diagnostics) > count or ticks is None:
            return None
        lowest, highest = self._range(name, motor, joint, ticks)
        return None if len(self.report.diagnostics) > count else CalibratedJoint(
            joint=joint, id=motor.id, offset=motor.offset, sign=motor.sign, ticks=ticks, lowest=lowest, highest=highest,
            modulus=motor.ticks_per_turn, model=motor.model,
        )

    def _scale(self, name: str, motor: MotorSpec, joint: JointEdge) -> float | None:
        """Return the number of encoder values per unit of q [1/rad or 1/m]. Return None after an error, which is reported."""
        coordinate = joint.twist.coordinate
        if motor.resolution is not None and motor.resolution.dimension == coordinate:
            return 1.0 / motor.resolution.value
        if motor.ticks_per_turn is not None and coordinate == ANGLE:
            return motor.ticks_per_turn / (2.0 * math.pi)
        if motor.resolution is not None:
            message = f"the `resolution` of joint `{name}` must be {coordinate.words}, found `{motor.resolution}`"
            self._error(Code.DIMENSION, message, "resolution", help="write the angle or the length per encoder tick", name=name)
        else:
            message = f"`ticks_per_turn` requires a rotating joint, found `{name}`"
            self._error(Code.DIMENSION, message, "ticks_per_turn", help="write, for example, `resolution: 0.01 mm`", name=name)
        return None

    def _range(self, name: str, motor: MotorSpec, joint: JointEdge, ticks: float) -> tuple[int, int]:
        """Return the smallest and the largest encoder value, measured or from the limits, and check them."""
        limits, count = (joint.limit.lower, joint.limit.upper), motor.ticks_per_turn
        if motor.range is None:
            if limits[0] is None or limits[1] is None:
                return (0, count - 1) if count is not None else (motor.offset, motor.offset)
            ends = sorted(round(motor.offset + motor.sign * q * ticks) for q in limits if q is not None)
            if count is not None and ends[1] - ends[0] >= count:
                message = f"the range of joint `{name}` ({ends[1] - ends[0]} ticks) exceeds the range of the encoder ({count} ticks)"
                self._error(Code.OUT_OF_RANGE, message, help="reduce the limits, or use `resolution` for a multi-turn encoder", name=name)
            return ends[0], ends[1]
        for number, value in enumerate(motor.range):
            q = motor.sign * (value - motor.offset) / ticks
            for limit, beyond in zip(limits, (-1.0, 1.0), strict=True):
                if limit is not None and beyond * (q - limit) > 1.0 / ticks:
                    side, position, end = "upper" if beyond > 0 else "lower", joint.twist.format(q), joint.twist.format(limit)
                    message = f"the position at {value} ticks ({position}) is beyond the {side} limit of joint `{name}` ({end})"
                    help = "correct `offset` and `sign`, or the limits of the robot"
                    self._error(Code.OUT_OF_RANGE, message, "range", number, help=help, name=name)
        return motor.range[0], motor.range[1]

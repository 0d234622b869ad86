"""Measure whether the drives of a robot can hold a pose, for document tests of the kind `torque_margin`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note
from thingc.base.numeric import isfinite, round_significant
from thingc.base.pose import Pose
from thingc.base.units import FORCE, LENGTH, TORQUE
from thingc.documents.checks.torque_margin import KIND, TorqueCheck
from thingc.driver.testing.outcomes import BELOW, Failure, Measure, Outcome, TestCase, TestMeasurement, format_si
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import JointEdge, LinkedTendon
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.types import Keyframe, Robot
from thingc.model.statics.efforts import static_efforts
from thingc.model.statics.support import lifted_feet, stance
from thingc.model.statics.types import Efforts

SLACK = 1e-6
"""Largest gravity load on a joint, relative to the largest load, that does not count as unbalanced."""


def measure(case: TestCase, check: TorqueCheck) -> Outcome:
    """Measure the smallest torque margin of the tested drives. The margin is the ratio of the effort limit to the static effort."""
    robot, frame = case.robot, case.frames[0]
    bodies = body_poses(robot, frame.q, frame.base)
    joints = driven_elements(robot)
    equilibrium = static_efforts(robot, frame.q, bodies, case.request.memo)
    efforts, margins, choices = equilibrium.by_joint, equilibrium.margins, equilibrium.choices
    weakest = _weakest(check, margins)
    text = _effort(joints[weakest], efforts[weakest])
    limit = _effort(joints[weakest], joints[weakest].limit.effort or 0.0)
    measured: dict[str, Measure] = {
        "margin": margins[weakest] if isfinite(margins[weakest]) else None, "drive": weakest, "effort": efforts[weakest],
        "efforts": {path: efforts[path] for path in check.joints},
    }
    expected: dict[str, Measure] = {"min": check.minimum}
    moving = _moving_outcome(robot, frame.q, bodies, equilibrium)
    if moving is not None:
        return Outcome(measured=measured, expected=expected, summary=moving[0], failure=moving[1])
    notes: list[Note] = []
    remarks = ""
    if choices:
        measured["undetermined"] = choices
        notes.append(Note(message="several combinations of efforts are possible (the smallest efforts are shown)"))
        remarks = ", one of many solutions"
    smooth_margin = _without_friction(robot, frame, bodies, check)
    if smooth_margin is not None:
        measured["margin_without_friction"] = smooth_margin
        remarks += f"; {smooth_margin:.3g} if the floor had no friction"
    failure: Failure | None = None
    if not isfinite(margins[weakest]):
        summary = f"{joints[weakest].name} carries no load (margin at least {check.minimum:g}){remarks}"
        return Outcome(measured=measured, expected=expected, summary=summary)
    summary = f"margin {margins[weakest]:.3g} at {joints[weakest].name}: {text} of {limit} (at least {check.minimum:g}){remarks}"
    if margins[weakest] < check.minimum:
        too_weak = [path for path in check.joints if path != weakest and margins[path] < check.minimum]
        notes += [Note(message=f"required: {text}; available: {limit}")]
        notes += [Note(message=f"the margin of drive `{joints[path].name}` is {margins[path]:.3g}") for path in too_weak]
        failure = Failure(
            code=Code.TEST_TORQUE, key="min", notes=tuple(notes),
            message=f"the margin of drive `{joints[weakest].name}` ({margins[weakest]:.3g}) {BELOW} ({check.minimum:g})",
        )
    return Outcome(measured=measured, expected=expected, summary=summary, failure=failure)


def driven_elements(robot: Robot) -> dict[str, JointEdge | LinkedTendon]:
    """Return the joint coordinates and the tendons of a robot, which drives can move, by path."""
    return {joint.path: joint for joint in joints_of(robot.assembly)} | {tendon.path: tendon for tendon in robot.assembly.tendons}


def _weakest(check: TorqueCheck, margins: Mapping[str, float]) -> str:
    """Return the path of the drive with the smallest margin.

    If several margins are equal except for rounding, return the first of these drives.
    """
    return min(check.joints, key=lambda path: round_significant(margins[path], 12))


def _moving_outcome(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose], equilibrium: Efforts) -> tuple[str, Failure] | None:
    """Return a description and a failure if the robot does not stay at rest in the pose. Otherwise return None.

    The robot does not stay at rest if feet are above the floor, if it falls over, or if an undriven joint would move.
    """
    if robot.mode.feet:
        feet = stance(robot, q, bodies).feet
        lifted = lifted_feet(feet)
        if lifted:
            listed = ", ".join(f"`{path.replace('/', '.')}` by {format_si(height, LENGTH)}" for path, height in lifted.items())
            failure = Failure(
                code=Code.TEST_FOOT, key="pose", message=f"some feet are above the floor in the pose ({listed})",
                help="lower the feet in the pose, or remove them from `standing_on`",
            )
            return "has feet above the floor", failure
    if equilibrium.fall is not None:
        summary, reason = {
            "tips": ("falls over", f"the centre of mass is {format_si(equilibrium.fall.outside, LENGTH)} outside the support polygon"),
            "slides": ("slides off", "the friction of the feet is too low"),
            "pulls": ("falls off", "gravity pulls the robot away from the floor"),
        }[equilibrium.fall.how]
        failure = Failure(
            code=Code.TEST_FALLS, key="pose", message=reason,
            help="move the feet or heavy parts of the robot, or add feet to `standing_on`",
        )
        return summary, failure
    if equilibrium.unheld > SLACK:
        moves = f"joint `{equilibrium.where.replace('/', '.')}`" if equilibrium.where else "the robot"
        failure = Failure(
            code=Code.TEST_TORQUE, key="drive", message=f"no drive prevents the motion of {moves}",
            help="add a drive to the joint, or choose a pose without a load on the joint",
        )
        return "does not stay in the pose", failure
    return None


def _without_friction(robot: Robot, frame: Keyframe, bodies: Sequence[Pose], check: TorqueCheck) -> float | None:
    """Return the smallest torque margin of the tested drives, computed for a floor without friction.

    Return None if the robot cannot stand on such a floor, or if it does not stand on feet with friction.
    """
    if not any(foot.friction > 0.0 for foot in robot.mode.feet):
        return None
    smooth = replace(robot, mode=replace(robot.mode, feet=tuple(replace(foot, friction=0.0) for foot in robot.mode.feet)))
    equilibrium = static_efforts(smooth, frame.q, bodies)
    if equilibrium.fall is not None or equilibrium.unheld > SLACK:
        return None
    margin = equilibrium.margins[_weakest(check, equilibrium.margins)]
    return margin if isfinite(margin) else None


def _effort(drive: JointEdge | LinkedTendon, value: float) -> str:
    return format_si(abs(value), TORQUE if drive.turns else FORCE)


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure)

"""`torque_margin`: drives hold the robot still against gravity, with a margin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from msgspec.structs import replace
from pydantic import Field

from thingc.base.diagnostics import Code, DiagnosticCode, Note, noted
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import isfinite, rounded
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.pose import Pose
from thingc.base.units import FORCE, LENGTH, NUMBER, TORQUE
from thingc.documents.checks.kind import CheckKind
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import NumberField
from thingc.documents.spec.name_types import JointNames, ModeNames, PoseNames
from thingc.driver.testing.outcomes import Failure, Measure, Outcome, shown

if TYPE_CHECKING:
    from thingc.driver.testing.outcomes import TestCase
    from thingc.model.assembly.report import LinkReport
    from thingc.model.assembly.types import JointEdge
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Mode, Test
    from thingc.model.robot.types import Keyframe, Robot
    from thingc.model.statics.types import Efforts


class TorqueCode(DiagnosticCode):
    """Diagnostic codes of `torque_margin` tests."""

    TEST_TORQUE = ("TC656", "too little torque", "Use a stronger drive, lighter parts or another pose, or reduce the margin.")
    TEST_FALLS = ("TC660", "robot that falls over", "Move the feet or heavy parts, or add feet to `standing_on`.")
    TEST_FOOT = ("TC661", "feet in the air", "Change the pose, or list other mounts under `standing_on`.")


class TorqueMarginTest(Model):
    """Drives hold the robot still against gravity, with a margin: their effort limit over the static torque."""

    drive: JointNames = Field(examples=["shoulder", ["shoulder", "leg_*"]])
    """Names or patterns of driven joints."""
    mode: ModeNames | None = Field(default=None, examples=["bench", ["bench", "wall"]])
    """Names or patterns of modes whose base is `fixed` or `held`, or `all`; default: the first mode."""
    pose: PoseNames | None = Field(default=None, examples=["home", "leg_*", ["home", "reach"]])
    """Names or patterns of poses, or `all` keyframes of the mode; default: the start pose of the mode."""
    min: NumberField
    """The smallest allowed margin: 1.5 requires a limit of 1.5 times the needed torque."""


class TorqueCheck(OneLineRepr, FrozenStruct):
    """Requires the effort limits of the drives of `joints` (paths) to be at least `minimum` times the static effort."""

    joints: tuple[str, ...]
    minimum: float


def read_torque_margin(written: TorqueMarginTest, reader: Reader) -> TorqueCheck:
    """Read a `torque_margin` test. Report modes in which the document does not specify what supports the robot."""
    minimum = reader.number(written.min, "min", NUMBER, above=0.0)
    joints = reader.drives(written.drive, "drive")
    floating = [name for name in reader.chosen_modes if not _carried(reader.modes[name])]
    if floating:
        standing = [name for name, mode in reader.modes.items() if _carried(mode) and not _left_out(joints, mode)]
        others = f", or use modes that do: {', '.join(f'`{name}`' for name in standing)}" if standing else ""
        reader.error(
            Code.TEST, f"the base of mode `{floating[0]}` is free and has no support", "mode" if written.mode is not None else (),
            on_key=written.mode is None, help=f"set `standing_on: [...]` in the mode{others}",
        )
    for name in reader.chosen_modes:
        absent = _left_out(joints, reader.modes[name])
        if absent:
            reader.error(
                Code.TEST, f"mode `{name}` does not use the drive of joint `{absent[0]}`", "drive",
                help="use drives that are in the `actuators` of the mode",
            )
    return TorqueCheck(joints=joints, minimum=minimum)


def _carried(mode: Mode) -> bool:
    """Return whether the document specifies what supports the base of a mode."""
    return mode.base != "free" or mode.standing is not None or bool(mode.holds)


def _left_out(joints: Sequence[str], mode: Mode) -> list[str]:
    """Return the `joints` (paths) whose drives a mode does not use."""
    present = mode.actuators
    return [joint for joint in joints if present is not None and joint not in present]


def link(test: Test, check: TorqueCheck, joints: Mapping[str, JointEdge], findings: LinkReport) -> None:
    """Report drives without an effort limit, because such drives have no margin."""

    for path in check.joints:
        joint = joints.get(path)
        if joint is not None and joint.limit.effort is None:
            findings.error(
                Code.TEST, f"joint `{path}` has no effort limit, so its drive has no margin",
                (test.spans["drive"],) if "drive" in test.spans else test.origin, path=path,
                help="set `limit: {effort: ...}` of the joint, or `effort` of its drive", notes=noted(f"`{path}` is here", joint.origin),
            )


SLACK = 1e-6
"""Relative tolerance for unbalanced gravity loads on joints."""


def measure(case: TestCase, check: TorqueCheck) -> Outcome:
    """Measure the smallest ratio of limit to static effort of the named drives."""
    from thingc.model.assembly.kinematics import joints_of
    from thingc.model.robot.kinematics import body_poses
    from thingc.model.statics.efforts import static_efforts

    robot, frame = case.robot, case.frames[0]
    bodies = body_poses(robot, frame.q, frame.base)
    joints = {joint.path: joint for joint in joints_of(robot.assembly)}
    held = static_efforts(robot, frame.q, bodies)
    efforts, margins, choices = held.by_joint, held.margins, held.choices
    least = _weakest(check, margins)
    text = _effort(joints[least], efforts[least])
    limit = _effort(joints[least], joints[least].limit.effort or 0.0)
    measured: dict[str, Measure] = {
        "margin": margins[least] if isfinite(margins[least]) else None, "drive": least, "effort": efforts[least],
        "efforts": {path: efforts[path] for path in check.joints},
    }
    expected: dict[str, Measure] = {"min": check.minimum}
    unsteady = _unsteady(robot, frame.q, bodies, held)
    if unsteady is not None:
        return Outcome(measured=measured, expected=expected, said=unsteady[0], failure=unsteady[1])
    notes: list[Note] = []
    aside = ""
    if choices:
        measured["undetermined"] = choices
        notes.append(Note(message="statics alone does not determine these efforts: shown are the smallest that hold the pose"))
        aside = ", one of many solutions"
    slippery = _without_friction(robot, frame, bodies, check)
    if slippery is not None:
        measured["margin_without_friction"] = slippery
        aside += f"; {slippery:.3g} if the floor had no friction"
    failure: Failure | None = None
    if not isfinite(margins[least]):
        said = f"{least} carries no load (margin at least {check.minimum:g}){aside}"
        return Outcome(measured=measured, expected=expected, said=said)
    said = f"margin {margins[least]:.3g} at {least}: {text} of {limit} (at least {check.minimum:g}){aside}"
    if margins[least] < check.minimum:
        others = [path for path in check.joints if path != least and margins[path] < check.minimum]
        notes += [
            Note(message=f"drive `{path}` needs {_effort(joints[path], efforts[path])}, a margin of {margins[path]:.3g}")
            for path in others
        ]
        failure = Failure(
            code=TorqueCode.TEST_TORQUE, key="min", notes=tuple(notes),
            message=f"drive `{least}` needs {text} of its {limit}: a margin of {margins[least]:.3g}, below {check.minimum:g}",
        )
    return Outcome(measured=measured, expected=expected, said=said, failure=failure)


def _weakest(check: TorqueCheck, margins: Mapping[str, float]) -> str:
    """Return the drive with the smallest margin. If margins differ only by rounding, return the first of these drives."""
    return min(check.joints, key=lambda path: rounded(margins[path], 12))


def _unsteady(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose], held: Efforts) -> tuple[str, Failure] | None:
    """Describe the result and the failure if nothing supports the pose (feet in the air, a falling robot, or an undriven joint)."""
    from thingc.model.statics.support import lifted, stance

    if robot.mode.feet:
        feet = stance(robot, q, bodies).feet
        high = lifted(feet)
        if high:
            listed = ", ".join(f"`{path}` by {shown(height, LENGTH)}" for path, height in high.items())
            failure = Failure(
                code=TorqueCode.TEST_FOOT, key="pose", message=f"in this pose, feet of the mode are above the other feet: {listed}",
                help="lower them in the pose, or remove them from `standing_on`",
            )
            return "stands on feet in the air", failure
    if held.fall is not None:
        said, why = {
            "tips": ("falls over", f"its centre of mass is {shown(held.fall.outside, LENGTH)} outside the polygon of its feet"),
            "slides": ("slides off", "friction does not hold its feet in place"),
            "pulls": ("falls off", "gravity pulls it away from the floor, and nothing presses it on"),
        }[held.fall.how]
        failure = Failure(
            code=TorqueCode.TEST_FALLS, key="pose", message=f"in this pose the robot {said}: {why}",
            help="move its feet or heavy parts, or add feet to `standing_on`",
        )
        return said, failure
    if held.unheld > SLACK:
        moves = f"joint `{held.where}`" if held.where else "the robot"
        failure = Failure(
            code=TorqueCode.TEST_TORQUE, key="drive", message=f"the drives cannot hold this pose: {moves} would move",
            help="drive the joint, or choose a pose in which it hangs at rest",
        )
        return "does not stay in the pose", failure
    return None


def _without_friction(robot: Robot, frame: Keyframe, bodies: Sequence[Pose], check: TorqueCheck) -> float | None:
    """Return the smallest margin for a floor without friction. Return None without feet, or if such a floor cannot support the robot."""
    from thingc.model.statics.efforts import static_efforts

    if not any(foot.friction > 0.0 for foot in robot.mode.feet):
        return None
    smooth = replace(robot, mode=replace(robot.mode, feet=tuple(replace(foot, friction=0.0) for foot in robot.mode.feet)))
    held = static_efforts(smooth, frame.q, bodies)
    if held.fall is not None or held.unheld > SLACK:
        return None
    least = held.margins[_weakest(check, held.margins)]
    return least if isfinite(least) else None


def _effort(joint: JointEdge, value: float) -> str:
    return shown(abs(value), TORQUE if joint.twist.turns else FORCE)


PAGE = """\
## Torque margin

The torque margin is the effort limit of a drive divided by the effort that it needs to hold the robot still. This effort balances
gravity and springs, without joint friction. A joint that mimics another adds its load to the joint that it follows. The base supports
the robot; a `free` base requires [feet](modes.md#feet) or [holds](loops.md#holds). The test fails if no efforts can hold the robot in
the pose.

With loops, holds, feet or several drives, different efforts can hold the robot. The test then minimizes the sum of the squares of
effort divided by limit, and reports this. A controller can apply these efforts. The best possible margin may be larger.

Forces at the feet must be inside friction cones, which are approximated by inscribed pyramids with 16 edges. If no such forces support
the robot, the test fails. It reports the distance of the centre of mass from the support polygon, or that the robot slides. A foot does
not support the robot if it is higher than the lowest foot by more than 2 % of the greatest distance between feet.

These efforts require a controller that controls the horizontal forces at the feet. Position drives at rest need about the same efforts
as without friction. The test also reports the margin without friction. To require this margin, set `friction: 0`. The table shows the
margins of a hexapod of 1.3 kg on three legs with servos of 1.5 N m (`tests/statics/hexapod`), computed by `thingc test` and MuJoCo:

<!-- hexapod -->
| Case | Smallest margin |
|---|---|
| least squares within the cones, friction 0.8 | 8.27 |
| the same without friction | 5.24 |
| MuJoCo, position drives at rest on the scene's floor | 5.21 |
| three points held (`carries: force`) | 8.27 |
| three clamps | 67.4 |

<!-- keys: TorqueMarginTest -->
| Key | Type | Default | Description |
|---|---|---|---|
| `drive` | driven joints, patterns allowed | required | drives to check; each must have an effort limit |
| `mode` | modes | the first mode | |
| `pose` | poses | the mode's own pose | |
| `min` | a number | required | smallest allowed margin |
"""

KIND = CheckKind(
    name="torque_margin", position=6, summary="Drives hold the robot still against gravity, with a margin.",
    examples=[{"drive": "shoulder", "min": 1.5, "pose": "stretched"}], stub={"drive": "*", "min": "2"}, page=PAGE, model=TorqueMarginTest,
    read=read_torque_margin, link=link,
    codes=TorqueCode, measure=measure,
)

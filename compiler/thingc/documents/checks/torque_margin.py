"""`torque_margin`: drives hold the robot still against gravity, with a margin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from pydantic import Field

from thingc.base.brief import Brief
from thingc.base.diagnostics import Code, Note
from thingc.base.frozen import dataclass
from thingc.base.units import FORCE, LENGTH, NUMBER, TORQUE
from thingc.documents.checks.kind import CheckKind
from thingc.documents.checks.outcome import Failure, Measure, Outcome, shown
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import NumberField
from thingc.documents.spec.named import JointNames, ModeNames, PoseNames

if TYPE_CHECKING:
    from thingc.base.pose import Pose
    from thingc.driver.testing.results import Case
    from thingc.model.assembly.findings import Findings
    from thingc.model.assembly.types import JointEdge
    from thingc.model.resolve.model import Mode, Test
    from thingc.model.resolve.tests import Reader
    from thingc.model.robot.types import Keyframe, Robot
    from thingc.model.statics import Efforts

SLACK = 1e-6
"""What part of the gravity on the joints may stay unbalanced: rounding."""


class TorqueMarginTest(Model):
    """Drives hold the robot still against gravity, with a margin: their effort limit over the static torque."""

    drive: JointNames = Field(examples=["shoulder", ["shoulder", "leg_*"]])
    """Driven joints, patterns allowed."""
    mode: ModeNames | None = Field(default=None, examples=["bench", ["bench", "wall"]])
    """Modes whose base is `fixed` or `held`, patterns allowed, or `all`; the first unless written."""
    pose: PoseNames | None = Field(default=None, examples=["home", "leg_*", ["home", "reach"]])
    """Poses, patterns allowed, or `all` keyframes of the mode; where the mode starts unless written."""
    min: NumberField
    """The least margin: 1.5 asks for a limit of 1.5 times the torque that is needed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueCheck(Brief):
    """The effort limits of the drives of `joints` (paths) are at least `minimum` times the static effort."""

    joints: tuple[str, ...]
    minimum: float


def read(written: TorqueMarginTest, reader: Reader) -> TorqueCheck:
    """A margin of drives; only where the document says what carries the robot."""
    minimum = reader.number(written.min, "min", NUMBER, above=0.0)
    joints = reader.drives(written.drive, "drive")
    floating = [name for name in reader.chosen_modes if not _carried(reader.modes[name])]
    if floating:
        standing = [name for name, mode in reader.modes.items() if _carried(mode) and not _left_out(joints, mode)]
        others = f", or name modes that stand: {', '.join(f'`{name}`' for name in standing)}" if standing else ""
        reader.error(
            Code.TEST, f"the base of mode `{floating[0]}` floats: what carries it there is not known",
            "mode" if written.mode is not None else (), on_key=written.mode is None,
            help=f"say what it stands on, `standing_on: [...]` in the mode{others}",
        )
    for name in reader.chosen_modes:
        absent = _left_out(joints, reader.modes[name])
        if absent:
            reader.error(
                Code.TEST, f"mode `{name}` leaves the drive of joint `{absent[0]}` out", "drive",
                help="name drives that are among the mode's `actuators`",
            )
    return TorqueCheck(joints=joints, minimum=minimum)


def _carried(mode: Mode) -> bool:
    """Whether something other than a simulation knows of carries the base of a mode."""
    return mode.base != "free" or mode.standing is not None or bool(mode.holds)


def _left_out(joints: Sequence[str], mode: Mode) -> list[str]:
    """Those of the `joints` (paths) whose drives a mode does without."""
    present = mode.actuators
    return [joint for joint in joints if present is not None and joint not in present]


def link(test: Test, check: TorqueCheck, joints: Mapping[str, JointEdge], findings: Findings) -> None:
    """A margin is one of a limit: a drive without one has none."""
    from thingc.model.assembly.findings import noted

    for path in check.joints:
        joint = joints.get(path)
        if joint is not None and joint.limit.effort is None:
            findings.error(
                Code.TEST, f"joint `{path}` has no limit of effort: its drive has no margin",
                (test.spans["drive"],) if "drive" in test.spans else test.origin, path=path,
                help="write `limit: {effort: ...}` on the joint, or `effort` of its drive",
                notes=noted(f"`{path}` is here", joint.origin),
            )


def run(case: Case, check: TorqueCheck) -> Outcome:
    """The least of limit by static effort among the drives named."""
    from thingc.model.assembly import joints_of
    from thingc.model.robot import body_poses
    from thingc.model.statics import static_efforts

    robot, frame = case.robot, case.frames[0]
    bodies = body_poses(robot, frame.q, frame.base)
    joints = {joint.path: joint for joint in joints_of(robot.assembly)}
    held = static_efforts(robot, frame.q, bodies)
    efforts, margins, choices = held.by_joint, held.margins, held.choices
    least = _weakest(check, margins)
    text = _effort(joints[least], efforts[least])
    limit = _effort(joints[least], joints[least].limit.effort or 0.0)
    measured: dict[str, Measure] = {
        "margin": margins[least] if math.isfinite(margins[least]) else None, "drive": least, "effort": efforts[least],
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
        notes.append(Note(message="statics alone does not determine these efforts: they are the least that hold the pose"))
        aside = ", one answer of many"
    slippery = _without_friction(robot, frame, bodies, check)
    if slippery is not None:
        measured["margin_without_friction"] = slippery
        aside += f"; {slippery:.3g} if the floor had no friction"
    failure: Failure | None = None
    if not math.isfinite(margins[least]):
        said = f"{least} carries nothing (margin at least {check.minimum:g}){aside}"
        return Outcome(measured=measured, expected=expected, said=said)
    said = f"margin {margins[least]:.3g} at {least}: {text} of {limit} (at least {check.minimum:g}){aside}"
    if margins[least] < check.minimum:
        others = [path for path in check.joints if path != least and margins[path] < check.minimum]
        notes += [
            Note(message=f"drive `{path}` holds {_effort(joints[path], efforts[path])}, a margin of {margins[path]:.3g}")
            for path in others
        ]
        failure = Failure(
            code=Code.TEST_TORQUE, key="min", notes=tuple(notes),
            message=f"drive `{least}` has to hold {text} of its {limit}: a margin of {margins[least]:.3g}, below {check.minimum:g}",
        )
    return Outcome(measured=measured, expected=expected, said=said, failure=failure)


def _weakest(check: TorqueCheck, margins: Mapping[str, float]) -> str:
    """The drive with the least margin; of those that differ by rounding, the first."""
    return min(check.joints, key=lambda path: float(f"{margins[path]:.12g}"))


def _unsteady(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose], held: Efforts) -> tuple[str, Failure] | None:
    """What is said, and the failure, where nothing holds the pose: feet in the air, a robot that falls over, a joint that gives way."""
    if robot.mode.feet:
        from thingc.model.statics import lifted, stance

        feet = stance(robot, q, bodies).feet
        high = lifted(feet)
        if high:
            listed = ", ".join(f"`{path}` by {shown(height, LENGTH)}" for path, height in high.items())
            failure = Failure(
                code=Code.TEST_FOOT, key="pose", message=f"the mode stands on feet that are above its others in this pose: {listed}",
                help="lower them in the pose, or let the mode stand on the others",
            )
            return "stands on feet in the air", failure
    if held.fall is not None:
        said, why = {
            "tips": ("falls over", f"its centre of mass is {shown(held.fall.outside, LENGTH)} outside of the polygon of its feet"),
            "slides": ("slides off", "friction does not hold its feet where they are"),
            "pulls": ("falls off", "gravity pulls it away from the floor, and nothing else presses it on"),
        }[held.fall.how]
        failure = Failure(
            code=Code.TEST_FALLS, key="pose", message=f"in this pose the robot {said}: {why}",
            help="move its feet or what is heavy, or let the mode stand on more feet",
        )
        return said, failure
    if held.unheld > SLACK:
        moves = f"joint `{held.where}`" if held.where else "the robot"
        failure = Failure(
            code=Code.TEST_TORQUE, key="drive", message=f"no effort of the drives holds this pose: {moves} would move",
            help="drive the joint, or choose a pose in which it hangs at rest",
        )
        return "does not stay in the pose", failure
    return None


def _without_friction(robot: Robot, frame: Keyframe, bodies: Sequence[Pose], check: TorqueCheck) -> float | None:
    """The least margin if the floor only pushed upwards; None where nothing stands on it, or that would not hold the robot."""
    if not any(foot.friction > 0.0 for foot in robot.mode.feet):
        return None
    from thingc.model.statics import static_efforts

    smooth = replace(robot, mode=replace(robot.mode, feet=tuple(replace(foot, friction=0.0) for foot in robot.mode.feet)))
    held = static_efforts(smooth, frame.q, bodies)
    if held.fall is not None or held.unheld > SLACK:
        return None
    least = held.margins[_weakest(check, held.margins)]
    return least if math.isfinite(least) else None


def _effort(joint: JointEdge, value: float) -> str:
    return shown(abs(value), TORQUE if joint.twist.turns else FORCE)


PAGE = """\
**Torque margin** is the effort limit of a drive by the torque (of a slide the force) that it has to give so that nothing moves:
gravity and springs, without friction in joints. Joints that mimic load the one that they follow. Where loops, holds, feet or several drives
on joints that mimic leave the torques open, two held feet for one, it is the answer with the least sum of squares of effort by limit:
one that a controller can give, though another may have a greater least margin. The answer says that it is one of many. A pose that
no effort of the drives holds fails. What carries the robot is its base, which is held for this unless it is `free`, or, of one that
is, its holds and [feet](#feet); of one that has neither it is not known.

With feet the problem is this: of all efforts of the drives, and all forces at the feet that lie in their friction cones (as far along
the floor as friction times what presses), together with those of holds, that leave the robot at rest in that pose, the efforts with
the least sum of squares. Cones are pyramids of 16 edges within them. Where no forces within the cones carry the robot, the test fails
and says how far its centre of mass is outside of the polygon of the feet, or that it slides; feet that are more than 2 % of their greatest
distance above the lowest one do not stand.

Efforts so small take a controller that pushes its feet apart or together as is best. Position drives at rest do not: robots that
were put on the floor stand there nearly without sideways forces. What they have to give then is the answer without friction, and
the test says that margin, too; `friction: 0` makes it the one that counts. Clamps are another robot: they carry moments, which no foot on
a floor does. Of a hexapod of 1.3 kg on three legs of 1.5 N m a servo (`tests/statics/hexapod`, in `thingc test` and in MuJoCo):

<!-- hexapod -->
| | least margin |
|---|---|
| least squares within the cones, friction 0.8 | 8.27 |
| the same without friction | 5.24 |
| MuJoCo, position drives at rest on the scene's floor | 5.21 |
| three points held (`carries: force`) | 8.27 |
| three clamps | 67.4 |

<!-- keys: TorqueMarginTest -->
| key | value | without it | |
|---|---|---|---|
| `drive` | driven joints, patterns allowed | an error | each needs a limit of effort |
| `mode` | modes | the first | |
| `pose` | poses | where the mode starts | |
| `min` | a number | an error | the least margin |
"""

KIND = CheckKind(
    name="torque_margin", position=6, summary="Drives hold the robot still against gravity, with a margin.",
    examples=[{"drive": "shoulder", "min": 1.5, "pose": "stretched"}],
    stub={"drive": "*", "min": "2"},
    page=PAGE, model=TorqueMarginTest, read=read, run=run, link=link,
)

"""`torque_margin`: drives hold the robot still against gravity, with a margin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pydantic import Field

from thingc.base.diagnostics import Code, noted
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.units import NUMBER
from thingc.documents.checks.kind import CheckKind
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import NumberField
from thingc.documents.spec.name_types import JointNames, ModeNames, PoseNames

if TYPE_CHECKING:
    from thingc.model.assembly.report import LinkReport
    from thingc.model.assembly.types import JointEdge
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Mode, Test


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


class TorqueCheck(OneLineRepr, FrozenStruct):
    """The effort limits of the drives of `joints` (paths) are at least `minimum` times the static effort."""

    joints: tuple[str, ...]
    minimum: float


def read_torque_margin(written: TorqueMarginTest, reader: Reader) -> TorqueCheck:
    """Read a `torque_margin` test; report modes for which the document does not specify what supports the robot."""
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
    """Return whether the base of a mode is supported by something that the document specifies."""
    return mode.base != "free" or mode.standing is not None or bool(mode.holds)


def _left_out(joints: Sequence[str], mode: Mode) -> list[str]:
    """Return the `joints` (paths) whose drives a mode does not use."""
    present = mode.actuators
    return [joint for joint in joints if present is not None and joint not in present]


def link(test: Test, check: TorqueCheck, joints: Mapping[str, JointEdge], findings: LinkReport) -> None:
    """Report drives without an effort limit, which have no margin."""

    for path in check.joints:
        joint = joints.get(path)
        if joint is not None and joint.limit.effort is None:
            findings.error(
                Code.TEST, f"joint `{path}` has no limit of effort: its drive has no margin",
                (test.spans["drive"],) if "drive" in test.spans else test.origin, path=path,
                help="write `limit: {effort: ...}` on the joint, or `effort` of its drive", notes=noted(f"`{path}` is here", joint.origin),
            )


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
    examples=[{"drive": "shoulder", "min": 1.5, "pose": "stretched"}], stub={"drive": "*", "min": "2"}, page=PAGE, model=TorqueMarginTest,
    read=read_torque_margin, link=link,
)

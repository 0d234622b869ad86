"""`settles`: the simulated robot, let go in a pose with its drives set to it, comes to rest."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pydantic import Field

from thingc.base.brief import Brief
from thingc.base.diagnostics import Code, Report
from thingc.base.frozen import dataclass
from thingc.base.units import LENGTH, TIME, Quantity
from thingc.documents.checks.kind import CheckKind
from thingc.documents.checks.outcome import Failure, Measure, Outcome, shown
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import LengthField, TimeField
from thingc.documents.spec.named import ModeNames, PoseNames

if TYPE_CHECKING:
    from thingc.driver.testing.results import Case
    from thingc.driver.testing.settling import Motion
    from thingc.model.resolve.tests import Reader

LONGEST = 600.0
"""The longest simulation [s] that a document may ask for, so that no document can keep a machine busy for ever."""
HOLD = 1.0
"""How long rest has to last [s] in a test that does not say."""
GIVES = 5e-3
"""How deep [m] contacts may be in a test that does not say: one that carries a robot gives way by less, and one that is deeper began so."""


class SettlesTest(Model):
    """The simulated robot, let go in a pose with its drives set to it, comes to rest."""

    mode: ModeNames | None = Field(default=None, examples=["bench", ["bench", "wall"]])
    """Modes, patterns allowed, or `all`; the first unless written."""
    pose: PoseNames | None = Field(default=None, examples=["home", "leg_*", ["home", "reach"]])
    """Poses, patterns allowed, or `all` keyframes of the mode; where the mode starts unless written."""
    within: TimeField
    """The time that it may take."""
    for_: TimeField | None = Field(default=None, alias="for", description="How long it has to stay at rest; 1 s unless written.")
    drift: LengthField
    """What counts as rest: from then on no point of a link is further than this from where it ends."""
    moved: LengthField | None = None
    """How far from the pose any point of a link may be in the end; any distance unless written."""
    penetration: LengthField | None = None
    """How deep contacts may give way while at rest; 5 mm unless written."""
    floor: bool = True
    """Whether there is the floor of the mode's scene (the plane z = 0 of the world)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SettleCheck(Brief):
    """In simulation every point of every link is, from `within` [s] on for `hold` [s], nearer than `drift` [m] to where it ends;
    at most `moved` [m] from the pose (None: any), with contacts at most `penetration` [m] deep."""

    within: float
    drift: float
    hold: float
    moved: float | None
    penetration: float
    floor: bool


def read(written: SettlesTest, reader: Reader) -> SettleCheck:
    """A simulation that comes to rest."""
    within = reader.number(written.within, "within", TIME, above=0.0, most=LONGEST)
    drift = reader.number(written.drift, "drift", LENGTH, above=0.0)
    hold = HOLD
    if written.for_ is not None:
        hold = reader.number(written.for_, "for", TIME, above=0.0, most=LONGEST)
    moved, penetration = None, GIVES
    if written.moved is not None:
        moved = reader.number(written.moved, "moved", LENGTH, above=0.0)
    if written.penetration is not None:
        penetration = reader.number(written.penetration, "penetration", LENGTH, above=0.0)
    return SettleCheck(within=within, drift=drift, hold=hold, moved=moved, penetration=penetration, floor=written.floor)


def run(case: Case, check: SettleCheck) -> Outcome:
    """The mode's model emitted with the pose as a keyframe, and simulated for `within` and `for` together."""
    from thingc.driver.testing.settling import simulated
    from thingc.targets.mjcf import target as mjcf
    from thingc.targets.mjcf.compat import separator

    report = Report()
    artifacts = mjcf.emit(replace(case.request, robots=(case.robot,), report=report, made={}, verify=True))
    if report.failed:
        for diagnostic in report.diagnostics:
            case.request.report.say(diagnostic)
        failure = Failure(code=Code.TEST_SETTLES, key="", message="MuJoCo does not take the model")
        return Outcome(measured={}, expected={}, said="no model", failure=failure)
    store = case.request.store
    files = {path: content if isinstance(content, bytes) else store.read(content.sha256) for path, content in artifacts.files.items()}
    scene = f"mjcf/scene_{case.robot.mode.name}.xml"
    motion = simulated(
        case.robot, case.frames[0], scene, files, seconds=check.within + check.hold, resting=check.within, floor=check.floor,
        separator=separator(case.request.compat),
    )
    return _diverged(motion) if isinstance(motion, float) else _judged(check, motion)


def _judged(check: SettleCheck, motion: Motion) -> Outcome:
    """The verdict over the paths of all points."""
    rest, drift, moved, deepest = motion.rest(check.drift), motion.drift(check.within), motion.moved, motion.deepest
    # In the last instant everything is where it ends: rest is only what lasts.
    settled = rest <= check.within + 1e-9
    measured: dict[str, Measure] = {
        "rest": rest if settled else None, "drift": drift, "moved": moved, "penetration": max(deepest, 0.0),
    }
    expected: dict[str, Measure] = {
        "within": check.within, "drift": check.drift, "for": check.hold, "penetration": check.penetration,
        **({} if check.moved is None else {"moved": check.moved}),
    }
    far, deep = shown(moved, LENGTH), shown(max(deepest, 0.0), LENGTH)
    said = f"at rest after {rest:.3g} s (drift {shown(drift, LENGTH)}), {far} from the pose, contacts {deep} deep"
    failure = None
    if not settled:
        said = f"not at rest after {check.within:g} s"
        failure = Failure(
            code=Code.TEST_SETTLES, key="within",
            message=f"after {Quantity(check.within, TIME)} it still moves by {shown(drift, LENGTH)} in "
            f"{Quantity(check.hold, TIME)}, and {Quantity(check.drift, LENGTH)} were allowed",
        )
    elif check.moved is not None and moved > check.moved:
        failure = Failure(
            code=Code.TEST_SETTLES, key="moved",
            message=f"it comes to rest {far} from the pose, and {Quantity(check.moved, LENGTH)} were allowed",
        )
    elif deepest > check.penetration:
        failure = Failure(
            code=Code.TEST_SETTLES, key="penetration",
            message=f"its contacts are {deep} deep at rest, and {Quantity(check.penetration, LENGTH)} were allowed",
            help="let it start on the floor (`at: {on: floor}` of the mode) and apart from itself; where contacts are meant to be as soft, "
            "write a larger `penetration`",
        )
    return Outcome(measured=measured, expected=expected, said=said, failure=failure)


def _diverged(time: float) -> Outcome:
    failure = Failure(
        code=Code.TEST_SETTLES, key="", message=f"the simulation diverges after {time:.3g} s",
        help="take a smaller `simulation: {timestep: ...}`, or look for parts that overlap in the pose",
    )
    return Outcome(measured={"diverged": time}, expected={}, said=f"diverges after {time:.3g} s", failure=failure)


PAGE = """\
**Settles** simulates the mode's MuJoCo scene, as `build` writes it, from the keyframe of the pose with the drives set to it. After
`within` the robot has to be at rest, and to stay so for the time `for`. What is looked at are the corners of the boxes around
all parts.

<!-- keys: SettlesTest -->
| key | value | without it | |
|---|---|---|---|
| `mode` | modes | the first | |
| `pose` | poses | where the mode starts | |
| `within` | a time, at most 600 s | an error | the time that it may take |
| `for` | a time, at most 600 s | `1 s` | how long it has to stay at rest |
| `drift` | a length | an error | rest: no point is further than this from where it ends |
| `moved` | a length | any | how far from the pose a point may end |
| `penetration` | a length | `5 mm` | how deep contacts may give way at rest |
| `floor` | flag | `true` | with the floor of the scene, the plane z = 0 of the world |
"""

KIND = CheckKind(
    name="settles", position=7, summary="The simulated robot comes to rest.", examples=[{"within": "2 s", "drift": "1 mm"}],
    stub={"within": "2 s", "drift": "1 mm"},
    page=PAGE,
    model=SettlesTest, read=read, run=run,
)

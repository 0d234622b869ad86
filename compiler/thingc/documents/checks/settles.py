"""`settles`: the simulated robot, let go in a pose with its drives set to it, comes to rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.units import LENGTH, TIME
from thingc.documents.checks.kind import CheckKind
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import LengthField, TimeField
from thingc.documents.spec.name_types import ModeNames, PoseNames

if TYPE_CHECKING:
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


class SettleCheck(OneLineRepr, FrozenStruct):
    """In simulation every point of every link is, from `within` [s] on for `hold` [s], nearer than `drift` [m] to where it ends;
    at most `moved` [m] from the pose (None: any), with contacts at most `penetration` [m] deep."""

    within: float
    drift: float
    hold: float
    moved: float | None
    penetration: float
    floor: bool


def read_settles(written: SettlesTest, reader: Reader) -> SettleCheck:
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


PAGE = """\
## Settles

Simulates the mode's MuJoCo scene, as written by `build`, from the keyframe of the pose with the drives set to it. After `within`, the
robot must be at rest and stay so for the time `for`. The test tracks the corners of the bounding boxes of all parts.

<!-- keys: SettlesTest -->
| Key | Type | Default | Description |
|---|---|---|---|
| `mode` | modes | the first | |
| `pose` | poses | where the mode starts | |
| `within` | a time, at most 600 s | required | time until rest |
| `for` | a time, at most 600 s | `1 s` | time of rest |
| `drift` | a length | required | largest distance of a point from its final position, at rest |
| `moved` | a length | any | largest distance of a final position from the pose |
| `penetration` | a length | `5 mm` | largest penetration of contacts at rest |
| `floor` | flag | `true` | adds the floor of the scene, the plane z = 0 of the world |
"""

KIND = CheckKind(
    name="settles", position=7, summary="The simulated robot comes to rest.", examples=[{"within": "2 s", "drift": "1 mm"}],
    stub={"within": "2 s", "drift": "1 mm"}, lengths=("drift", "moved", "penetration"),
    page=PAGE,
    model=SettlesTest, read=read_settles,
)

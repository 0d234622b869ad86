"""The document test `settles`: the robot must come to rest in a simulation that starts in a pose, with drives commanded to this pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from thingc.base.one_line_repr import OneLineStruct
from thingc.base.units import LENGTH, TIME
from thingc.documents.checks.kind import CheckKind
from thingc.documents.spec.base import Model, optional
from thingc.documents.spec.fields import LengthField, TimeField
from thingc.documents.spec.name_types import ModeNames, PoseNames

if TYPE_CHECKING:
    from thingc.model.resolve.tests import Reader

LONGEST = 600.0
"""Longest simulated time [s] that a document can request. The limit prevents simulations that would not end in practice."""
HOLD = 1.0
"""Default time [s] for which the robot must be at rest."""
GIVES = 5e-3
"""Default for the largest allowed depth [m] of contacts. Contacts that support a robot are less deep. A larger depth means that the bodies
overlapped at the start.
"""


class SettlesTest(Model):
    """The simulated robot must come to rest after it is released in a pose, while its drives are commanded to this pose."""

    mode: ModeNames | None = optional("bench", ["bench", "wall"])
    """Names or patterns of modes, or `all`; default: the first mode."""
    pose: PoseNames | None = optional("home", "leg_*", ["home", "reach"])
    """Names or patterns of poses, or `all` keyframes of the mode; default: the start pose of the mode."""
    within: TimeField
    """The time within which the robot must come to rest."""
    for_: TimeField | None = Field(default=None, alias="for", description="How long the robot must stay at rest; default: 1 s.")
    drift: LengthField
    """The largest allowed distance of any point of a link from its final position while the robot is at rest."""
    moved: LengthField | None = None
    """The largest allowed distance of any point of a link, at the end, from its position in the pose; default: unlimited."""
    penetration: LengthField | None = None
    """The largest allowed penetration of contacts at rest; default: 5 mm."""
    floor: bool = True
    """Whether to add the floor of the mode's scene (the plane z = 0 of the world)."""


class SettleCheck(OneLineStruct):
    """A parsed `settles` test.

    The test requires every point of every link to stay within `drift` [m] of its final position for `hold` [s], beginning at the time
    `within` [s]. The final position of a point must be at most `moved` [m] from its position in the pose (None: any distance). Contacts
    must be at most `penetration` [m] deep.
    """

    within: float
    drift: float
    hold: float
    moved: float | None
    penetration: float
    floor: bool


def read_settles(spec: SettlesTest, reader: Reader) -> SettleCheck:
    """Parse the keys of a `settles` test."""
    within = reader.number(spec.within, "within", TIME, above=0.0, most=LONGEST)
    drift = reader.number(spec.drift, "drift", LENGTH, above=0.0)
    hold = reader.number(spec.for_, "for", TIME, above=0.0, most=LONGEST, default=HOLD)
    moved = None if spec.moved is None else reader.number(spec.moved, "moved", LENGTH, above=0.0)
    penetration = reader.number(spec.penetration, "penetration", LENGTH, above=0.0, default=GIVES)
    return SettleCheck(within=within, drift=drift, hold=hold, moved=moved, penetration=penetration, floor=spec.floor)


KIND = CheckKind(
    name="settles", position=7, summary="The simulated robot comes to rest.", examples=[{"within": "2 s", "drift": "1 mm"}],
    stub={"within": "2 s", "drift": "1 mm"}, lengths=("drift", "moved", "penetration"),
    model=SettlesTest, read=read_settles,
)

"""The `tests:` block of an `assembly/1` document: what has to be true of the robot, one named test each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from thingc.spec.base import Model
from thingc.spec.fields import (
    AngleField,
    CountField,
    LengthField,
    MassField,
    NumberField,
    ReferenceField,
    TimeField,
    Value,
    Vector3Length,
    fault,
    quantity,
)
from thingc.units import ANGLE, LENGTH

if TYPE_CHECKING:
    JointBoundField = Value
else:
    JointBoundField = quantity(ANGLE, LENGTH)

Names = str | Annotated[list[str], Field(min_length=1)]


def _bounded(test: MassTest | ReachTest, kind: str, example: str) -> None:
    if test.min is None and test.max is None:
        raise fault("rule", f"a `{kind}` test needs `min`, `max` or both; none is here", help=f"write for example `{example}`")


_BOUNDED = ConfigDict(json_schema_extra={"anyOf": [{"required": ["min"]}, {"required": ["max"]}]})


class MassTest(Model):
    """The mass is within bounds."""

    model_config = _BOUNDED

    of: ReferenceField | None = None
    """A component, or several by a pattern; a nested assembly counts as a whole. The whole robot unless written."""
    min: MassField | None = None
    """The smallest mass allowed."""
    max: MassField | None = None
    """The largest mass allowed."""

    @model_validator(mode="after")
    def _bounds(self) -> MassTest:
        _bounded(self, "mass", "max: 2.2 kg")
        return self


Interval = Annotated[list[LengthField], Field(min_length=2, max_length=2)]


class WithinSpec(Model):
    """A box, axis by axis: smallest and largest value. An axis that is not written is free."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1})

    x: Interval | None = Field(default=None, examples=[["-10 mm", "10 mm"]])
    """Smallest and largest value along x."""
    y: Interval | None = Field(default=None, examples=[["-10 mm", "10 mm"]])
    """Smallest and largest value along y."""
    z: Interval | None = Field(default=None, examples=[[0, "120 mm"]])
    """Smallest and largest value along z."""

    @model_validator(mode="after")
    def _one(self) -> WithinSpec:
        if self.x is None and self.y is None and self.z is None:
            raise fault(
                "rule", "`within` bounds at least one of `x`, `y` and `z`; none is here", help="write for example `x: [-10 mm, 10 mm]`",
            )
        return self


class CentreTest(Model):
    """The centre of mass lies within a box."""

    of: ReferenceField | None = None
    """A component, or several by a pattern; the whole robot unless written."""
    in_: ReferenceField | None = Field(
        default=None, alias="in", description="The frame, a mount; the world of the mode unless written.",
    )
    mode: Names | None = Field(default=None, examples=["bench", ["bench", "wall"]])
    """Modes, patterns allowed, or `all`; the first unless written."""
    pose: Names | None = Field(default=None, examples=["home", "leg_*", ["home", "reach"]])
    """Poses, patterns allowed, or `all` keyframes of the mode; where the mode starts unless written."""
    within: WithinSpec = Field(examples=[{"x": ["-10 mm", "10 mm"], "y": ["-10 mm", "10 mm"]}])
    """Bounds on its coordinates in that frame."""


class ReachTest(Model):
    """The greatest distance of two mounts, over the ranges of all joints."""

    model_config = _BOUNDED

    of: ReferenceField
    """The mount that reaches."""
    from_: ReferenceField = Field(alias="from", description="The mount that the distance is measured from.")
    min: LengthField | None = None
    """The least that the greatest distance has to be."""
    max: LengthField | None = None
    """The most that the greatest distance may be. What is found is a lower bound: this can be refuted, not proven."""

    @model_validator(mode="after")
    def _bounds(self) -> ReachTest:
        _bounded(self, "reach", "min: 300 mm")
        return self


class PointTest(Model):
    """A mount can be brought to a point, with every joint within its limits."""

    model_config = ConfigDict(json_schema_extra={"dependentRequired": {"angle": ["direction"]}})

    mount: ReferenceField
    """The mount that has to get there."""
    mode: Names | None = Field(default=None, examples=["bench", ["bench", "wall"]])
    """Modes, patterns allowed, or `all`; the first unless written."""
    in_: ReferenceField | None = Field(
        default=None, alias="in", description="The point's frame, a mount; the world of the mode unless written.",
    )
    at: Vector3Length
    """The point."""
    within: LengthField
    """How near its origin has to come."""
    direction: Annotated[list[NumberField], Field(min_length=3, max_length=3)] | None = Field(default=None, examples=[[0, 0, -1]])
    """Where the z axis of the mount has to point then, in the same frame: three numbers, of any length."""
    angle: AngleField | None = None
    """How far off that direction it may be; 1 deg unless written."""

    @model_validator(mode="after")
    def _angle(self) -> PointTest:
        if self.angle is not None and self.direction is None:
            raise fault(
                "rule", "`angle` says how exactly `direction` is met; there is none", help="write for example `direction: [0, 0, -1]`",
            )
        return self


class AllowSpec(Model):
    """Two components that may touch, and why."""

    pair: Annotated[list[ReferenceField], Field(min_length=2, max_length=2)] = Field(examples=[["finger_*", "palm"]])
    """The two; patterns allowed, and a nested assembly stands for all its components."""
    reason: str = Field(examples=["the gripper closes on its stop"])
    """Why it is right that they touch: for whoever reviews the document."""

    @model_validator(mode="after")
    def _said(self) -> AllowSpec:
        if not self.reason.strip():
            raise fault("rule", "an allowance needs a reason; this one is empty", help="say why these two may touch")
        return self


class NoCollisionTest(Model):
    """No two components that move against each other overlap, or come too near, in poses or over ranges of joints."""

    model_config = ConfigDict(json_schema_extra={"dependentRequired": {"samples": ["joints"]}})

    mode: Names | None = Field(default=None, examples=["bench", ["bench", "wall"]])
    """Modes, patterns allowed, or `all`; the first unless written."""
    pose: Names | None = Field(default=None, examples=["home", "leg_*", ["home", "reach"]])
    """Poses, patterns allowed, or `all` keyframes of the mode; where the mode starts unless written."""
    joints: dict[str, Literal["all"] | Annotated[list[JointBoundField], Field(min_length=2, max_length=2)]] = Field(
        default={}, examples=[{"elbow": "all", "yaw": ["-30 deg", "30 deg"]}],
    )
    """Ranges to move through, by joint (patterns allowed): `all` of its limits, or from and to. Other joints stay in the pose."""
    samples: CountField | None = None
    """How many positions of `joints` are looked at; 200 unless written."""
    clearance: LengthField | None = None
    """The least gap wanted; 0 unless written: touching is right, overlapping is not."""
    allow: list[AllowSpec] = Field(default=[], examples=[[{"pair": ["finger_*", "palm"], "reason": "the gripper closes on its stop"}]])
    """Pairs that may come nearer, each with a reason."""

    @model_validator(mode="after")
    def _sweep(self) -> NoCollisionTest:
        if self.samples is not None and not self.joints:
            raise fault(
                "rule", "`samples` belongs to a sweep over `joints`; there are none",
                help="take it out, or write for example `joints: {elbow: all}`",
            )
        return self


class TorqueMarginTest(Model):
    """Drives hold the robot still against gravity, with a margin: their effort limit over the static torque."""

    drive: Names = Field(examples=["shoulder", ["shoulder", "leg_*"]])
    """Driven joints, patterns allowed."""
    mode: Names | None = Field(default=None, examples=["bench", ["bench", "wall"]])
    """Modes whose base is `fixed` or `held`, patterns allowed, or `all`; the first unless written."""
    pose: Names | None = Field(default=None, examples=["home", "leg_*", ["home", "reach"]])
    """Poses, patterns allowed, or `all` keyframes of the mode; where the mode starts unless written."""
    min: NumberField
    """The least margin: 1.5 asks for a limit of 1.5 times the torque that is needed."""


class SettlesTest(Model):
    """The simulated robot, let go in a pose with its drives set to it, comes to rest."""

    mode: Names | None = Field(default=None, examples=["bench", ["bench", "wall"]])
    """Modes, patterns allowed, or `all`; the first unless written."""
    pose: Names | None = Field(default=None, examples=["home", "leg_*", ["home", "reach"]])
    """Poses, patterns allowed, or `all` keyframes of the mode; where the mode starts unless written."""
    within: TimeField
    """The time that it may take."""
    for_: TimeField | None = Field(default=None, alias="for", description="How long it has to stay at rest; 1 s unless written.")
    drift: LengthField
    """What counts as rest: from then on no point of a link is further than this from where it ends."""
    moved: LengthField | None = None
    """How far from the pose any point of a link may be in the end; any distance unless written."""
    penetration: LengthField | None = None
    """How deep contacts may give way while at rest; any depth unless written."""
    floor: bool = True
    """Whether there is the floor of the mode's scene (the plane z = 0 of the world)."""


KINDS = ("mass", "centre", "reach", "point", "no_collision", "torque_margin", "settles")
"""The kinds of test, in the order of the documentation."""


class TestSpec(Model):
    """One named test: exactly one of its keys, which says the kind."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    mass: MassTest | None = Field(default=None, examples=[{"max": "2.2 kg"}])
    """The mass is within bounds."""
    centre: CentreTest | None = Field(default=None, examples=[{"within": {"x": ["-10 mm", "10 mm"]}}])
    """The centre of mass lies within a box."""
    reach: ReachTest | None = Field(default=None, examples=[{"of": "hand.tip", "from": "plate.bottom", "min": "300 mm"}])
    """The greatest distance of two mounts, over the ranges of all joints."""
    point: PointTest | None = Field(default=None, examples=[{"mount": "hand.tip", "at": "200 0 50 mm", "within": "1 mm"}])
    """A mount can be brought to a point."""
    no_collision: NoCollisionTest | None = Field(
        default=None, examples=[{"pose": "all"}, {"joints": {"elbow": "all"}, "clearance": "1 mm"}],
    )
    """Nothing overlaps, in poses or over ranges of joints."""
    torque_margin: TorqueMarginTest | None = Field(default=None, examples=[{"drive": "shoulder", "min": 1.5, "pose": "stretched"}])
    """Drives hold the robot still against gravity, with a margin."""
    settles: SettlesTest | None = Field(default=None, examples=[{"within": "2 s", "drift": "1 mm"}])
    """The simulated robot comes to rest."""

    @model_validator(mode="after")
    def _one_kind(self) -> TestSpec:
        kinds = [kind for kind in KINDS if getattr(self, kind) is not None]
        if not kinds:
            raise fault("rule", "a test needs a kind; none is here", help="write for example `{mass: {max: 2.2 kg}}`")
        if len(kinds) > 1:
            raise fault(
                "rule", f"a test has one kind; here are {' and '.join(f'`{kind}`' for kind in kinds)}",
                help="make two tests of it, each with a name of its own",
            )
        return self

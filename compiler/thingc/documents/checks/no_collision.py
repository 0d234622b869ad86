"""The document test `no_collision`: parts must not collide with each other, in poses or over ranges of joints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import ConfigDict, Field

from thingc.base.diagnostics import Code
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.source import Origin
from thingc.base.units import ANGLE, LENGTH, NUMBER
from thingc.documents.checks.kind import CheckKind
from thingc.documents.spec.base import Model, optional, rule
from thingc.documents.spec.fields import CountField, LengthField, Value, quantity
from thingc.documents.spec.name_types import ComponentField, JointPattern, ModeNames, PoseNames

if TYPE_CHECKING:
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import JointRange, Reference

JointBoundField = Annotated[Value, quantity(ANGLE, LENGTH)]

SAMPLES = 200
"""Default number of joint positions at which a sweep over joint ranges is checked."""
MOST_SAMPLES = 10_000


class AllowSpec(Model):
    """Two components that may touch, and the reason."""

    pair: Annotated[list[ComponentField], Field(min_length=2, max_length=2)] = Field(examples=[["finger_*", "palm"]])
    """The names of the two components. Patterns are allowed. The name of a nested assembly means all its components."""
    reason: str = Field(examples=["the gripper closes on its stop"])
    """The reason why the contact is acceptable."""

    def _check_rules(self) -> None:
        if not self.reason.strip():
            raise rule("`reason` must not be empty", "explain why the two components may touch")


class NoCollisionTest(Model):
    """No two components may overlap or come too close to each other, in poses or over ranges of joints."""

    model_config = ConfigDict(json_schema_extra={"dependentRequired": {"samples": ["joints"], "certify": ["joints"]}})

    mode: ModeNames | None = optional("bench", ["bench", "wall"])
    """Names or patterns of modes, or `all`; default: the first mode."""
    pose: PoseNames | None = optional("home", "leg_*", ["home", "reach"])
    """Names or patterns of poses, or `all` keyframes of the mode; default: the start pose of the mode."""
    joints: (
        Literal["all"] | Annotated[list[JointPattern], Field(min_length=1)]
        | dict[JointPattern, Literal["all"] | Annotated[list[JointBoundField], Field(min_length=2, max_length=2)]]
    ) = Field(default={}, examples=["all", ["elbow", "yaw"], {"elbow": "all", "yaw": ["-30 deg", "30 deg"]}])
    """The joints that move: `all`, a list of joint names or patterns, or ranges by joint name or pattern. A range is `all` for the limits
    of a joint, or two positions. Other joints stay in the pose.
    """
    samples: CountField | None = None
    """Number of joint positions that are checked in the ranges of `joints`; default: 200."""
    certify: bool | Literal["references"] = Field(default=False, examples=[True, "references"])
    """Whether to prove the result for all positions of the ranges, as far as possible; default: `false`. With `references`, only parts at
    joints are compared, each with the part that its mount was designed for.
    """
    clearance: LengthField | None = None
    """The smallest allowed gap between two components; default: 0, which allows contact but no overlap."""
    allow: list[AllowSpec] = Field(default=[], examples=[[{"pair": ["finger_*", "palm"], "reason": "the gripper closes on its stop"}]])
    """Pairs of components that may touch or overlap, each with a reason."""

    def _check_rules(self) -> None:
        for key in ("samples", "certify"):
            if getattr(self, key) and not self.joints:
                raise rule(f"`{key}` requires `joints`", f"remove `{key}`, or add, for example, `joints: {{elbow: all}}`")


class AllowedContact(OneLineStruct):
    """Pairs of components that may touch: every component in `one` and every component in `other`.

    `text` is the display name of the pairs.
    """

    one: tuple[Reference, ...]
    other: tuple[Reference, ...]
    text: str
    reason: str
    origin: Origin


class CollisionCheck(OneLineStruct):
    """A parsed `no_collision` test.

    The test requires that no components overlap, and that components on links without a common joint are at least `clearance` [m] apart. If
    `ranges` is given, `samples` joint positions in these ranges are checked. With `certify`, all positions are checked as far as possible,
    and with `references`, only for parts at joints whose mounts were designed for each other.
    """

    ranges: tuple[JointRange, ...]
    samples: int
    certify: bool | Literal["references"]
    clearance: float
    allow: tuple[AllowedContact, ...]


def read_no_collision(spec: NoCollisionTest, reader: Reader) -> CollisionCheck:
    """Parse the keys of a `no_collision` test."""
    samples = reader.number(spec.samples, "samples", NUMBER, least=1.0, most=float(MOST_SAMPLES), default=float(SAMPLES))
    if samples % 1.0 > 0.0:
        reader.error(Code.VALUE_KIND, f"`samples` must be a whole number, found {samples:g}", "samples")
    return CollisionCheck(
        samples=int(samples) if reader.sound else SAMPLES, ranges=tuple(reader.ranges(spec.joints, "joints")),
        certify=spec.certify,
        clearance=reader.number(spec.clearance, "clearance", LENGTH, least=0.0, default=0.0),
        allow=tuple(_read_allowance(entry, reader, index) for index, entry in enumerate(spec.allow)),
    )


def _read_allowance(entry: AllowSpec, reader: Reader, index: int) -> AllowedContact:
    """Parse an entry under `allow`: a pair of components that may touch each other, and the reason."""
    first, second = (reader.components(text, ("allow", index, "pair", side)) for side, text in enumerate(entry.pair))
    return AllowedContact(
        one=first, other=second, text=f"`{entry.pair[0]}` and `{entry.pair[1]}`", reason=entry.reason.strip(),
        origin=reader.origin(("allow", index, "pair")),
    )


KIND = CheckKind(
    name="no_collision", position=5, summary="No parts overlap, in poses or over ranges of joints.",
    examples=[{"pose": "all"}, {"joints": {"elbow": "all"}, "clearance": "1 mm"}, {"joints": "all", "certify": True}],
    stub={"pose": "all"}, lengths=("clearance", "gap", "overlap"), model=NoCollisionTest, read=read_no_collision, of_limits=True,
)

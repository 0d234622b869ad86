"""`no_collision`: parts do not collide with each other, in poses or over ranges of joints."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from thingc.base.diagnostics import Code, DiagnosticCode, Note, Report, allow_hint
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr, counted
from thingc.base.source import Origin
from thingc.base.units import ANGLE, LENGTH, NUMBER, Quantity
from thingc.documents.checks.kind import CheckKind
from thingc.documents.spec.base import Model, rule
from thingc.documents.spec.fields import CountField, LengthField, Value, quantity
from thingc.documents.spec.name_types import ComponentField, JointPattern, ModeNames, PoseNames
from thingc.driver.testing.outcomes import Failure, Measure, Outcome, shown

if TYPE_CHECKING:
    from thingc.driver.testing.collisions import Collisions, NearPair
    from thingc.driver.testing.outcomes import TestCase
    from thingc.model.assembly.types import Assembly, LinkedTest
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import JointRange, NamedPose, Reference

JointBoundField = Annotated[Value, quantity(ANGLE, LENGTH)]

SAMPLES = 200
"""Default number of positions of a sweep."""
MOST_SAMPLES = 10_000


class CollisionCode(DiagnosticCode):
    """Diagnostic codes of `no_collision` tests."""

    TEST_COLLISION = ("TC655", "parts that collide", "Change a part, a pose or a range, or allow the pair with a reason.")


class AllowSpec(Model):
    """Two components that may touch, and the reason."""

    pair: Annotated[list[ComponentField], Field(min_length=2, max_length=2)] = Field(examples=[["finger_*", "palm"]])
    """The two components; patterns allowed; a nested assembly means all its components."""
    reason: str = Field(examples=["the gripper closes on its stop"])
    """The reason why contact is acceptable, for reviewers of the document."""

    @model_validator(mode="after")
    def _said(self) -> AllowSpec:
        if not self.reason.strip():
            raise rule("`reason` must not be empty", "explain why these two may touch")
        return self


class NoCollisionTest(Model):
    """No two components overlap or come too close, in poses or over ranges of joints."""

    model_config = ConfigDict(json_schema_extra={"dependentRequired": {"samples": ["joints"]}})

    mode: ModeNames | None = Field(default=None, examples=["bench", ["bench", "wall"]])
    """Names or patterns of modes, or `all`; default: the first mode."""
    pose: PoseNames | None = Field(default=None, examples=["home", "leg_*", ["home", "reach"]])
    """Names or patterns of poses, or `all` keyframes of the mode; default: the start pose of the mode."""
    joints: dict[JointPattern, Literal["all"] | Annotated[list[JointBoundField], Field(min_length=2, max_length=2)]] = Field(
        default={}, examples=[{"elbow": "all", "yaw": ["-30 deg", "30 deg"]}],
    )
    """Ranges to move through, by joint (patterns allowed): `all` for its limits, or from and to. Other joints stay in the pose."""
    samples: CountField | None = None
    """Number of checked positions of `joints`; default: 200."""
    clearance: LengthField | None = None
    """The smallest allowed gap; default: 0, which allows contact but no overlap."""
    allow: list[AllowSpec] = Field(default=[], examples=[[{"pair": ["finger_*", "palm"], "reason": "the gripper closes on its stop"}]])
    """Pairs that may come closer, each with a reason."""

    @model_validator(mode="after")
    def _sweep(self) -> NoCollisionTest:
        if self.samples is not None and not self.joints:
            help = "remove it, or add for example `joints: {elbow: all}`"
            raise rule("`samples` needs `joints`", help)
        return self


class AllowedContact(OneLineRepr, FrozenStruct):
    """Components that may touch: every component of `one` with every component of `other`. `text` is the display name of the pair."""

    one: tuple[Reference, ...]
    other: tuple[Reference, ...]
    text: str
    reason: str
    origin: Origin


class CollisionCheck(OneLineRepr, FrozenStruct):
    """Requires that no components overlap, and that components on links without a common joint are at least `clearance` [m] apart.

    With `ranges`, the requirement applies at `samples` positions in these ranges.
    """

    ranges: tuple[JointRange, ...]
    samples: int
    clearance: float
    allow: tuple[AllowedContact, ...]


def read_no_collision(written: NoCollisionTest, reader: Reader) -> CollisionCheck:
    """Read a `no_collision` test."""
    samples = SAMPLES
    if written.samples is not None:
        wanted = reader.number(written.samples, "samples", NUMBER, least=1.0, most=float(MOST_SAMPLES))
        if wanted % 1.0 > 0.0:
            reader.error(Code.VALUE_KIND, f"`samples` must be a whole number, found {wanted:g}", "samples")
        samples = int(wanted) if reader.sound else SAMPLES
    clearance = 0.0
    if written.clearance is not None:
        clearance = reader.number(written.clearance, "clearance", LENGTH, least=0.0)
    return CollisionCheck(
        ranges=tuple(reader.ranges(written.joints, "joints")), samples=samples, clearance=clearance,
        allow=tuple(_allowance(said, reader, index) for index, said in enumerate(written.allow)),
    )


def _allowance(said: AllowSpec, reader: Reader, index: int) -> AllowedContact:
    """Read a pair that may touch."""
    one, other = (reader.components(text, ("allow", index, "pair", side)) for side, text in enumerate(said.pair))
    return AllowedContact(
        one=one, other=other, text=f"`{said.pair[0]}` and `{said.pair[1]}`", reason=said.reason.strip(),
        origin=reader.origin(("allow", index, "pair")),
    )


LISTED = 5
"""Maximum number of additional pairs in a message."""


def poses(check: CollisionCheck, pose: NamedPose) -> Sequence[NamedPose]:
    """Return all positions of a sweep, or the pose itself."""
    from thingc.driver.testing.poses import swept

    return swept(pose, check.ranges, check.samples) if check.ranges else [pose]


def measure(case: TestCase, check: CollisionCheck) -> Outcome:
    """Measure gaps and overlaps in a pose, or at the positions of a sweep."""
    from thingc.driver.testing.collisions import LOOK, collisions_of
    from thingc.model.robot.kinematics import occurrence_poses

    collisions = collisions_of(case.request)
    allowed = _allowed(case.linked, check)
    nearest: NearPair | None = None
    worst: dict[tuple[int, int], NearPair] = {}
    needed: set[int] = set()
    seen: set[object] = set()
    for frame in case.frames:
        at = occurrence_poses(case.robot, frame.q, frame.base)
        look = LOOK if nearest is None else nearest.gap
        close = collisions.overlapping(at, frame, allowed, seen if check.ranges else None)
        for near in chain(collisions.near(at, frame, check.clearance, look, allowed, needed), close):
            wrong = collisions.wrong(near, check.clearance)
            if near.allowance is not None:
                needed.update((near.allowance,) if wrong else ())
                continue
            if nearest is None or near.gap < nearest.gap:
                nearest = near
            pair = near.one, near.other
            if wrong and (pair not in worst or near.badness > worst[pair].badness):
                worst[pair] = near
    compared = len(collisions.pairs) + len(collisions.close)
    measured: dict[str, Measure] = {"gap": nearest.gap if nearest is not None else None, "positions": len(case.frames), "pairs": compared}
    if collisions.skipped:
        measured["skipped"] = {reason: list(pairs) for reason, pairs in collisions.skipped.items()}
    if case.missing:
        measured["not_closing"] = case.missing
    if nearest is not None:
        measured["pair"] = _pair_text(collisions.assembly, nearest, "")
    looked = f", {counted(len(case.frames), 'position')}" if check.ranges else ""
    looked += f", {case.missing} more that do not close" if case.missing else ""
    failure: Failure | None = None
    if worst:
        failure = _failure(case, check, sorted(worst.values(), key=lambda near: near.badness, reverse=True), collisions)
        measured["overlap"] = max(near.depth for near in worst.values())
        said = "1 pair collides" if len(worst) == 1 else f"{len(worst)} pairs collide"
    elif nearest is None:
        said = f"every gap between links without a common joint is over {Quantity(LOOK, LENGTH)}"
    else:
        said = f"least gap {shown(nearest.gap, LENGTH)}, {_pair_text(collisions.assembly, nearest, '')}"
    return Outcome(
        measured=measured, expected={"clearance": check.clearance}, failure=failure, needed=frozenset(needed),
        said=f"{said}{looked}; {counted(compared, 'pair')} compared{_skipped_text(collisions)}",
    )


def finish(linked: LinkedTest, outcomes: Sequence[Outcome], report: Report) -> None:
    """Warn of allowances that no case needed."""
    check: CollisionCheck = linked.test.check
    needed = {number for outcome in outcomes for number in outcome.needed}
    for number, allowance in enumerate(check.allow):
        if number not in needed:
            report.warn(
                Code.TEST_ALLOWANCE, f"test `{linked.test.name}` allows {allowance.text} to collide, but they never do",
                allowance.origin, path=f"tests.{linked.test.name}", help="remove the pair from `allow`",
                notes=[Note(message=f"the reason given is: {allowance.reason}")],
            )


def _allowed(linked: LinkedTest, check: CollisionCheck) -> dict[tuple[int, int], int]:
    """Return the index of the first matching allowance, by pair of occurrences."""
    allowed: dict[tuple[int, int], int] = {}
    for number, allowance in enumerate(check.allow):
        ones, others = (
            [index for reference in side for index in linked.components[reference]] for side in (allowance.one, allowance.other)
        )
        for a in ones:
            for b in others:
                allowed.setdefault((min(a, b), max(a, b)), number)
    return allowed


def _failure(case: TestCase, check: CollisionCheck, worst: Sequence[NearPair], collisions: Collisions) -> Failure:
    """Format the worst pair as the message, and the other pairs as notes."""
    assembly, first = collisions.assembly, worst[0]
    notes = [Note(message=f"also {_how(assembly, near, check.clearance)}{_at(case, check, near)}") for near in worst[1 : LISTED + 1]]
    if len(worst) > LISTED + 1:
        notes.append(Note(message=f"and {counted(len(worst) - LISTED - 1, 'more pair')}"))
    notes += [
        Note(message=f"the surface of `{path}` is not closed: its convex hull is used instead")
        for path in collisions.hulls if path in (assembly.occurrences[first.one].path, assembly.occurrences[first.other].path)
    ]
    names = ", ".join(assembly.occurrences[index].path.replace("/", ".") for index in (first.one, first.other))
    return Failure(
        code=CollisionCode.TEST_COLLISION, key="clearance" if first.gap > 0.0 else "", notes=tuple(notes),
        message=f"{_how(assembly, first, check.clearance)}{_at(case, check, first)}",
        help=f"{allow_hint(Code.OVERLAP)} on one of the two" if (first.one, first.other) in collisions.close
        else f'if this is intended, add `allow: [{{pair: [{names}], reason: "..."}}]`',
    )


def _skipped_text(collisions: Collisions) -> str:
    """Describe the skipped pairs with the reasons. The JSON output lists all skipped pairs."""
    return "".join(
        f", {counted(len(pairs), 'pair')} skipped ({reason}: {next(iter(pairs))}{', ...' if len(pairs) > 1 else ''})"
        for reason, pairs in collisions.skipped.items()
    )


def _pair_text(assembly: Assembly, near: NearPair, tick: str) -> str:
    one, other = (assembly.occurrences[index].path for index in (near.one, near.other))
    return f"{tick}{one}{tick} and {tick}{other}{tick}"


def _how(assembly: Assembly, near: NearPair, clearance: float) -> str:
    text = _pair_text(assembly, near, "`")
    if near.gap > 0.0:
        return f"{text} are {shown(near.gap, LENGTH)} apart, but at least {Quantity(clearance, LENGTH)} is required"
    if near.depth == 0.0:
        return f"{text} touch, but a gap of {Quantity(clearance, LENGTH)} is required"
    return f"{text} overlap by {shown(near.depth, LENGTH)} on average ({float(f'{1e9 * near.volume:.3g}'):g} mm^3)"


def _at(case: TestCase, check: CollisionCheck, near: NearPair) -> str:
    """Return a description of the position in a sweep."""
    from thingc.driver.testing.poses import joints_text

    if not check.ranges:
        return ""
    return f" at {joints_text(case.robot.assembly, {r.joint: near.where.q[r.joint] for r in check.ranges})}"


PAGE = """\
## No collision

Compares the true shapes of all pairs of parts, tessellated with the workspace's `mesh` tolerance. [Collision
shapes](shapes.md#collision) and `contacts.exclude` are ignored. Parts can touch. An overlap fails the test if its mean depth (twice its
volume divided by its surface) is more than twice the linear mesh tolerance.

- Parts on the same link, or on two links connected by a joint, are expected to touch. For these pairs, only overlaps fail the test.
- For all other pairs, the gap is also measured. With `clearance`, a smaller gap fails the test. To measure the gap of an open mesh,
  thingc uses its convex hull.
- For a [link of shapes](shapes.md#links-of-shapes), the test uses the collision shapes, or the visual shapes if the link has no
  collision shapes. Boxes, spheres and capsules are exact. Cylinders and ellipsoids are approximated to 0.1 % of their radius. Planes
  are infinite.
- To allow an intended overlap, such as a press fit, add `allow: {TC520: reason}` to one of the two components or to the joint between
  them. This test and [`build`](../codes/TC520.md) then accept the overlap. To allow a pair only in this test, use `allow` of the test.
- The result lists skipped pairs with the reason (`skipped` in the JSON output). Allowed overlaps are skipped, and pairs that are
  expected to touch if a shape is approximate or its surface is open.

With `joints`, the test moves these joints through their ranges; the others stay in the pose. A single joint moves in equal steps. For
several joints, the test checks the corners of their ranges, then evenly distributed positions. The positions are the same in every run.
Positions between them are not checked. For pairs that are expected to touch, positions that differ by less than about 6 degrees and 2
mm are checked only once.

<!-- keys: NoCollisionTest -->
| Key | Type | Default | Description |
|---|---|---|---|
| `mode` | modes | the first mode | |
| `pose` | poses | the mode's own pose | |
| `joints` | mapping of joints to `all` or two positions | none | joints to move; patterns allowed; an exact name takes precedence |
| `samples` | a whole number | `200` | number of positions, at most 10 000 |
| `clearance` | a length | `0` | smallest allowed gap |
| `allow` | list | none | pairs that may come closer |

<!-- keys: AllowSpec -->
| Key | Type | Default | Description |
|---|---|---|---|
| `pair` | two components, patterns allowed | required | a nested assembly means all of its components |
| `reason` | text | required | why this is intended |

An unused entry of `allow` is a warning.
"""

KIND = CheckKind(
    name="no_collision", position=5, summary="No parts overlap, in poses or over ranges of joints.",
    examples=[{"pose": "all"}, {"joints": {"elbow": "all"}, "clearance": "1 mm"}],
    stub={"pose": "all"}, lengths=("clearance", "gap", "overlap"),
    page=PAGE, model=NoCollisionTest, read=read_no_collision,
    of_limits=True,
    codes=CollisionCode, measure=measure, poses=poses, finish=finish,
)

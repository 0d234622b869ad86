"""Tests of collision: the true shapes of parts, in poses and over ranges of joints."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thingc.diagnostics import Code, Note
from thingc.graph.types import Assembly, LinkedTest
from thingc.pose import Pose
from thingc.resolve.tests_model import CollisionCheck
from thingc.robot import occurrence_poses
from thingc.robot.types import Keyframe
from thingc.solids.shapes import Shapes, at, box, overlap
from thingc.testing.results import Case, Failure, Measure, Outcome, shown
from thingc.testing.stances import joints_text
from thingc.units import LENGTH, Quantity

LOOK = 0.01
"""How far [m] the smallest gap is looked for: beyond it nobody wants to know."""
SHOWN = 5
"""Further pairs that a message names."""
TOUCH = 1e-9
"""A gap [m] that is none."""



@dataclass(frozen=True, slots=True, kw_only=True)
class Near:
    """Two occurrences (indices) near each other in a keyframe: their `gap` [m]; where it is 0 the `volume` [m^3] of what they
    share and its mean thickness `depth` [m]; and the number of the allowance that they fall under."""

    one: int
    other: int
    gap: float
    depth: float
    volume: float
    allowance: int | None
    where: Keyframe

    @property
    def badness(self) -> tuple[float, float]:
        """Deeper, then nearer."""
        return self.depth, -self.gap


class Collisions:
    """The pairs of an assembly that may collide, and their shapes. `tolerance` [m] is how far each tessellated surface may be
    off the true one: an overlap counts from a mean depth of twice that."""

    def __init__(self, assembly: Assembly, shapes: Shapes, tolerance: float) -> None:
        self.assembly = assembly
        self.deep = 2.0 * tolerance
        self._solids: dict[int, Any] = {}
        for occurrence in assembly.occurrences:
            solid = shapes.solid(occurrence.record) if occurrence.record is not None else None
            if solid is not None:
                self._solids[occurrence.index] = solid
        near, link_of = set(_neighbours(assembly)), assembly.link_of
        indices = sorted(self._solids)
        self.pairs = [
            (a, b) for k, a in enumerate(indices) for b in indices[k + 1 :]
            if link_of[a] != link_of[b] and _ordered(link_of[a], link_of[b]) not in near
        ]
        self.hulls = [o.path for o in assembly.occurrences if o.record is not None and o.record.text in shapes.hulls]

    def wrong(self, near: Near, clearance: float) -> bool:
        """Whether two occurrences are nearer than they may be."""
        return near.gap < clearance - TOUCH if clearance > 0.0 else near.depth > self.deep

    def near(
        self, poses: Sequence[Pose], frame: Keyframe, clearance: float, look: float, allowed: Mapping[tuple[int, int], int],
        needed: Collection[int] = (),
    ) -> Iterator[Near]:
        """The pairs nearer than `clearance` [m], and of those that no allowance is for also the nearest within `look` [m]. Of
        allowances that are known to be `needed` nothing more is found out."""
        if not self.pairs:
            return
        boxes = {index: box(solid, poses[index]) for index, solid in self._solids.items()}
        ones, others = (np.array([boxes[pair[side]] for pair in self.pairs]) for side in (0, 1))
        between = np.maximum(others[:, 0] - ones[:, 1], ones[:, 0] - others[:, 1])
        apart = np.linalg.norm(np.maximum(between, 0.0), axis=1)
        placed: dict[int, Any] = {}
        for number in np.argsort(apart, kind="stable"):
            pair = self.pairs[number]
            allowance = allowed.get(pair)
            within = max(clearance, TOUCH) if allowance is not None else max(clearance, look, TOUCH)
            if apart[number] > within or allowance in needed:
                continue
            for index in pair:
                if index not in placed:
                    placed[index] = at(self._solids[index], poses[index])
            one, other = (placed[index] for index in pair)
            gap = float(one.min_gap(other, within))
            if gap >= within:
                continue
            volume, depth = overlap(one, other) if gap <= 0.0 else (0.0, 0.0)
            if allowance is None:
                look = min(look, gap)
            yield Near(one=pair[0], other=pair[1], gap=gap, depth=depth, volume=volume, allowance=allowance, where=frame)


def _ordered(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)


def _neighbours(assembly: Assembly) -> Iterator[tuple[int, int]]:
    """Pairs of links that a joint connects, also one that closes a loop."""
    for mate in assembly.mates:
        if mate.joints or mate.loop is not None:
            yield _ordered(assembly.link_of[mate.parent], assembly.link_of[mate.child])


def _allowed(linked: LinkedTest, check: CollisionCheck) -> dict[tuple[int, int], int]:
    """By pair of occurrences the number of the first allowance that it falls under."""
    found: dict[tuple[int, int], int] = {}
    for number, allowance in enumerate(check.allow):
        ones, others = (
            [index for reference in side for index in linked.components[reference]] for side in (allowance.one, allowance.other)
        )
        for a in ones:
            for b in others:
                found.setdefault(_ordered(a, b), number)
    return found


def no_collision(case: Case, check: CollisionCheck, frames: Sequence[Keyframe], collisions: Collisions, missing: int) -> Outcome:
    """The keyframes looked at: one of a pose, or those of a sweep, of which `missing` could not be closed."""
    allowed = _allowed(case.linked, check)
    nearest: Near | None = None
    worst: dict[tuple[int, int], Near] = {}
    needed: set[int] = set()
    for frame in frames:
        poses = occurrence_poses(case.robot, frame.q, frame.base)
        look = LOOK if nearest is None else nearest.gap
        for near in collisions.near(poses, frame, check.clearance, look, allowed, needed):
            wrong = collisions.wrong(near, check.clearance)
            if near.allowance is not None:
                needed.update((near.allowance,) if wrong else ())
                continue
            if nearest is None or near.gap < nearest.gap:
                nearest = near
            pair = near.one, near.other
            if wrong and (pair not in worst or near.badness > worst[pair].badness):
                worst[pair] = near
    measured: dict[str, Measure] = {"gap": nearest.gap if nearest is not None else None, "positions": len(frames)}
    if missing:
        measured["not_closing"] = missing
    if nearest is not None:
        measured["pair"] = _pair_text(collisions.assembly, nearest, "")
    counted = f", {len(frames)} position{'' if len(frames) == 1 else 's'}" if check.ranges else ""
    counted += f", {missing} more that do not close" if missing else ""
    expected: dict[str, Measure] = {"clearance": check.clearance}
    if worst:
        failure = _failure(case, check, sorted(worst.values(), key=lambda near: near.badness, reverse=True), collisions)
        measured["overlap"] = max(near.depth for near in worst.values())
        words = "1 pair collides" if len(worst) == 1 else f"{len(worst)} pairs collide"
        return Outcome(
            measured=measured, expected=expected, said=f"{words}{counted}", failure=failure, needed=frozenset(needed),
        )
    said = f"no gap below {Quantity(LOOK, LENGTH)}" if nearest is None else (
        f"least gap {shown(nearest.gap, LENGTH)}, {_pair_text(collisions.assembly, nearest, '')}"
    )
    return Outcome(measured=measured, expected=expected, said=f"{said}{counted}", needed=frozenset(needed))


def _failure(case: Case, check: CollisionCheck, worst: Sequence[Near], collisions: Collisions) -> Failure:
    """The worst pair in the message, the others in notes."""
    assembly, first = collisions.assembly, worst[0]
    notes = [
        Note(message=f"also {_how(assembly, near, check.clearance)}{_at(case, check, near)}") for near in worst[1 : SHOWN + 1]
    ]
    if len(worst) > SHOWN + 1:
        notes.append(Note(message=f"and {len(worst) - SHOWN - 1} more pairs"))
    notes += [
        Note(message=f"the surface of `{path}` is not closed: its convex hull stands for it")
        for path in collisions.hulls if path in (assembly.occurrences[first.one].path, assembly.occurrences[first.other].path)
    ]
    names = ", ".join(assembly.occurrences[index].path.replace("/", ".") for index in (first.one, first.other))
    return Failure(
        code=Code.TEST_COLLISION, key="clearance" if first.gap > 0.0 else "", notes=tuple(notes),
        message=f"{_how(assembly, first, check.clearance)}{_at(case, check, first)}",
        help=f'if that is right, write `allow: [{{pair: [{names}], reason: "..."}}]`',
    )


def _pair_text(assembly: Assembly, near: Near, tick: str) -> str:
    one, other = (assembly.occurrences[index].path for index in (near.one, near.other))
    return f"{tick}{one}{tick} and {tick}{other}{tick}"


def _how(assembly: Assembly, near: Near, clearance: float) -> str:
    text = _pair_text(assembly, near, "`")
    if near.gap > 0.0:
        return f"{text} are {shown(near.gap, LENGTH)} apart, and {Quantity(clearance, LENGTH)} were asked for"
    if near.depth == 0.0:
        return f"{text} touch, and {Quantity(clearance, LENGTH)} were asked for"
    return f"{text} overlap by {shown(near.depth, LENGTH)} on average ({float(f'{1e9 * near.volume:.3g}'):g} mm^3)"


def _at(case: Case, check: CollisionCheck, near: Near) -> str:
    """Where in a sweep."""
    if not check.ranges:
        return ""
    return f" at {joints_text(case.robot.assembly, {r.joint: near.where.q[r.joint] for r in check.ranges})}"

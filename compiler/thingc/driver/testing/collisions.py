"""Find parts of a robot that overlap or are close to each other in a pose. The exact shapes of the parts are used."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from thingc.base.diagnostics import Code
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import format_count
from thingc.base.pose import Pose
from thingc.documents.checks.no_collision import CollisionCheck
from thingc.driver.testing.numpy_tree import quasi_random
from thingc.model.assembly.links import joined_links
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.model.resolve.types import JointRange
from thingc.model.robot.types import Keyframe, Robot
from thingc.model.solids.clearance import PROVED, BoundedSolid, ComparedPair, Sweep, body_of, prove, sample
from thingc.model.solids.contact_cells import divide
from thingc.model.solids.overlaps import Overlaps, contact_places, reason_to_skip
from thingc.model.solids.shapes import Solid, Solids
from thingc.targets.request import EmitRequest

LOOK = 0.01
"""Largest distance [m] for which the smallest gap between two parts is measured."""
TOUCH = 1e-9
"""Largest gap [m] between two parts that counts as contact."""
CELL = (0.1, 0.1, 0.1, 0.002)
"""Step sizes for rounding poses: for the entries of the rotation matrix (about 6 deg), and for the translation [m]."""


class NearPair(FrozenStruct):
    """Two components of a robot that are close to each other or overlap in the keyframe `where`.

    `one` and `other` are the indices of the components. `gap` is the distance between the two components [m]. If the gap is 0, `volume`
    [m^3] is the volume of their overlap, and `depth` [m] is its mean thickness. `allowance` is the index of the `allow` entry of the test
    that permits this collision, or None.
    """

    one: int
    other: int
    gap: float
    depth: float
    volume: float
    allowance: int | None
    where: Keyframe

    @property
    def badness(self) -> tuple[float, float]:
        """Sort key of the pair by severity. A deeper overlap has a larger key. Without an overlap, a smaller gap has a larger key."""
        return self.depth, -self.gap


class Collisions:
    """The pairs of components that may collide, and the exact shapes of these components.

    `pairs` contains the indices of components on two links that no joint connects. For each pair, the gap is measured. `close` contains the
    indices of components on the same link, or on two links that a joint connects. Components of such pairs may touch, so only overlaps are
    searched. `skipped` maps each reason for skipping a comparison to the skipped pairs.
    """

    def __init__(self, request: EmitRequest) -> None:
        self.assembly, self.overlaps = request.assembly, Overlaps(request.store, request.workspace.mesh.linear, request.memo)
        self._report, shapes = request.report, Solids(request.store)
        self._solids = {one.index: solid for one in self.assembly.occurrences if (solid := shapes.solid(one)) is not None}
        self._bodies: dict[str, BoundedSolid] = {}
        near, link_of = {_sort_pair(*pair) for pair in joined_links(self.assembly)}, self.assembly.link_of
        indices = sorted(self._solids)
        self.pairs: list[tuple[int, int]] = []
        self.close: set[tuple[int, int]] = set()
        self.skipped: dict[str, dict[tuple[int, int], None]] = {}
        for pair in ((a, b) for k, a in enumerate(indices) for b in indices[k + 1 :]):
            one, other = (link_of[index] for index in pair)
            if one != other and _sort_pair(one, other) not in near:
                self.pairs.append(pair)
            elif reason := reason_to_skip(*(self.assembly.occurrences[index] for index in pair)):
                self._skip(pair, reason)
            else:
                self.close.add(pair)
        self.hulls = [o.path for o in self.assembly.occurrences if o.definition.text in shapes.hulls]

    def _skip(self, pair: tuple[int, int], reason: str) -> None:
        self.skipped.setdefault(reason, {})[pair] = None

    def overlapping(
        self, poses: Sequence[Pose], frame: Keyframe, allowed: Mapping[tuple[int, int], int], seen: set[object] | None,
    ) -> Iterator[NearPair]:
        """Yield the overlapping pairs of components on the same link, or on links that a joint connects.

        Pairs are omitted if the document suppresses the warning `TC520` about their overlap. In a sweep, `seen` contains the rounded
        relative poses that have already been compared. The pair is not compared again at the same rounded pose.
        """
        for pair in self.overlaps.pairs(self.assembly.occurrences, poses):
            one, other = indices = pair.one.index, pair.other.index
            cell = (indices, *(round(number / size) for row, size in zip((*pair.at.rotation, pair.at.translation), CELL) for number in row))
            if indices not in self.close or (seen is not None and cell in seen):
                continue
            if seen is not None:
                seen.add(cell)
            if (shared := self.overlaps.intersection(pair, keep=seen is None)) is None:
                continue
            if (reason := self._allowed_reason(pair.one, pair.other)) is None:
                volume, depth = shared
                yield NearPair(one=one, other=other, gap=0.0, depth=depth, volume=volume, allowance=allowed.get(indices), where=frame)
            else:
                self._skip(indices, f"allowed: {reason}")

    def _allowed_reason(self, one: Occurrence, other: Occurrence) -> str | None:
        """Return the reason for which the document allows an overlap of two parts on one link, or on links that a joint connects."""
        places = [*other.origin, *(note.span for note in contact_places(self.assembly, one, other) if note.span)]
        return next((allowance.reason for allowance in self._report.allowances if allowance.covers(Code.OVERLAP, places)), None)

    def moving_pairs(
        self, robot: Robot, start: Keyframe, ranges: Sequence[JointRange], clearance: float,
    ) -> tuple[Sweep, list[ComparedPair]]:
        """Return the robot with moving joints, and the pairs of components that may collide and that move relative to each other."""
        parts, deep = self.assembly.occurrences, self.overlaps.deep
        sweep = Sweep(robot, start, ranges)
        close = [(one, other) for one, other in sorted(self.close) if not self._allowed_reason(parts[one], parts[other])]
        moving = [pair for pair in (*self.pairs, *close) if sweep.moving(*pair)[0]]
        for index in (index for pair in moving for index in pair):
            if parts[index].definition.text not in self._bodies:
                self._bodies[parts[index].definition.text] = body_of(parts[index], self._solids[index], deep / 2.0)
        bodies = {index: self._bodies[parts[index].definition.text] for pair in moving for index in pair}
        return sweep, [
            ComparedPair(one, other, (bodies[one], bodies[other]), joined, 0.0 if joined else clearance, deep)
            for one, other in moving for joined in ((one, other) in self.close,)
        ]

    def certify(
        self, robot: Robot, start: Keyframe, check: CollisionCheck, only: Collection[tuple[int, int]] | None = None,
    ) -> tuple[list[ComparedPair], int]:
        """Compare all pairs (or `only` these pairs) that move relative to each other in the ranges of a test, in all positions as far as
        possible.

        Pairs between which more than `PROVED` ranges move are compared in samples. Return the pairs, and the number of samples in which the
        loops of the robot do not close.
        """
        sweep, moving = self.moving_pairs(robot, start, check.ranges, check.clearance)
        pairs = [pair for pair in moving if only is None or (pair.one, pair.other) in only]
        rest = [pair for pair in pairs if len(sweep.moving(pair.one, pair.other)[0]) > PROVED]
        prove(sweep, [pair for pair in pairs if pair not in rest and not divide(sweep, pair)])
        missing = sample(sweep, rest, quasi_random(check.samples, len(check.ranges)).tolist()) if rest else 0
        return pairs, missing

    def violates(self, near: NearPair, clearance: float) -> bool:
        """Return whether the two components of a pair are closer to each other than the required clearance [m]."""
        return near.gap < clearance - TOUCH if clearance > 0.0 else near.depth > self.overlaps.deep

    def near_pairs(
        self, poses: Sequence[Pose], frame: Keyframe, clearance: float, look: float, allowed: Mapping[tuple[int, int], int],
        needed: Collection[int] = (),
    ) -> Iterator[NearPair]:
        """Yield all pairs of components that are closer than `clearance` [m], and the closest pair if it is within `look` [m].

        Only components on links that no joint connects are compared. A pair that the test allows to collide is yielded only if it is closer
        than `clearance`. `needed` contains the indices of `allow` entries that have already permitted a collision. Pairs of these entries
        are skipped.
        """
        if not self.pairs:
            return
        boxes = {index: solid.box(poses[index]) for index, solid in self._solids.items()}
        ones, others = (np.array([boxes[pair[side]] for pair in self.pairs]) for side in (0, 1))
        between = np.maximum(others[:, 0] - ones[:, 1], ones[:, 0] - others[:, 1])
        apart = np.linalg.norm(np.maximum(between, 0.0), axis=1)
        placed: dict[int, Solid] = {}
        for number in np.argsort(apart, kind="stable"):
            pair = self.pairs[number]
            allowance = allowed.get(pair)
            within = max(clearance, TOUCH) if allowance is not None else max(clearance, look, TOUCH)
            if apart[number] > within or allowance in needed:
                continue
            for index in pair:
                if index not in placed:
                    placed[index] = self._solids[index].at(poses[index])
            one, other = (placed[index] for index in pair)
            gap = one.gap(other, within)
            if gap >= within:
                continue
            volume, depth = one.overlap(other) if gap <= 0.0 else (0.0, 0.0)
            if allowance is None:
                look = min(look, gap)
            yield NearPair(one=pair[0], other=pair[1], gap=gap, depth=depth, volume=volume, allowance=allowance, where=frame)


def names_of(assembly: Assembly, one: int, other: int, quote: str = "") -> str:
    """Return the names of two components, such as `left and right`, each between two quotes `quote`."""
    return " and ".join(f"{quote}{assembly.occurrences[index].path.replace('/', '.')}{quote}" for index in (one, other))


def skipped_text(skipped: Mapping[str, Sequence[str]]) -> str:
    """Describe the pairs of components that were not compared, by reason. The JSON output lists all of these pairs."""
    return "".join(
        f", {format_count(len(pairs), 'pair')} skipped ({reason}: {pairs[0]}{', ...' if len(pairs) > 1 else ''})"
        for reason, pairs in skipped.items()
    )


def collisions_of(request: EmitRequest) -> Collisions:
    """Return the pairs of components that may collide, with their shapes. The result is cached for all tests of a document."""
    known = request.made.get("collisions")
    if isinstance(known, Collisions):
        return known
    made = Collisions(request)
    request.made["collisions"] = made
    return made


def _sort_pair(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)



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
from thingc.model.solids.clearance import PROVED, BoundedSolid, SolidPair, Sweep, body_of, sample
from thingc.model.solids.contact_cells import prove_pairs
from thingc.model.solids.overlaps import Overlaps, contact_places, reason_to_skip
from thingc.model.solids.shapes import Solid, Solids
from thingc.targets.request import EmitRequest

SEARCH_DISTANCE = 0.01
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
    def severity(self) -> tuple[float, float]:
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
        self._report, self.progress, shapes = request.report, request.progress, Solids(request.store)
        self._solids = {part.index: solid for part in self.assembly.occurrences if (solid := shapes.solid(part)) is not None}
        self._bodies: dict[str, BoundedSolid] = {}
        joined, link_of = {_sort_pair(*pair) for pair in joined_links(self.assembly)}, self.assembly.link_of
        indices = sorted(self._solids)
        self.pairs: list[tuple[int, int]] = []
        self.close: set[tuple[int, int]] = set()
        self.skipped: dict[str, dict[tuple[int, int], None]] = {}
        for pair in ((a, b) for k, a in enumerate(indices) for b in indices[k + 1 :]):
            first_link, second_link = (link_of[index] for index in pair)
            if first_link != second_link and _sort_pair(first_link, second_link) not in joined:
                self.pairs.append(pair)
            elif reason := reason_to_skip(*(self.assembly.occurrences[index] for index in pair)):
                self._skip(pair, reason)
            else:
                self.close.add(pair)
        self.hulls = [o.path for o in self.assembly.occurrences if o.definition.text in shapes.hulls]

    def _skip(self, pair: tuple[int, int], reason: str) -> None:
        self.skipped.setdefault(reason, {})[pair] = None

    def overlapping(
        self, poses: Sequence[Pose], frame: Keyframe, allowed: Mapping[tuple[int, int], int], compared_poses: set[object] | None,
    ) -> Iterator[NearPair]:
        """Yield the overlapping pairs of components on the same link, or on links that a joint connects.

        Pairs are omitted if the document suppresses the warning `TC520` about their overlap. `allowed` maps pairs to the index of their
        `allow` entry. In a sweep, `compared_poses` collects the rounded relative poses of each pair, at which the pair is not compared
        again.
        """
        for pair in self.overlaps.pairs(self.assembly.occurrences, poses):
            one, other = indices = pair.one.index, pair.other.index
            cell = (indices, *(round(number / size) for row, size in zip((*pair.at.rotation, pair.at.translation), CELL) for number in row))
            if indices not in self.close or (compared_poses is not None and cell in compared_poses):
                continue
            if compared_poses is not None:
                compared_poses.add(cell)
            if (shared := self.overlaps.intersection(pair, keep=compared_poses is None)) is None:
                continue
            if (reason := self._allowed_reason(pair.one, pair.other)) is None:
                volume, depth = shared
                yield NearPair(one=one, other=other, gap=0.0, depth=depth, volume=volume, allowance=allowed.get(indices), where=frame)
            else:
                self._skip(indices, f"allowed: {reason}")

    def _allowed_reason(self, first: Occurrence, second: Occurrence) -> str | None:
        """Return the reason in the `allow` entry that suppresses the warning about an overlap of two parts, or None without an entry."""
        places = [*second.origin, *(note.span for note in contact_places(self.assembly, first, second) if note.span)]
        return next((allowance.reason for allowance in self._report.allowances if allowance.covers(Code.OVERLAP, places)), None)

    def moving_pairs(
        self, robot: Robot, start: Keyframe, ranges: Sequence[JointRange], clearance: float,
    ) -> tuple[Sweep, list[SolidPair]]:
        """Return the sweep of the robot over the ranges, and the pairs of components that move relative to each other and may collide."""
        parts, deep = self.assembly.occurrences, self.overlaps.deep
        sweep = Sweep(robot, start, ranges)
        close = [(first, second) for first, second in sorted(self.close) if not self._allowed_reason(parts[first], parts[second])]
        moving = [pair for pair in (*self.pairs, *close) if sweep.joints_between(*pair)[1]]
        for index in (index for pair in moving for index in pair):
            if parts[index].definition.text not in self._bodies:
                self._bodies[parts[index].definition.text] = body_of(parts[index], self._solids[index], deep / 2.0)
        bodies = [[self._bodies[parts[index].definition.text] for index in pair] for pair in moving]
        return sweep, [
            SolidPair(*pair, one.error + other.error, joined, 0.0 if joined else clearance, deep, bodies=(one, other))
            for pair, (one, other) in zip(moving, bodies, strict=True) for joined in (pair in self.close,)
        ]

    def certify(
        self, robot: Robot, start: Keyframe, check: CollisionCheck, only: Collection[tuple[int, int]] | None = None,
    ) -> tuple[list[SolidPair], int]:
        """Compare the pairs that move relative to each other in the ranges of a test, in all positions as far as possible.

        If `only` is given, other pairs are ignored. Pairs whose relative position depends on more than `PROVED` ranges are compared in
        samples. Return the pairs, and the number of samples in which the loops of the robot do not close.
        """
        sweep, moving = self.moving_pairs(robot, start, check.ranges, check.clearance)
        pairs = [pair for pair in moving if only is None or (pair.one, pair.other) in only]
        sampled = [pair for pair in pairs if len(sweep.joints_between(pair.one, pair.other)[1]) > PROVED]
        prove_pairs(sweep, [pair for pair in pairs if pair not in sampled], self.progress)
        missing = sample(sweep, sampled, quasi_random(check.samples, len(check.ranges)).tolist()) if sampled else 0
        return pairs, missing

    def violates(self, pair: NearPair, clearance: float) -> bool:
        """Return whether the two components of a pair are closer to each other than the required clearance [m]."""
        return pair.gap < clearance - TOUCH if clearance > 0.0 else pair.depth > self.overlaps.deep

    def near_pairs(
        self, poses: Sequence[Pose], frame: Keyframe, clearance: float, search_distance: float, allowed: Mapping[tuple[int, int], int],
        used_allowances: Collection[int] = (),
    ) -> Iterator[NearPair]:
        """Yield all pairs of components that are closer than `clearance` [m], and the closest pair if it is within `search_distance` [m].

        Only components on links that no joint connects are compared. `allowed` maps the pairs that the test allows to collide to the index
        of their `allow` entry. Such a pair is yielded only if it is closer than `clearance`, and skipped if its entry is in
        `used_allowances`, because the entry has already permitted a collision.
        """
        if not self.pairs:
            return
        boxes = {index: solid.box(poses[index]) for index, solid in self._solids.items()}
        first_boxes, second_boxes = (np.array([boxes[pair[side]] for pair in self.pairs]) for side in (0, 1))
        separation = np.maximum(second_boxes[:, 0] - first_boxes[:, 1], first_boxes[:, 0] - second_boxes[:, 1])
        distances = np.linalg.norm(np.maximum(separation, 0.0), axis=1)
        placed: dict[int, Solid] = {}
        for number in np.argsort(distances, kind="stable"):
            pair = self.pairs[number]
            allowance = allowed.get(pair)
            reach = max(clearance, TOUCH) if allowance is not None else max(clearance, search_distance, TOUCH)
            if distances[number] > reach or allowance in used_allowances:
                continue
            for index in pair:
                if index not in placed:
                    placed[index] = self._solids[index].at(poses[index])
            first, second = (placed[index] for index in pair)
            gap = first.gap(second, reach)
            if gap >= reach:
                continue
            volume, depth = first.overlap(second) if gap <= 0.0 else (0.0, 0.0)
            if allowance is None:
                search_distance = min(search_distance, gap)
            yield NearPair(one=pair[0], other=pair[1], gap=gap, depth=depth, volume=volume, allowance=allowance, where=frame)


def names_of(assembly: Assembly, first: int, second: int, quote: str = "") -> str:
    """Return the names of two components, such as `left and right`, each between two quotes `quote`."""
    return " and ".join(f"{quote}{assembly.occurrences[index].name}{quote}" for index in (first, second))


def skipped_text(skipped: Mapping[str, Sequence[str]]) -> str:
    """Describe the pairs of components that were not compared, by reason. The JSON output lists all of these pairs."""
    return "".join(
        f", {format_count(len(pairs), 'pair')} skipped ({reason}: {pairs[0]}{', ...' if len(pairs) > 1 else ''})"
        for reason, pairs in skipped.items()
    )


def collisions_of(request: EmitRequest) -> Collisions:
    """Return the pairs of components that may collide, with their shapes. The result is cached for all tests of a document."""
    cached = request.made.get("collisions")
    if isinstance(cached, Collisions):
        return cached
    collisions = request.made["collisions"] = Collisions(request)
    return collisions


def _sort_pair(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)



"""Divide two parts that are in contact at a joint, so that the rest of the parts is compared in all positions.

A ring around the axis of a hinge, and a prism along a slide, do not change when the joint moves. Two parts can therefore touch only inside
the same ring or prism. If the heights or radii of the parts in a ring do not overlap, the parts are clear there in all positions. If they
overlap by less than the thickness of an intersection that counts as more than contact, the parts can only touch there. The heights and
radii are bounds of triangles, so most rings are decided without cutting the parts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from math import cos, inf, pi, sin

import numpy as np
from manifold3d import Manifold

from thingc.base.memo import Memo
from thingc.base.pose import Pose, along
from thingc.base.progress import Progress, ProgressCounter
from thingc.model.solids.clearance import BoundedSolid, SolidPair, Sweep, prove
from thingc.model.solids.joint_boxes import SKIN, TOUCH, Array
from thingc.model.solids.shapes import Solid

FACETS = 64
"""Number of facets of a ring. A ring with facets contains the exact ring."""
LEVELS = 3
"""How often the cells around a joint are divided into four cells."""
PATIENCE = 8
"""Number of positions after which parts that are in contact in all of them count as in contact in a cell."""

MARGIN = 1e-4
"""Smallest distance [m] by which the cells extend beyond the parts, so that they contain contacts at the end of a part."""

Bounds = tuple[tuple[float, float], tuple[float, float]]
Bodies = tuple[BoundedSolid, BoundedSolid]


def prove_pairs(sweep: Sweep, pairs: Sequence[SolidPair], progress: Progress | None = None, cache: Memo | None = None) -> None:
    """Compare pairs in all positions, except for the cells in which parts at a joint are always in contact. Show the progress.

    If the same pairs are compared in several ranges, `cache` contains the pieces of the parts, which do not depend on the range.
    """
    counter = ProgressCounter(progress, "proving pairs", len(pairs))
    for pair in pairs:
        joints, moving, looped = sweep.joints_between(pair.one, pair.other)
        pair.until_contact = pair.joined and len(joints) == len(moving) == 1 and not (looped or sweep.pitches[joints[0]])
    prove(sweep, pairs, counter)
    for pair in pairs:
        if pair.until_contact and pair.done and (pair.seen == 1 or not pair.found):
            _divide(sweep, pair, cache or Memo())
        pair.until_contact = False


def _divide(sweep: Sweep, pair: SolidPair, cache: Memo) -> None:
    """Compare two parts that are in contact at a single hinge or slide, except for the cells in which they are always in contact."""
    pair.found = False
    place = sweep.place(sweep.initial)
    assert place is not None, "the loops close in the keyframe"
    anchor, angular, linear = (tuple(vector) for vector in place.twists[sweep.joints_between(pair.one, pair.other)[0][0]].tolist())
    turns = any(angular)
    frame = along(angular if turns else linear, anchor)
    poses = tuple(place.at(part).inverse() @ frame for part in (pair.one, pair.other))
    near, pieces = cache((pair.one, pair.other), _pieces, pair.bodies, poses, turns, pair.error, pair.deep)
    parts = [SolidPair(pair.one, pair.other, pair.error, True, 0.0, pair.deep, PATIENCE, bodies=bodies) for bodies in pieces]
    prove(sweep, parts)
    pair.near = near or any(part.verdict != "clear" for part in parts)
    worst = max((part for part in parts if part.verdict == "touches"), key=lambda part: part.depth, default=None)
    if worst is not None:
        pair.found, pair.gap = True, 0.0
        pair.depth, pair.volume, pair.q = worst.depth, worst.volume, worst.q


def _pieces(bodies: Bodies, poses: tuple[Pose, Pose], turns: bool, error: float, deep: float) -> tuple[bool, list[Bodies]]:
    """Return whether two parts are nearly in contact in any cell, and the pieces of both parts in each cell in which they may overlap.

    `poses` are the frames of the joint in the frames of the parts. The two coordinates of a cell [m] are the radius and the height of a
    ring around a hinge (`turns`), or x and y of a prism along a slide.
    """
    sides = [JointSide(body, pose, turns) for body, pose in zip(bodies, poses, strict=True)]
    reach, margin = max(side.reach for side in sides), max(error, MARGIN)
    low, high = _shared_bounds(sides, ((-reach, reach), (-reach, reach)))
    (x, y), (x_end, y_end) = (low - margin).tolist(), (high + margin).tolist()
    open_cells, near = [((0.0 if turns else x, x_end), (y, y_end))], False
    most = max(SKIN, min(deep, error + SKIN))  # the overlap is an upper bound of the mean thickness of an intersection
    for _ in range(LEVELS):
        overlaps = [(cell, _overlap(sides, cell)) for bounds in open_cells for cell in _quarters(bounds)]
        near |= any(-TOUCH <= overlap <= most for _, overlap in overlaps)
        open_cells = [cell for cell, overlap in overlaps if overlap > most]
    pieces = [[side.cut(cell) for side in sides] for cell in open_cells]
    return near, [(one, other) for one, other in pieces if one is not None and other is not None]


def joint_bounds(corners: Array, turns: bool) -> tuple[Array, Array]:
    """Return the lower and upper bounds (n x 2) [m] of triangles with the given corners (n x 3 x 3) in the frame of a joint.

    The coordinates are the radius and the height for a hinge (`turns`), and x and y for a slide. The joint does not change them.
    """
    flat, heights = corners[:, :, :2], corners[:, :, 2]
    if not turns:
        return flat.min(axis=1), flat.max(axis=1)
    edges = np.roll(flat, -1, axis=1) - flat
    part = np.clip(-(flat * edges).sum(axis=2) / np.maximum((edges**2).sum(axis=2), 1e-30), 0.0, 1.0)  # nearest points of the edges
    sides = np.sign(flat[:, :, 0] * edges[:, :, 1] - flat[:, :, 1] * edges[:, :, 0]).sum(axis=1)
    nearest = np.where(np.abs(sides) == 3.0, 0.0, np.linalg.norm(flat + part[:, :, None] * edges, axis=2).min(axis=1))
    farthest = np.linalg.norm(flat, axis=2).max(axis=1)
    return np.stack([nearest, heights.min(axis=1)], axis=1), np.stack([farthest, heights.max(axis=1)], axis=1)


def _quarters(bounds: Bounds) -> Iterator[Bounds]:
    first, second = (((low, (low + high) / 2.0), ((low + high) / 2.0, high)) for low, high in bounds)
    return product(first, second)


def _shared_bounds(sides: Sequence[JointSide], cell: Bounds) -> tuple[Array, Array]:
    lows, highs = zip(*(side.bounds_in(cell) for side in sides), strict=True)
    return np.max(lows, axis=0), np.min(highs, axis=0)


def _overlap(sides: Sequence[JointSide], cell: Bounds) -> float:
    """Return the smallest overlap [m] of the bounds of the parts in a cell: an upper bound of the mean thickness of their intersection in
    all positions. If the overlap is negative, the parts are clear in the cell.
    """
    low, high = _shared_bounds(sides, cell)
    return float((high - low).min())


class JointSide:
    """One of two parts at a joint. `pose` is the frame of the joint in the frame of the part, and `turns` is True for a hinge.

    No coordinate of the part in the frame of the joint is greater than `reach` [m].
    """

    def __init__(self, body: BoundedSolid, pose: Pose, turns: bool) -> None:
        self.body, self.pose, self.turns = body, pose, turns
        frame, mesh = pose.inverse(), body.solid.whole.to_mesh64()
        corners = np.asarray(mesh.vert_properties)[:, :3] @ np.array(frame.rotation).T + np.array(frame.translation)
        self.triangle_bounds = joint_bounds(corners[np.asarray(mesh.tri_verts)], turns)
        self.reach = 1.1 * float(np.linalg.norm(corners, axis=1).max())

    def bounds_in(self, cell: Bounds) -> tuple[Array, Array]:
        """Return bounds (low, high) [m] of the solid in a cell. If the solid is empty there, they are infinite."""
        (low, high), (start, end) = self.triangle_bounds, np.array(cell).T
        near = ((high >= start) & (low <= end)).all(axis=1)
        first = np.maximum(low[near].min(axis=0, initial=inf), start)
        last = np.minimum(high[near].max(axis=0, initial=-inf), end)
        # The space between the triangles and the border of the cell is either inside or outside of the solid.
        if (first > start).any() and self._contains(start):
            first = start
        if (last < end).any() and self._contains(end):
            last = end
        return first, last

    def _contains(self, point: Array) -> bool:
        x, y = point.tolist()
        position = (x * cos(1.0), x * sin(1.0), y) if self.turns else (x, y, self.reach)  # a prism is longer than the part
        far = (1.3 * self.reach, 1.7 * self.reach, 1.1 * self.reach)
        return len(self.body.solid.whole.ray_cast(self.pose.apply(position), self.pose.apply(far))) % 2 == 1

    def cut(self, cell: Bounds) -> BoundedSolid | None:
        """Return the part of the solid in a cell, or None if it is empty."""
        (a, b), (c, d) = cell
        if self.turns:
            shape = Manifold.cylinder(d - c, b / cos(pi / FACETS), -1.0, FACETS).translate((0.0, 0.0, c))
            if a > 0.0:
                shape -= Manifold.cylinder(2.0 * self.reach, a, -1.0, FACETS, True)
        else:
            shape = Manifold.cube((b - a, d - c, 2.0 * self.reach)).translate((a, c, -self.reach))
        solid = self.body.solid.whole ^ Solid(shape, ()).at(self.pose).whole
        return None if solid.is_empty() else BoundedSolid(Solid(solid, ((solid, 0.0),)), self.body.error)

"""Divide two parts that are in contact at a joint, so that the rest of the parts is compared in all positions.

A ring around the axis of a hinge, and a prism along a slide, do not change when the joint moves. Two parts can therefore touch only inside
the same ring or prism. Rings in which the parts are always in contact are divided further. If the heights or radii of the parts in a ring
do not overlap, the parts are clear there in all positions. If they overlap by less than `SKIN`, the parts can only touch there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import cos, pi

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from thingc.base.joints.twist import Twist
from thingc.base.pose import along
from thingc.base.progress import Progress, ProgressCounter
from thingc.model.solids.clearance import SKIN, TOUCH, BoundedSolid, ComparedPair, Place, Sweep, prove
from thingc.model.solids.shapes import Solid

FACETS = 64
"""Number of facets of a ring. A ring with facets contains the exact ring."""
PATIENCE = (0, 1, 8)
"""Number of positions in which the parts are compared in a cell before the cell is divided into four cells, by level. If the parts are in
contact in all of these positions in a cell of the last level, they count as in contact there.
"""

MARGIN = 1e-4
"""Smallest distance [m] by which the cells extend beyond the parts, so that they contain contacts at the end of a part."""

Bounds = tuple[tuple[float, float], tuple[float, float]]


def prove_pairs(sweep: Sweep, pairs: Sequence[ComparedPair], progress: Progress | None = None) -> None:
    """Compare pairs in all positions, except for the cells in which parts at a joint are always in contact. Show the progress."""
    counter = ProgressCounter(progress, "proving pairs", len(pairs))
    others: list[ComparedPair] = []
    for pair in pairs:
        if divide(sweep, pair):
            counter.add()
        else:
            others.append(pair)
    prove(sweep, others, counter)


def divide(sweep: Sweep, pair: ComparedPair) -> bool:
    """Compare two parts that are in contact at a single joint, except for the cells in which they are always in contact.

    Return False if the parts are not in contact, or if more than one joint or a screw joint moves them.
    """
    moving, looped = sweep.moving(pair.one, pair.other)
    if not pair.joined or len(moving) != 1 or looped:
        return False
    (number,) = moving
    x, half = ((sweep.ranges[number].upper + sign * sweep.ranges[number].lower) / 2.0 for sign in (1.0, -1.0))
    place = sweep.place({number: x})
    steps = sweep.steps(place, {number: x}, {number: half}) if place is not None else {}
    twists = [twist for path, twist in place.twists(pair) if steps.get(path)] if place is not None else []
    if place is None or len(twists) != 1 or twists[0].pitch or place.gap(pair, pair.error + SKIN) >= pair.error + SKIN:
        return False
    cells = _Cells(place, pair, twists[0], 2.0 * half)
    waiting = [(cells.bounds, pair)]
    for patience in PATIENCE:
        parts = [part for bounds, whole in waiting for cell in _quarters(bounds) for part in cells.cut(whole, cell, patience)]
        prove(sweep, [part for _, part, _ in parts])
        worst = max((part for _, part, _ in parts if part.verdict == "touches"), key=lambda part: part.depth, default=None)
        if worst is not None:
            pair.found, pair.gap = True, 0.0
            pair.depth, pair.volume, pair.q = worst.depth, worst.volume, worst.q
            break
        pair.near |= any(thin and part.verdict != "clear" for _, part, thin in parts)
        waiting = [(cell, part) for cell, part, thin in parts if part.verdict != "clear" and not thin]
    pair.near |= bool(waiting)
    return True


def joint_bounds(corners: NDArray[np.float64], turns: bool) -> NDArray[np.float64]:
    """Return the bounds (2 x 2: low, high) [m] of triangles with the given corners (n x 3 x 3) in the frame of a joint.

    The coordinates are the radius and the height for a hinge (`turns`), and x and y for a slide. The joint does not change them.
    """
    flat = corners[:, :, :2]
    if not turns:
        return np.stack([flat.min(axis=(0, 1)), flat.max(axis=(0, 1))])
    edges = np.roll(flat, -1, axis=1) - flat
    part = np.clip(-(flat * edges).sum(axis=2) / np.maximum((edges**2).sum(axis=2), 1e-30), 0.0, 1.0)  # nearest points of the edges
    sides = np.sign(flat[:, :, 0] * edges[:, :, 1] - flat[:, :, 1] * edges[:, :, 0]).sum(axis=1)
    low = 0.0 if (np.abs(sides) == 3.0).any() else np.linalg.norm(flat + part[:, :, None] * edges, axis=2).min()
    heights = corners[:, :, 2]
    return np.array([[low, heights.min()], [np.linalg.norm(flat, axis=2).max(), heights.max()]])


def _quarters(bounds: Bounds) -> Iterator[Bounds]:
    (a, b), (c, d) = bounds
    for u in ((a, (a + b) / 2.0), ((a + b) / 2.0, b)):
        for v in ((c, (c + d) / 2.0), ((c + d) / 2.0, d)):
            yield u, v


class _Cells:
    """The cells around a joint between two parts.

    The two coordinates of `bounds` [m] are the radius and the height of a ring around a hinge, or x and y of a prism along a slide. The
    length of the range is `motion` [rad or m].
    """

    def __init__(self, place: Place, pair: ComparedPair, twist: Twist, motion: float) -> None:
        self.turns = twist.turns
        frame = along(twist.axis, twist.anchor)
        self.poses = [place.at(part).inverse() @ frame for part in (pair.one, pair.other)]
        low, high, length = self._shared_bounds([body.solid.whole for body in pair.bodies])
        self.length = 2.0 * (length + motion)
        low, high = low - (margin := max(pair.error, MARGIN)), high + margin
        self.bounds: Bounds = ((0.0 if self.turns else float(low[0]), float(high[0])), (float(low[1]), float(high[1])))

    def _shared_bounds(self, solids: Sequence[Manifold]) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Return the bounds (low, high) [m] that are shared by the two solids, and the largest coordinate of their corners [m]."""
        frames = [(pose.inverse(), solid.to_mesh64()) for pose, solid in zip(self.poses, solids, strict=True)]
        corners = [
            (np.asarray(mesh.vert_properties)[:, :3] @ np.array(frame.rotation).T + np.array(frame.translation))[np.asarray(mesh.tri_verts)]
            for frame, mesh in frames
        ]
        lows, highs = zip(*(joint_bounds(each, self.turns) for each in corners), strict=True)
        return np.max(lows, axis=0), np.min(highs, axis=0), max(float(np.abs(each).max()) for each in corners)

    def cut(self, pair: ComparedPair, bounds: Bounds, patience: int) -> Iterator[tuple[Bounds, ComparedPair, bool]]:
        """Yield a copy of a pair with the parts of its solids inside a cell, with the cell, and whether the parts can only touch there.

        Yield nothing if one of the solids is empty in the cell, or if the parts are clear there in all positions. The smallest overlap of
        the bounds of the parts is an upper bound of the mean thickness of their intersection in all positions.
        """
        (a, b), (c, d) = bounds
        if self.turns:
            cell = Manifold.cylinder(d - c, b / cos(pi / FACETS), -1.0, FACETS).translate((0.0, 0.0, c))
            if a > 0.0:
                cell -= Manifold.cylinder(self.length, a, -1.0, FACETS, True)
        else:
            cell = Manifold.cube((b - a, d - c, self.length)).translate((a, c, -self.length / 2.0))
        uncut = Solid(cell, ((cell, 0.0),))
        solids = [body.solid.whole ^ uncut.at(pose).whole for body, pose in zip(pair.bodies, self.poses, strict=True)]
        if any(solid.is_empty() for solid in solids):
            return
        low, high, _ = self._shared_bounds(solids)
        overlap = float((high - low).min())
        if overlap < -TOUCH:
            return
        one, other = (BoundedSolid(Solid(solid, ((solid, 0.0),)), body.error) for solid, body in zip(solids, pair.bodies, strict=True))
        thin = overlap <= SKIN
        yield bounds, ComparedPair(pair.one, pair.other, (one, other), True, 0.0, pair.deep, 1 if thin else patience), thin

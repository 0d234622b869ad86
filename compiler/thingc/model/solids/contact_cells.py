"""Divide two parts that are in contact at a joint, so that the rest of the parts is compared in all positions.

A ring around the axis of a hinge, and a prism along a slide, do not change when the joint moves. Two parts can therefore touch only inside
the same ring or prism. Rings in which the parts are always in contact are divided further.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from thingc.base.joints.twist import Twist
from thingc.base.pose import Pose, along
from thingc.model.solids.clearance import SKIN, BoundedSolid, ComparedPair, Place, Sweep, prove
from thingc.model.solids.shapes import Solid

FACETS = 64
"""Number of facets of a ring. A ring with facets contains the exact ring."""
LEVELS = 2
"""Number of times that a quarter in which parts are in contact is divided into four cells."""
PATIENCE = 8
"""Number of positions in which the parts must be in contact in a cell before the cell is divided."""

MARGIN = 1e-4
"""Smallest distance [m] by which the cells extend beyond the parts, so that they contain contacts at the end of a part."""

Bounds = tuple[tuple[float, float], tuple[float, float]]


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
    waiting = [(bounds, pair) for bounds in _quarters(cells.bounds)]
    for _ in range(LEVELS):
        parts = [(cell, part) for bounds, whole in waiting for cell in _quarters(bounds) if (part := cells.cut(whole, cell)) is not None]
        prove(sweep, [part for _, part in parts])
        worst = max((part for _, part in parts if part.verdict == "touches"), key=lambda part: part.depth, default=None)
        if worst is not None:
            pair.found, pair.gap = True, 0.0
            pair.depth, pair.volume, pair.q = worst.depth, worst.volume, worst.q
            break
        waiting = [(cell, part) for cell, part in parts if part.verdict != "clear"]
    pair.near = bool(waiting)
    return True


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
        points = [self._points(body, pose.inverse()) for body, pose in zip(pair.bodies, self.poses, strict=True)]
        self.length = 2.0 * (max(float(np.abs(each).max()) for each in points) + motion)
        if self.turns:
            points = [np.stack([np.hypot(each[:, 0], each[:, 1]), each[:, 2]], axis=1) for each in points]
        margin = max(pair.error, MARGIN)
        low = np.max([each.min(axis=0) for each in points], axis=0) - margin
        high = np.min([each.max(axis=0) for each in points], axis=0) + margin
        self.bounds: Bounds = ((0.0 if self.turns else float(low[0]), float(high[0])), (float(low[1]), float(high[1])))

    def _points(self, body: BoundedSolid, pose: Pose) -> NDArray[np.float64]:
        points: NDArray[np.float64] = np.asarray(body.solid.whole.to_mesh64().vert_properties)[:, :3]
        return np.asarray(points @ np.array(pose.rotation).T + np.array(pose.translation))

    def cut(self, pair: ComparedPair, bounds: Bounds) -> ComparedPair | None:
        """Return a copy of a pair with the parts of its solids inside a cell, or None if one of the solids is empty there."""
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
            return None
        one, other = (BoundedSolid(Solid(solid, ((solid, 0.0),)), body.error) for solid, body in zip(solids, pair.bodies, strict=True))
        return ComparedPair(pair.one, pair.other, (one, other), True, 0.0, pair.deep, PATIENCE)

"""Divide two parts that are in contact at a joint, so that the rest of the parts is compared in all positions.

A ring around the axis of a hinge, and a prism along a slide, do not change when the joint moves. Two parts can therefore touch only inside
the same ring or prism. Rings in which the parts are always in contact are divided further. If the heights or radii of the parts in a ring
do not overlap, the parts are clear there in all positions. If they overlap by less than the thickness of an intersection that counts as
more than contact, the parts can only touch there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from math import cos, pi

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from thingc.base.pose import along
from thingc.base.progress import Progress, ProgressCounter
from thingc.model.solids.clearance import BoundedSolid, SolidPair, SolidPlace, Sweep, prove
from thingc.model.solids.joint_boxes import SKIN, TOUCH
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


def prove_pairs(sweep: Sweep, pairs: Sequence[SolidPair], progress: Progress | None = None) -> None:
    """Compare pairs in all positions, except for the cells in which parts at a joint are always in contact. Show the progress."""
    counter = ProgressCounter(progress, "proving pairs", len(pairs))
    for pair in pairs:
        joints, moving, looped = sweep.joints_between(pair.one, pair.other)
        pair.until_contact = pair.joined and len(joints) == len(moving) == 1 and not (looped or sweep.pitches[joints[0]])
    prove(sweep, pairs, counter)
    for pair in pairs:
        if pair.until_contact and pair.done and (pair.seen == 1 or not pair.found):
            _divide(sweep, pair)
        pair.until_contact = False


def _divide(sweep: Sweep, pair: SolidPair) -> None:
    """Compare two parts that are in contact at a single hinge or slide, except for the cells in which they are always in contact."""
    pair.found = pair.near = False
    place = sweep.place(sweep.initial)
    assert place is not None, "the loops close in the keyframe"
    cells = _Cells(place, pair, sweep.joints_between(pair.one, pair.other)[0][0])
    waiting = [(cells.bounds, pair)]
    touching: list[SolidPair] = []
    for patience in PATIENCE:
        cut = [part for bounds, whole in waiting for cell in _quarters(bounds) for part in cells.cut(whole, cell, patience)]
        touching += [part for _, part, thin in cut if thin]
        parts = [(cell, part) for cell, part, thin in cut if not thin]
        prove(sweep, [part for _, part in parts])
        worst = max((part for _, part in parts if part.verdict == "touches"), key=lambda part: part.depth, default=None)
        if worst is not None:
            pair.found, pair.gap = True, 0.0
            pair.depth, pair.volume, pair.q = worst.depth, worst.volume, worst.q
            return
        waiting = [(cell, part) for cell, part in parts if part.verdict != "clear"]
    pair.near = pair.gap <= TOUCH or bool(waiting)
    if not pair.near:  # the parts are nearer than the errors of their surfaces, but not in contact
        prove(sweep, touching)
        pair.near = any(part.verdict != "clear" for part in touching)


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
    first, second = (((low, (low + high) / 2.0), ((low + high) / 2.0, high)) for low, high in bounds)
    return product(first, second)


class _Cells:
    """The cells around a joint between two parts.

    The two coordinates of `bounds` [m] are the radius and the height of a ring around a hinge, or x and y of a prism along a slide.
    """

    def __init__(self, place: SolidPlace, pair: SolidPair, joint: int) -> None:
        anchor, angular, linear = (tuple(vector) for vector in place.twists[joint].tolist())
        self.turns = any(angular)
        frame = along(angular if self.turns else linear, anchor)
        self.poses = [place.at(part).inverse() @ frame for part in (pair.one, pair.other)]
        low, high, length = self._shared_bounds([body.solid.whole for body in pair.bodies])
        self.length = 2.1 * length
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

    def cut(self, pair: SolidPair, bounds: Bounds, patience: int) -> Iterator[tuple[Bounds, SolidPair, bool]]:
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
        solids: list[Manifold] = []
        for body, pose in zip(pair.bodies, self.poses, strict=True):
            solids.append(body.solid.whole ^ Solid(cell, ()).at(pose).whole)
            if solids[-1].is_empty():
                return
        low, high, _ = self._shared_bounds(solids)
        overlap = float((high - low).min())
        if overlap < -TOUCH:
            return
        one, other = (BoundedSolid(Solid(solid, ((solid, 0.0),)), body.error) for solid, body in zip(solids, pair.bodies, strict=True))
        thin = overlap <= max(SKIN, min(pair.deep, pair.error + SKIN))
        yield bounds, SolidPair(pair.one, pair.other, pair.error, True, 0.0, pair.deep, 1 if thin else patience, bodies=(one, other)), thin

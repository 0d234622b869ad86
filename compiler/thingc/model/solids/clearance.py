"""Prove that parts stay apart while joints move through their ranges, or find a position in which two parts touch.

The module `joint_boxes` describes the method. Parts are compared as exact solids, in which curved surfaces are meshes with a known error.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise, product, zip_longest

import numpy as np
from numpy.typing import ArrayLike

from thingc.base.numeric import hypot, inf, sum_of
from thingc.base.pose import Pose, Vector
from thingc.base.primitives import Primitive
from thingc.base.progress import ProgressCounter
from thingc.model.assembly.kinematics import coordinates, joints_of, leaders
from thingc.model.assembly.types import Occurrence
from thingc.model.resolve.types import JointRange
from thingc.model.robot.kinematics import body_pose, in_world, with_ancestors
from thingc.model.robot.loop_solver import Loops, SolverState
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Keyframe, Robot
from thingc.model.solids.joint_boxes import TOUCH, Array, ComparedPair, Place, compare_in_boxes, sphere_bounds
from thingc.model.solids.shapes import Solid

PROVED = 2
"""Largest number of moving joints between two parts for which all positions are proved."""
CLOSE = 1e-3
"""Distances are measured exactly up to this distance [m] above the required distance."""
FEW = 20_000
"""Number of pairs of triangles up to which all distances are measured exactly."""
SMALL, LARGE = 8.0, 3.0
"""The size of a part divided by the sizes of small and large balls that cover its surface."""
SEE = 0.05
"""Largest distance [m] that is measured in samples."""
NEAREST, DESCENT = 10, 150
"""Number of pairs whose distance is minimized after sampling, and the number of positions for each pair."""
FOLLOWED = 2.0
"""Factor between the motion of a joint on a loop in a box, and its motion from the middle to the corners of the box."""
EXACT = 1e-7
"""Relative difference of the areas of a mesh and of the part up to which all faces of the part count as plane."""


class Balls:
    """Balls that cover the surface of a solid: their centres `(n, 3)` and radii `(n,)` [m], and the index of the larger ball of each."""

    def __init__(self, low: Array, high: Array, size: float) -> None:
        """Cover boxes by balls. Boxes in the same cell of a grid whose cells have the size `size` [m] are in the same ball."""
        cells = np.floor((low + high) / (2.0 * size)).astype(np.int64)
        numbers = np.ravel_multi_index(tuple((cells - cells.min(axis=0)).T), tuple(np.ptp(cells, axis=0) + 1))
        order = np.argsort(numbers, kind="stable")
        starts = np.flatnonzero(np.diff(numbers[order], prepend=-1))
        self.owner = np.searchsorted(numbers[order[starts]], numbers)
        self.low, self.high = np.minimum.reduceat(low[order], starts), np.maximum.reduceat(high[order], starts)
        self.centres, self.radii = (self.low + self.high) / 2.0, np.linalg.norm(self.high - self.low, axis=1) / 2.0


class BoundedSolid:
    """The solid of a part with its bounds: a sphere and a box [m] in the frame of the part. `error` [m] is the error of its surface."""

    def __init__(self, solid: Solid, error: float) -> None:
        self.solid, self.error = solid, error
        bounds = np.array(solid.whole.bounding_box(), dtype=np.float64).reshape(2, 3)
        middle = bounds.mean(axis=0)
        points = np.asarray(solid.whole.to_mesh64().vert_properties)[:, :3]
        self.radius = 1.001 * float(np.sqrt(((points - middle) ** 2).sum(axis=1).max()))  # facets are inside of curved surfaces
        self.middle: Vector = tuple(middle.tolist())
        low, high = (bounds + np.array([[-1e-3], [1e-3]]) * self.radius).tolist()
        self.box: tuple[Vector, Vector] = (tuple(low), tuple(high))
        self.triangles = sum_of(int(core.num_tri()) for core, _ in solid.cores)
        self.slack = 1e-3 * self.radius if any(radius for _, radius in solid.cores) else 0.0

    @cached_property
    def balls(self) -> tuple[Balls, Balls]:
        """Small and large balls that cover the surface."""
        mesh = self.solid.whole.refine_to_length(self.radius / SMALL).to_mesh64()
        corners = [np.asarray(mesh.vert_properties)[numbers, :3] for numbers in np.asarray(mesh.tri_verts).T]
        small = Balls(np.minimum.reduce(corners), np.maximum.reduce(corners), self.radius / SMALL)
        return small, Balls(small.low, small.high, self.radius / LARGE)

    def distance_bound(self, other: BoundedSolid, pose: Pose, within: float, close: float) -> float:
        """Return a lower bound of the distance [m] to the surface of a body at a pose, or `within` if the distance is greater.

        If the distance is surely between `close` and `within`, only large balls are compared.
        """
        turn, shift, slack = np.array(pose.rotation).T, np.array(pose.translation), self.slack + other.slack
        (fine, large), (fine_other, large_other) = self.balls, other.balls
        bounds = _ball_distances(large.centres, large.radii, large_other.centres @ turn + shift, large_other.radii) - slack
        near_pairs, farthest = bounds < within, bounds + 2.0 * (large.radii[:, None] + large_other.radii + slack + TOUCH)
        if not near_pairs.any() or (bounds.min() >= close and farthest.min() < within):
            return min(float(bounds.min()), within)
        ours, theirs = np.asarray(near_pairs.any(axis=1))[large.owner], np.asarray(near_pairs.any(axis=0))[large_other.owner]
        centres, radii = fine_other.centres[theirs] @ turn + shift, fine_other.radii[theirs]
        return min(float(_ball_distances(fine.centres[ours], fine.radii[ours], centres, radii).min()) - slack, within)


def _ball_distances(ours: Array, radii: Array, theirs: Array, other_radii: Array) -> Array:
    """Return lower bounds of the distances `(n, m)` [m] of n balls from m other balls."""
    first = np.stack([*ours.T, (ours**2).sum(axis=1), np.ones(len(ours))])
    second = np.stack([*(-2.0 * theirs.T), np.ones(len(theirs)), (theirs**2).sum(axis=1)])
    squares = np.einsum("ki,kj->ij", first, second)  # unlike `@`, without the threads of BLAS, which cost more than the product
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)) - radii[:, None] - (other_radii + TOUCH))


def body_of(part: Occurrence, solid: Solid, tolerance: float) -> BoundedSolid:
    """Return the solid of a part with its bounds. `tolerance` [m] is the error of meshes of curved surfaces.

    To save time, such meshes are simplified with a quarter of this error.
    """
    if part.record is not None:
        plane = part.record.exact and abs(float(solid.whole.surface_area()) - part.record.area) <= EXACT * part.record.area
        mesh = solid.whole if plane else solid.whole.simplify(tolerance / 4.0)
        return BoundedSolid(Solid(mesh, ((mesh, 0.0),)), 0.0 if plane else 1.25 * tolerance)
    primitives = [surface.solid for surface in part.solids if isinstance(surface.solid, Primitive)]
    curved = (shape for shape in primitives if shape.shape in ("cylinder", "ellipsoid"))
    sizes = (shape.size[0] if shape.shape == "cylinder" else max(shape.size) for shape in curved)
    return BoundedSolid(solid, max((1e-3 * size for size in sizes), default=0.0))


@dataclass(eq=False)
class SolidPair(ComparedPair):
    """A comparison of two parts, with their solids."""

    bodies: tuple[BoundedSolid, BoundedSolid] = field(kw_only=True)


class SolidPlace(Place[SolidPair]):
    """The robot at the positions `x` [rad or m] of the joints of a sweep, and the positions `q` of all joints.

    Poses are computed when they are needed.
    """

    def __init__(self, sweep: Sweep, x: Array, q: dict[str, float]) -> None:
        self.sweep, self.x, self.q = sweep, x, q
        self._bodies: dict[int, Pose] = {0: sweep.base}
        self._at: dict[int, Pose] = {}
        self._overlaps: dict[SolidPair, tuple[float, float]] = {}

    @cached_property
    def twists(self) -> Array:
        """The twists of the joints in the world. The twists of joints that do not move in the sweep are omitted (zeros)."""
        twists = np.zeros((len(self.sweep.numbers), 3, 3))
        for body in (index for index, paths in enumerate(self.sweep.moving) if paths):
            for joint, twist in in_world(self.sweep.robot.bodies[body], self._body_pose(body), self.q):
                twists[self.sweep.numbers[joint.path]] = twist.anchor, twist.angular, twist.linear
        return twists

    def bounds(self, pairs: Sequence[SolidPair], half: Array) -> tuple[Array, Array]:
        """Return lower bounds of the distances [m] of parts, and the longest paths [m] of their points in a box."""
        chains = [self.sweep.joints_between(pair.one, pair.other)[0] for pair in pairs]
        order = np.array([*zip_longest(*chains, fillvalue=-1)], dtype=int).reshape(-1, len(pairs))
        sides = [[(pair.one, pair.bodies[0]) for pair in pairs], [(pair.other, pair.bodies[1]) for pair in pairs]]
        spheres = np.array([[(*self.at(part).apply(body.middle), body.radius) for part, body in side] for side in sides])
        return sphere_bounds(self.twists, order, self._steps(half), spheres[:, :, :3], spheres[:, :, 3])

    def _steps(self, half: Array) -> Array:
        """Return how far [rad or m] each joint moves at most from the middle of a box, whose half widths are `half`, by number."""
        sweep = self.sweep
        widths = {one.joint: width for one, width in zip(sweep.ranges, half.tolist(), strict=True)}
        steps = {path: sweep.rate(path, self.q, widths) * widths[lead] for path, lead in sweep.leaders.items() if lead in widths} | widths
        for step in product(*((-width, width) if width else (0.0,) for width in half.tolist())) if sweep.movable else ():
            corner = sweep.place(self.x + step, self.q)
            if corner is not None:
                steps |= {path: max(steps.get(path, 0.0), FOLLOWED * abs(corner.q[path] - self.q[path])) for path in sweep.movable}
        return np.array([steps.get(path, 0.0) for path in sweep.numbers])

    def at(self, part: int) -> Pose:
        """Return the pose of a part."""
        if part not in self._at:
            self._at[part] = self._body_pose(self.sweep.body_of[part]) @ self.sweep.in_link[part]
        return self._at[part]

    def _body_pose(self, index: int) -> Pose:
        bodies = self.sweep.robot.bodies
        chain = [] if index in self._bodies else [*with_ancestors(bodies, index)]
        for parent, child in pairwise(reversed(chain)):
            if child not in self._bodies:
                self._bodies[child] = body_pose(bodies[child], self._bodies[parent], self.q)
        return self._bodies[index]

    def gap(self, pair: SolidPair, within: float) -> float:
        """Return the distance [m] between two parts, or `within` if the distance is greater.

        A distance that is greater than the required distance plus `CLOSE` [m] is only a lower bound, unless the parts are simple.
        """
        a, b = pair.bodies
        relative = self.relative(pair)
        low, high = relative.around(b.box)
        if hypot(*(max(low[k] - a.box[1][k], a.box[0][k] - high[k], 0.0) for k in range(3))) >= within:
            return within
        if pair.joined and not pair.apart and self.overlap(pair)[0] > 0.0:  # measuring the distance would also intersect the parts
            return 0.0
        close, bound = within, 0.0
        if a.triangles * b.triangles > FEW:
            close = min(within, pair.floor + CLOSE)
            bound = a.distance_bound(b, relative, within, inf if pair.method == "sampled" else close)  # a descent needs small balls
        if bound < close or _encloses(a.box, (low, high)) or _encloses(b.box, relative.inverse().around(a.box)):
            gap = a.solid.gap(b.solid.at(relative), close)
            bound = gap if gap < close else max(gap, bound)
        return bound

    def relative(self, pair: SolidPair) -> Pose:
        """Return the pose of the second part in the frame of the first part."""
        return self.at(pair.one).inverse() @ self.at(pair.other)

    def overlap(self, pair: SolidPair) -> tuple[float, float]:
        """Return the volume [m^3] and the mean thickness [m] of the intersection of two parts."""
        if pair not in self._overlaps:
            self._overlaps[pair] = pair.bodies[0].solid.overlap(pair.bodies[1].solid.at(self.relative(pair)))
        return self._overlaps[pair]


class Sweep:
    """A robot whose joints move through `ranges`, starting from a keyframe. All joints that mimic these joints move, too.

    If a range moves a loop, the loop is closed in each position. The motions of the joints on the loop are then estimated, not proved.
    `numbers` contains the index of each joint of the kinematic tree by path, and `pitches` the pitch [m/rad] of each. `moving` contains the
    paths of the joints of each body that move. The joints in `movable` are moved to close loops.
    """

    def __init__(self, robot: Robot, frame: Keyframe, ranges: Sequence[JointRange]) -> None:
        assembly = robot.assembly
        self.robot, self.ranges, self.base = robot, ranges, frame.base or robot.bodies[0].X_PL
        self.in_link = in_link(assembly)
        self.lower, self.upper, self.initial = np.array([(one.lower, one.upper, frame.q[one.joint]) for one in ranges]).reshape(-1, 3).T
        index_of = {body.link: index for index, body in enumerate(robot.bodies)}
        self.body_of = [index_of[link] for link in assembly.link_of]
        self._joints = {joint.path: joint for joint in joints_of(assembly)}
        self._initial = {path: frame.q[path] for path, joint in self._joints.items() if joint.mimic is None}
        self._loops = Loops(robot.bodies, robot.closures, tuple(self._joints.values()), self.base) if robot.closures else None
        loop_joints = frozenset(self._joints) - self._loops.outside if self._loops is not None else frozenset()
        driven = {entry.joint for entry in ranges}
        self._loop_joints = loop_joints if loop_joints & driven else frozenset()
        self.movable = self._loop_joints - driven
        self.leaders = {path: leader for path, (leader, _, _) in leaders(self._joints.values(), frame.q).items()}
        self.numbers = {path: number for number, path in enumerate(joint.path for body in robot.bodies for joint in body.joints)}
        self.pitches = [joint.twist.pitch for body in robot.bodies for joint in body.joints]
        moving = driven | self._loop_joints
        self.moving = [[joint.path for joint in body.joints if self.leaders[joint.path] in moving] for body in robot.bodies]
        self._between: dict[tuple[int, int], tuple[list[int], frozenset[int], bool]] = {}

    def joints_between(self, first: int, second: int) -> tuple[list[int], frozenset[int], bool]:
        """Return the numbers of the joints that move between two parts, in order from the first part to the second part, the indices of the
        ranges that move the parts relative to each other, and whether a loop moves the parts.
        """
        ends = self.body_of[first], self.body_of[second]
        if ends not in self._between:
            up, down = (dict.fromkeys(with_ancestors(self.robot.bodies, end)) for end in ends)
            sides = ([body for body in up if body not in down], [body for body in down if body not in up])
            one, other = ([path for body in side for path in reversed(self.moving[body])] for side in sides)
            leads = {self.leaders[path] for path in (*one, *other)}
            looped = not leads.isdisjoint(self._loop_joints)
            moving = leads | self._loop_joints if looped else leads
            ranges = frozenset(k for k, entry in enumerate(self.ranges) if entry.joint in moving)
            self._between[ends] = [self.numbers[path] for path in (*one, *reversed(other))], ranges, looped
        return self._between[ends]

    def place(self, x: ArrayLike, start: Mapping[str, float] | None = None) -> SolidPlace | None:
        """Return the robot with the joints of the ranges at `x` [rad or m]. Return None if its loops do not close.

        `start` contains the positions from which the solver begins.
        """
        x = np.asarray(x, dtype=np.float64)
        values = {**self._initial, **{path: (start or self._initial)[path] for path in self.movable if path in self._initial}}
        q = coordinates(self._joints.values(), values | {one.joint: value for one, value in zip(self.ranges, x.tolist(), strict=True)})
        if self._loop_joints and self._loops is not None:
            solution = self._loops.close(SolverState(q=q, base=self.base), self.movable, base_moves=False)
            if not solution.closed:
                return None
            q = solution.state.q
        return SolidPlace(self, x, q)

    def rate(self, path: str, q: Mapping[str, float], half: Mapping[str, float]) -> float:
        """Return a bound of the absolute derivative of a joint by its leader, within the half width of the leader."""
        mimic = self._joints[path].mimic
        if mimic is None or mimic.joint.path not in self._joints:
            return 1.0
        inner = self.rate(mimic.joint.path, q, half)
        bound = abs(q[mimic.joint.path]) + inner * half[self.leaders[path]]
        return sum_of(k * abs(c) * bound ** (k - 1) for k, c in enumerate(mimic.polynomial) if k) * inner


def _encloses(outer: tuple[Vector, Vector], inner: tuple[Vector, Vector]) -> bool:
    return all(a < b and c > d for a, b, c, d in zip(outer[0], inner[0], outer[1], inner[1], strict=True))


def prove(sweep: Sweep, pairs: Collection[SolidPair], counter: ProgressCounter | None = None) -> None:
    """Compare pairs in all positions of the ranges that move them, and record the results in the pairs. `counter` counts the pairs."""
    groups: dict[frozenset[int], list[SolidPair]] = {}
    for pair in pairs:
        _, moving, looped = sweep.joints_between(pair.one, pair.other)
        pair.method = "followed" if looped else "proved"
        groups.setdefault(moving, []).append(pair)
    for moving, group in groups.items():
        inside = np.isin(np.arange(len(sweep.ranges)), [*moving])
        middle, half = np.where(inside, (sweep.upper + sweep.lower) / 2.0, sweep.initial), (sweep.upper - sweep.lower) / 2.0
        boxes = Counter(group)  # number of waiting boxes by pair
        for compared, undecided in compare_in_boxes(sweep.place, middle, np.where(inside, half, 0.0), group):
            if counter is not None:
                boxes.subtract(compared)
                boxes.update(2 * undecided)
                counter.add([boxes[pair] for pair in compared].count(0))


def sample(sweep: Sweep, pairs: Sequence[SolidPair], positions: Iterable[Sequence[float]]) -> int:
    """Compare pairs in `positions` of the ranges, which are points of the unit cube, and then descend to smaller distances.

    Record the results in the pairs. Return the number of positions in which the loops of the robot do not close.
    """
    from scipy.optimize import minimize

    def place_at(point: Sequence[float]) -> SolidPlace | None:
        return sweep.place(sweep.lower + np.asarray(point) * (sweep.upper - sweep.lower))

    missing = 0
    best: dict[int, Sequence[float]] = {}
    for point in positions:
        place = place_at(point)
        if place is None:
            missing += 1
            continue
        for pair in pairs:
            pair.method, previous_q = "sampled", pair.q
            if not pair.found:
                place.compare(pair, max(pair.floor, min(pair.gap, SEE)))
                best[id(pair)] = point if pair.q is not previous_q else best.get(id(pair), point)
    for pair in sorted((pair for pair in pairs if id(pair) in best and not pair.joined), key=lambda pair: pair.gap)[:NEAREST]:
        def descend(point: Sequence[float], pair: SolidPair = pair) -> float:
            place = place_at(point)
            return SEE if place is None or pair.found else place.compare(pair, pair.floor + SEE)

        minimize(descend, best[id(pair)], method="Nelder-Mead", bounds=[(0.0, 1.0)] * len(sweep.ranges), options={"maxfev": DESCENT})
    for pair in pairs:
        pair.method, pair.near = "sampled", pair.gap < pair.floor
    return missing

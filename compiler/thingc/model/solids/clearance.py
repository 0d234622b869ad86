"""Prove that parts stay apart while joints move through their ranges, or find a position in which two parts touch.

When joints move, the distance of two parts decreases at most by the longest path of any point of one part relative to the other part. If
the distance in the middle of a box of joint positions is greater than the longest such path to the border of the box, the parts do not
touch anywhere in the box. Other boxes are halved. See Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996 (conservative
advancement), and Schwarzer, Saha and Latombe, "Exact collision checking of robot paths", 2004.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thingc.base.joints.twist import Twist
from thingc.base.numeric import dist, hypot, inf, sum_of
from thingc.base.pose import Pose, Vector
from thingc.base.primitives import Primitive
from thingc.base.progress import ProgressCounter
from thingc.model.assembly.kinematics import coordinates, joints_of, leaders
from thingc.model.assembly.types import Occurrence
from thingc.model.resolve.coordinates import Mimic
from thingc.model.resolve.types import JointRange
from thingc.model.robot.kinematics import body_pose, in_world, with_ancestors
from thingc.model.robot.loop_solver import Loops, SolverState
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Keyframe, Robot
from thingc.model.solids.shapes import Solid

PROVED = 2
"""Largest number of moving joints between two parts for which all positions are proved."""
FINE = 1e-5
"""Resolution [m]: a box is not halved if no point of a part moves by more than this distance relative to the other part."""
SKIN = 1e-6
"""Smallest mean thickness [m] of an intersection that counts as more than contact."""
CLOSE = 1e-3
"""Distances are measured exactly up to this distance [m] above the required distance."""
FEW = 20_000
"""Number of pairs of triangles up to which all distances are measured exactly."""
SMALL, LARGE = 8.0, 3.0
"""The size of a part divided by the sizes of small and large balls that cover its surface."""
TOUCH = 1e-9
"""Rounding error of distances [m]."""
ALWAYS = 32
"""Number of positions after which two parts that have never been apart count as touching in all positions."""
MOST = 20_000
"""Largest number of positions at which two parts are compared."""
UNCLOSED = 64.0
"""A box in whose middle the loops do not close is halved until its width is the range divided by this number."""
SEE = 0.05
"""Largest distance [m] that is measured in samples."""
NEAREST, DESCENT = 10, 150
"""Number of pairs whose distance is minimized after sampling, and the number of positions for each pair."""
FOLLOWED = 2.0
"""Factor between the motion of a joint on a loop in a box, and its motion from the middle to the corners of the box."""
EXACT = 1e-7
"""Relative difference of the areas of a mesh and of the part up to which all faces of the part count as plane."""

Array = NDArray[np.float64]
Verdict = Literal["clear", "touches", "contact", "undecided"]


class Balls:
    """Balls that cover the surface of a solid: their centres `(n, 3)` and radii `(n,)` [m], and the index of the larger ball of each."""

    def __init__(self, low: Array, high: Array, size: float) -> None:
        """Cover boxes by balls. Boxes in the same cell of a grid whose cells have the size `size` [m] are in the same ball."""
        _, owner = np.unique(np.floor((low + high) / (2.0 * size)).astype(np.int64), axis=0, return_inverse=True)
        self.owner = owner.ravel()
        order = np.argsort(self.owner, kind="stable")
        starts = np.flatnonzero(np.r_[True, np.diff(self.owner[order]) > 0])
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
        x, y, z = middle.tolist()
        self.middle: Vector = (x, y, z)
        low, high = (bounds + np.array([[-1e-3], [1e-3]]) * self.radius).tolist()
        self.box: tuple[Vector, Vector] = (tuple(low), tuple(high))
        self.triangles = sum_of(int(core.num_tri()) for core, _ in solid.cores)
        self.slack = 1e-3 * self.radius if any(radius for _, radius in solid.cores) else 0.0

    @cached_property
    def balls(self) -> tuple[Balls, Balls]:
        """Small and large balls that cover the surface."""
        mesh = self.solid.whole.refine_to_length(self.radius / SMALL).to_mesh64()
        corners = np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts)]
        small = Balls(corners.min(axis=1), corners.max(axis=1), self.radius / SMALL)
        return small, Balls(small.low, small.high, self.radius / LARGE)

    def distance_bound(self, other: BoundedSolid, pose: Pose, within: float, *, coarse: bool = False) -> float:
        """Return a lower bound of the distance [m] to the surface of a body at a pose, or `within` if the distance is greater.

        With `coarse`, only large balls are compared.
        """
        turn, shift, slack = np.array(pose.rotation).T, np.array(pose.translation), self.slack + other.slack
        (fine, large), (fine_other, large_other) = self.balls, other.balls
        bounds = _ball_distances(large.centres, large.radii, large_other.centres @ turn + shift, large_other.radii) - slack
        near_pairs = bounds < within
        if coarse or not near_pairs.any():
            return min(float(bounds.min()), within)
        ours, theirs = np.asarray(near_pairs.any(axis=1))[large.owner], np.asarray(near_pairs.any(axis=0))[large_other.owner]
        centres, radii = fine_other.centres[theirs] @ turn + shift, fine_other.radii[theirs]
        return min(float(_ball_distances(fine.centres[ours], fine.radii[ours], centres, radii).min()) - slack, within)


def _ball_distances(ours: Array, radii: Array, theirs: Array, other_radii: Array) -> Array:
    """Return lower bounds of the distances `(n, m)` [m] of n balls from m other balls."""
    squares = (ours**2).sum(axis=1)[:, None] + (theirs**2).sum(axis=1)[None] - 2.0 * ours @ theirs.T
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)) - radii[:, None] - other_radii[None] - TOUCH)


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
class ComparedPair:
    """A comparison of two parts: their indices, their solids, and the result.

    `joined` pairs are on links that a joint connects, and may touch. All other pairs must be at least `clearance` [m] apart. Intersections
    are errors if their mean thickness is above `deep` [m]. `gap` is the smallest distance that was found, in the positions `q`; `depth`
    and `volume` describe the intersection in these positions. `method` is how the result was found. `seen` is the number of compared
    positions. `found` is True after a collision was found, and `near` if some box of positions could not be decided. If the parts have not
    been `apart` in the first `patience` positions, they count as touching in all positions.
    """

    one: int
    other: int
    bodies: tuple[BoundedSolid, BoundedSolid]
    joined: bool
    clearance: float
    deep: float
    patience: int = ALWAYS
    method: Literal["proved", "followed", "sampled"] = "proved"
    gap: float = inf
    depth: float = 0.0
    volume: float = 0.0
    q: Mapping[str, float] = field(default_factory=dict)
    found: bool = False
    apart: bool = False
    near: bool = False
    seen: int = 0

    @property
    def error(self) -> float:
        """The sum of the errors [m] of the surfaces of the parts."""
        return self.bodies[0].error + self.bodies[1].error

    @property
    def floor(self) -> float:
        """The distance [m] above which the parts are clear."""
        return self.clearance + (TOUCH if self.joined else self.error + SKIN)

    @property
    def done(self) -> bool:
        """Whether more positions would not change the result."""
        return self.found or self.seen >= (MOST if self.apart else self.patience)

    @property
    def verdict(self) -> Verdict:
        """The result. Parts are in `contact` if a joint connects their links and they touch without an intersection."""
        if self.found or (self.apart and self.depth > SKIN + self.error):
            return "touches"
        if not self.near and not self.done:
            return "clear"
        return "undecided" if not self.joined or self.seen >= MOST or (self.apart and self.depth > SKIN) else "contact"


@dataclass(eq=False)
class Box:
    """A box of joint positions: its middle and its half widths, by the index of the range, and the pairs that are not yet decided.

    `start` contains the joint positions from which the loops are closed.
    """

    middle: dict[int, float]
    half: dict[int, float]
    pairs: list[ComparedPair]
    start: Mapping[str, float] | None

    def halves(self, k: int, pairs: list[ComparedPair], start: Mapping[str, float] | None) -> Iterator[Box]:
        """Yield the two halves of the box along the range with the index `k`."""
        width = self.half[k] / 2.0
        for sign in (-1.0, 1.0):
            yield Box({**self.middle, k: self.middle[k] + sign * width}, {**self.half, k: width}, pairs, start)


class Place:
    """The robot at the positions `q` [rad or m] of all joints. Poses are computed when they are needed."""

    def __init__(self, sweep: Sweep, q: dict[str, float]) -> None:
        self.sweep, self.q = sweep, q
        self._bodies: dict[int, Pose] = {0: sweep.base}
        self._at: dict[int, Pose] = {}
        self._chains: dict[int, list[tuple[str, Twist]]] = {}

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

    def gap(self, pair: ComparedPair, within: float) -> float:
        """Return the distance [m] between two parts, or `within` if the distance is greater.

        A distance that is greater than the required distance plus `CLOSE` [m] is only a lower bound, unless the parts are simple.
        """
        a, b = pair.bodies
        relative = self.relative(pair)
        if dist(a.middle, relative.apply(b.middle)) - a.radius - b.radius >= within:
            return within
        low, high = relative.around(b.box)
        gaps = [max(low[k] - a.box[1][k], a.box[0][k] - high[k], 0.0) for k in range(3)]
        if hypot(*gaps) >= within:
            return within
        close = within if a.triangles * b.triangles <= FEW else min(within, pair.floor + CLOSE)
        if close >= within or (
            bound := a.distance_bound(b, relative, within, coarse=True)
        ) <= 0.0 or _encloses(a.box, (low, high)) or _encloses(b.box, relative.inverse().around(a.box)):
            gap = a.solid.gap(b.solid.at(relative), close)
            return gap if gap < close or close >= within else max(gap, a.distance_bound(b, relative, within))
        if bound < within:
            bound = a.distance_bound(b, relative, within)
        return bound if bound >= close else max(a.solid.gap(b.solid.at(relative), close), bound)

    def relative(self, pair: ComparedPair) -> Pose:
        """Return the pose of the second part in the frame of the first part."""
        return self.at(pair.one).inverse() @ self.at(pair.other)

    def overlap(self, pair: ComparedPair) -> tuple[float, float]:
        """Return the volume [m^3] and the mean thickness [m] of the intersection of two parts."""
        return pair.bodies[0].solid.overlap(pair.bodies[1].solid.at(self.relative(pair)))

    def compare(self, pair: ComparedPair, within: float) -> float:
        """Measure the distance [m] of two parts up to `within`, or their intersection, and record the result in the pair."""
        clear_gap = pair.clearance + pair.error + SKIN
        within = max(within, clear_gap + TOUCH)
        gap = self.gap(pair, within)
        volume, depth = self.overlap(pair) if gap <= 0.0 and pair.clearance == 0.0 else (0.0, 0.0)
        pair.seen += 1
        pair.apart |= gap > clear_gap
        pair.found |= gap < pair.clearance - TOUCH if pair.clearance > 0.0 else depth > pair.deep
        if gap < within and (depth, -gap) > (pair.depth, -pair.gap):
            pair.gap, pair.depth, pair.volume, pair.q = gap, depth, volume, self.q
        return gap

    def twists(self, pair: ComparedPair) -> list[tuple[str, Twist]]:
        """Return the joints between two parts, each with its twist in the world, in order from the first part to the second part."""
        up, down = self.sweep.chains_between(pair.one, pair.other)
        chain = [each for body in up for each in self._twists(body)]
        return [*chain, *reversed([each for body in down for each in self._twists(body)])]

    def travel(self, pair: ComparedPair, steps: Mapping[str, float]) -> float:
        """Return the longest path [m] of a point of one part relative to the other part, if joints move by at most `steps` [rad or m].

        The joints between the parts move one after another, from a joint in the middle outwards to each part. The distance of a part from
        the axis of a joint is therefore its current distance, and the best joint in the middle is used.
        """
        moving = [(steps[path], twist) for path, twist in self.twists(pair) if steps.get(path)]
        ends = [(self.at(part).apply(body.middle), body.radius) for part, body in zip((pair.one, pair.other), pair.bodies, strict=True)]
        first, second = ([step * speed(twist, *end) for step, twist in moving] for end in ends)
        return min((sum_of(first[:k]) + sum_of(second[k:]) for k in range(len(moving) + 1)), default=0.0)

    def _twists(self, body: int) -> list[tuple[str, Twist]]:
        if body not in self._chains:
            self._chains[body] = [
                (joint.path, twist) for joint, twist in in_world(self.sweep.robot.bodies[body], self._body_pose(body), self.q)
            ]
        return self._chains[body]


def speed(twist: Twist, middle: Vector, radius: float) -> float:
    """Return the largest speed [m per unit of q] of a point of a sphere that moves by a twist."""
    if not twist.turns:
        return 1.0
    x, y, z = (a - b for a, b in zip(middle, twist.anchor, strict=True))
    u, v, w = twist.angular
    return hypot(hypot(y * w - z * v, z * u - x * w, x * v - y * u) + radius, twist.pitch)


class Sweep:
    """A robot whose joints move through `ranges`, starting from a keyframe. All joints that mimic these joints move, too.

    If a range moves a loop, the loop is closed in each position. The motions of the joints on the loop are then estimated, not proved.
    """

    def __init__(self, robot: Robot, frame: Keyframe, ranges: Sequence[JointRange]) -> None:
        assembly = robot.assembly
        self.robot, self.ranges = robot, ranges
        self.base = frame.base or robot.bodies[0].X_PL
        self.in_link = in_link(assembly)
        index_of = {body.link: index for index, body in enumerate(robot.bodies)}
        self.body_of = [index_of[link] for link in assembly.link_of]
        self._joints = {joint.path: joint for joint in joints_of(assembly)}
        self._initial = {path: frame.q[path] for path, joint in self._joints.items() if joint.mimic is None}
        self._loops = Loops(robot.bodies, robot.closures, tuple(self._joints.values()), self.base) if robot.closures else None
        loop_joints = frozenset(self._joints) - self._loops.outside if self._loops is not None else frozenset()
        driven = {entry.joint for entry in ranges}
        self._loop_joints = loop_joints if loop_joints & driven else frozenset()
        self._movable = self._loop_joints - driven
        self._leaders = {path: leader for path, (leader, _, _) in leaders(self._joints.values(), frame.q).items()}
        self._chains: dict[tuple[int, int], tuple[list[int], list[int]]] = {}

    def chains_between(self, first: int, second: int) -> tuple[list[int], list[int]]:
        """Return the bodies from each of two parts up to, but not including, the first body that carries both."""
        ends = self.body_of[first], self.body_of[second]
        if ends not in self._chains:
            up, down = (list(with_ancestors(self.robot.bodies, end)) for end in ends)
            self._chains[ends] = ([body for body in up if body not in down], [body for body in down if body not in up])
        return self._chains[ends]

    def moving(self, first: int, second: int) -> tuple[frozenset[int], bool]:
        """Return the indices of the ranges that move two parts relative to each other, and whether a loop moves the parts."""
        paths = {joint.path for chain in self.chains_between(first, second) for body in chain for joint in self.robot.bodies[body].joints}
        leads = {self._leaders[path] for path in paths}
        looped = not leads.isdisjoint(self._loop_joints)
        moving = leads | self._loop_joints if looped else leads
        return frozenset(k for k, entry in enumerate(self.ranges) if entry.joint in moving), looped

    def place(self, x: Mapping[int, float], start: Mapping[str, float] | None = None) -> Place | None:
        """Return the robot with the joints of the ranges at `x`, by the index of the range. Return None if its loops do not close.

        `start` contains the positions from which the solver begins.
        """
        values = {**self._initial, **{path: (start or self._initial)[path] for path in self._movable if path in self._initial}}
        q = coordinates(self._joints.values(), values | {self.ranges[k].joint: value for k, value in x.items()})
        if self._loop_joints and self._loops is not None:
            solution = self._loops.close(SolverState(q=q, base=self.base), self._movable, base_moves=False)
            if not solution.closed:
                return None
            q = solution.state.q
        return Place(self, q)

    def steps(self, place: Place, x: Mapping[int, float], half: Mapping[int, float]) -> dict[str, float]:
        """Return how far [rad or m] each joint moves at most from the middle of a box, whose half widths are `half`."""
        widths = {self.ranges[k].joint: width for k, width in half.items()}
        steps = dict(widths)
        for path, joint in self._joints.items():
            if joint.mimic is not None and self._leaders[path] in widths:
                steps[path] = self._rate(path, place.q, widths) * widths[self._leaders[path]]
        if not self._loop_joints:
            return steps
        steps |= dict.fromkeys(self._movable, 0.0)
        for signs in np.ndindex(*[2] * len(half)):
            corner = {k: x[k] + (2 * sign - 1) * width for sign, (k, width) in zip(signs, half.items(), strict=True)}
            corner_place = self.place(corner, place.q)
            for path in self._movable if corner_place is not None else ():
                steps[path] = max(steps[path], FOLLOWED * abs(corner_place.q[path] - place.q[path]))  # type: ignore[union-attr]
        return steps

    def _rate(self, path: str, q: Mapping[str, float], half: Mapping[str, float]) -> float:
        """Return a bound of the derivative of a joint by the joint that it mimics, within the half width of this joint."""
        mimic = self._joints[path].mimic
        if mimic is None or mimic.joint.path not in self._joints:
            return 1.0
        inner = self._rate(mimic.joint.path, q, half)
        return _steepest(mimic, abs(q[mimic.joint.path]) + inner * half[self._leaders[path]]) * inner


def _steepest(mimic: Mimic, bound: float) -> float:
    """Return an upper bound of the absolute slope of a mimic, if the absolute position of the other joint is at most `bound`."""
    return sum_of(k * abs(c) * bound ** (k - 1) for k, c in enumerate(mimic.polynomial) if k)


def _encloses(outer: tuple[Vector, Vector], inner: tuple[Vector, Vector]) -> bool:
    return all(a < b and c > d for a, b, c, d in zip(outer[0], inner[0], outer[1], inner[1], strict=True))


def prove(sweep: Sweep, pairs: Collection[ComparedPair], counter: ProgressCounter | None = None) -> None:
    """Compare pairs in all positions of the ranges that move them, and record the results in the pairs. `counter` counts the pairs."""
    groups: dict[frozenset[int], list[ComparedPair]] = {}
    for pair in pairs:
        moving, looped = sweep.moving(pair.one, pair.other)
        pair.method = "followed" if looped else "proved"
        groups.setdefault(moving, []).append(pair)
    for moving, group in groups.items():
        ends = {k: (sweep.ranges[k].lower, sweep.ranges[k].upper) for k in sorted(moving)}
        middle, half = ({k: (high + sign * low) / 2.0 for k, (low, high) in ends.items()} for sign in (1.0, -1.0))
        waiting = deque([Box(middle, half, group, None)])
        boxes = Counter(group)  # number of waiting boxes by pair
        while waiting:
            box = waiting.popleft()
            waiting.extend(halves := [*_compare_in_box(sweep, box)])
            boxes.subtract(box.pairs)
            boxes.update(pair for half in halves for pair in half.pairs)
            if counter is not None:
                counter.add([boxes[pair] for pair in box.pairs].count(0))


def _compare_in_box(sweep: Sweep, box: Box) -> Iterator[Box]:
    """Compare the pairs of a box. Yield the two halves of the box with the pairs that are not decided in the box."""
    active = [pair for pair in box.pairs if not pair.done]
    place = sweep.place(box.middle, box.start) if active else None
    if place is None:
        if active and any(width > (sweep.ranges[k].upper - sweep.ranges[k].lower) / UNCLOSED for k, width in box.half.items()):
            yield from box.halves(max(box.half, key=lambda k: box.half[k] / (sweep.ranges[k].upper - sweep.ranges[k].lower)), active, None)
        return
    steps = sweep.steps(place, box.middle, box.half)
    undecided: list[ComparedPair] = []
    for pair in active:
        motion = place.travel(pair, steps)
        gap = place.compare(pair, pair.floor + motion)
        if gap >= pair.floor + motion:
            continue
        fine = FINE if gap > TOUCH else max(FINE, pair.deep / 2.0)  # parts in contact then overlap by less than an error
        if motion <= fine or (gap >= pair.clearance + motion and (gap < pair.floor or pair.near)):
            pair.near = True
        else:
            undecided.append(pair)
    if undecided:
        widest = next(iter(box.half))
        if len(box.half) > 1:
            pair = undecided[0]
            widest = max(box.half, key=lambda k: place.travel(pair, sweep.steps(place, box.middle, {k: box.half[k]})))
        yield from box.halves(widest, undecided, place.q)


def sample(sweep: Sweep, pairs: Sequence[ComparedPair], positions: Iterable[Sequence[float]]) -> int:
    """Compare pairs in `positions` of the ranges, which are points of the unit cube, and then descend to smaller distances.

    Record the results in the pairs. Return the number of positions in which the loops of the robot do not close.
    """
    from scipy.optimize import minimize

    def x_of(point: Sequence[float]) -> dict[int, float]:
        return {k: one.lower + float(part) * (one.upper - one.lower) for k, (one, part) in enumerate(zip(sweep.ranges, point, strict=True))}

    missing = 0
    best: dict[int, Sequence[float]] = {}
    for point in positions:
        place = sweep.place(x_of(point))
        if place is None:
            missing += 1
            continue
        for pair in pairs:
            previous_q = pair.q
            if not pair.found:
                place.compare(pair, max(pair.floor, min(pair.gap, SEE)))
                best[id(pair)] = point if pair.q is not previous_q else best.get(id(pair), point)
    for pair in sorted((pair for pair in pairs if id(pair) in best and not pair.joined), key=lambda pair: pair.gap)[:NEAREST]:
        def descend(point: Sequence[float], pair: ComparedPair = pair) -> float:
            place = sweep.place(x_of(point))
            return SEE if place is None or pair.found else place.compare(pair, pair.floor + SEE)

        minimize(descend, best[id(pair)], method="Nelder-Mead", bounds=[(0.0, 1.0)] * len(sweep.ranges), options={"maxfev": DESCENT})
    for pair in pairs:
        pair.method, pair.near = "sampled", pair.gap < pair.floor
    return missing

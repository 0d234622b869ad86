"""Find the maps between two mechanisms: which link and which joint of one robot is which of the other, with signs and zeros.

The search begins with one link, and adds one joint with the link behind it in each step. After each step, only the best partial maps
remain.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from thingc.tools.same.features import (
    DISTINCT,
    Array,
    AxisLine,
    LinkFeature,
    Motion,
    Port,
    RigidLink,
    apply,
    cross,
    rigid_links,
    rotation_between,
)
from thingc.tools.same.mechanism import Mechanism

MOST = 64
"""Maximum number of maps that are searched for. A robot with more maps is reported as having at least this number."""
WIDTH, FEW = 256, 16
"""Maximum number of partial maps: without differences, and if values may differ."""
MARGIN = 2
"""A partial map remains if it has at most this number of differences more than the best one."""
FEATURES = 3
"""Number of features of a link that are used to place it, if values may differ."""
NEAREST = 3
"""Number of joints of a link, the nearest first, that may be a joint of the other robot, if values may differ."""
CLOSED = 3.0
"""Factor of the tolerance up to which the two ends of a joint may differ, because errors of several joints of a loop add up."""


class LinkMap(NamedTuple):
    """A link of A that is the link `other` of B at the pose `T`. `apart` are the differences of mass (fraction), centre [m] and inertia.

    `axes` are the differences of each axis of A from each axis of B: angle [rad], distance [m] and lead [m/rad]. `nearest` contains the
    smallest of them for each axis of A. `misfits` is the cost of masses, centres, inertias and axes that differ. `free` means that neither
    masses nor axes determine the zero of the joint before the link.
    """

    other: int
    T: Array
    apart: tuple[float, float, float]
    axes: Array
    nearest: Array
    misfits: float
    free: bool = False


class JointMap(NamedTuple):
    """A joint of A that is a joint of B: `q_B = sign * q_A + zero` [rad or m].

    `free` is True if neither masses nor joint axes determine `zero`. `ends` are the ends of the joints in A and B at which the search met
    them. `apart` is the difference of the axes: angle [rad], distance [m] and lead [m/rad].
    """

    one: int
    other: int
    sign: int
    zero: float
    free: bool
    ends: tuple[int, int]
    apart: tuple[float, ...]


class RobotMap(NamedTuple):
    """A map from mechanism A to mechanism B, or a part of one. The keys of `links` are links of A.

    `joints` are in the order of the search, which visits each joint after its nearer link. `misfits` counts the values that differ.
    """

    links: dict[int, LinkMap]
    joints: tuple[JointMap, ...]
    misfits: float


def find_maps(one: Mechanism, other: Mechanism, tolerance: float, *, exact: bool = True) -> list[RobotMap]:
    """Return the maps from `one` to `other`, at most `MOST`. Maps that preserve names and have small zeros come first.

    If `exact` is false, masses, inertias and axes may differ, and the first map has the fewest differences.
    """
    different: dict[tuple[object, ...], RobotMap] = {}
    for found in _Search(one, other, tolerance, exact).maps():
        links = ((a, link.other) for a, link in sorted(found.links.items()))
        joints = ((j.one, j.other, j.sign, round(j.zero, 4)) for j in sorted(found.joints))
        different.setdefault((*links, *joints), found)
    return list(different.values())[:MOST]


class _Search:
    """The search for maps from mechanism A to mechanism B. Lists and attributes contain A first."""

    def __init__(self, one: Mechanism, other: Mechanism, tolerance: float, exact: bool) -> None:
        self.mechanisms = (one, other)
        self.tolerance, self.exact, self.most = tolerance, exact, 1 if exact else FEATURES
        self.links = tuple(rigid_links(robot, tolerance) for robot in (one, other))

    def maps(self) -> list[RobotMap]:
        """Return the maps that are found, the best first."""
        A, B = self.links
        shapes = [[sorted(port.tag for port in link.ports) for link in links] for links in self.links]
        if sorted(shapes[0]) != sorted(shapes[1]):
            return []
        start = min(range(len(A)), key=lambda n: (shapes[0].count(shapes[0][n]), A[n].mass == 0.0, -len(A[n].ports)))
        others = (n for n, shape in enumerate(shapes[1]) if shape == shapes[0][start])
        placed = (self._link(start, b, T) for b in others for T in self._starts(A[start], B[b]))
        found = self._keep_best(RobotMap({start: link}, (), link.misfits) for link in placed)
        for near, port in _joints_from(A, start):
            found = self._keep_best(longer for part in found for longer in self._extend(part, near, port))
        return found

    def _keep_best(self, found: Iterable[RobotMap]) -> list[RobotMap]:
        """Return the best of partial maps, the best first."""
        ranked = sorted((one for one in found if not (self.exact and one.misfits)), key=self._rank)
        return [one for one in ranked if one.misfits <= ranked[0].misfits + MARGIN][: WIDTH if self.exact else FEW]

    def _cost(self, *apart: float) -> float:
        """Return the number of differences, plus their sizes."""
        return sum(1.0 + min(value, 1.0) for value in apart if value > self.tolerance)

    def _rank(self, found: RobotMap) -> tuple[float, int, int, float]:
        """Return a key by which better maps come first: fewer differences, more names preserved, fewer signs and zeros changed."""
        A, B = self.mechanisms
        equal_names = sum(A.links[a].name == B.links[link.other].name for a, link in found.links.items())
        equal_names += sum(A.joints[j.one].name == B.joints[j.other].name for j in found.joints)
        return round(found.misfits, 6), -equal_names, sum(j.sign < 0 for j in found.joints), sum(abs(j.zero) for j in found.joints)

    # --- links -------------------------------------------------------------------------------------------------------

    def _link(self, a: int, b: int, T: Array) -> LinkMap:
        """Compare two links. `T` is the pose of the link of A in the frame of the link of B."""
        one, other = self.links[0][a], self.links[1][b]
        mass_errors, axes = mass_differences(one, other, T), axis_differences(one, other, T, self.tolerance)
        nearest = axes.max(axis=2, initial=0.0).min(axis=1, initial=np.inf)
        return LinkMap(b, T, mass_errors, axes, nearest, self._cost(*mass_errors, *nearest))

    def _starts(self, a: RigidLink, b: RigidLink, centres: tuple[Array, Array] | None = None) -> list[Array]:
        """Return different poses of `a` in `b` that may move all features of `a` to those of `b`.

        `centres` are a point of `a` and the same point of `b`, if known.
        """
        given = [[] if centres is None else [LinkFeature("given", centre, None)] for centre in centres or (None, None)]
        found: list[Array] = []
        for T in self._starts_with([*given[0], *a.features], [*given[1], *b.features]):
            if all(np.abs(T - known).max() > DISTINCT for known in found):
                found.append(T)
        return found

    def _starts_with(self, ones: list[LinkFeature], others: list[LinkFeature]) -> Iterator[Array]:
        """Yield poses that may move the features `ones` to `others`, beginning with the pose of one line."""
        lines = _lines(ones)
        if not lines:
            point, to = (next((f.point for f in features if f.point is not None), None) for features in (ones, others))
            T = np.eye(4)
            T[:3, 3] = 0.0 if point is None or to is None else to - point
            yield T
            return
        for (_, point, axis), sign in product((line for line in _lines(others) if line[0] == lines[0][0]), (1, -1)):
            line, turn = AxisLine(point, axis, self.tolerance), Motion("rotation", np.eye(4), point, axis, 0.0)
            T = _pose_between(lines[0][1], lines[0][2], point, sign * axis)
            for along in line.differences(others, [one.in_frame(T) for one in ones], turns=False, most=self.most) or [0.0]:
                shifted = T.copy()
                shifted[:3, 3] += along * axis
                for angle in line.differences(others, [one.in_frame(shifted) for one in ones], turns=True, most=self.most) or [0.0]:
                    yield turn.exponential(angle) @ shifted

    # --- joints ------------------------------------------------------------------------------------------------------

    def _extend(self, part: RobotMap, near: int, port: Port) -> Iterator[RobotMap]:
        """Yield a partial map with one more joint, and with the link behind the joint if it is not in the map."""
        link, known = part.links[near], part.links.get(port.other)
        joints, placed = {joint.other for joint in part.joints}, {one.other for one in part.links.values()}
        axis_errors = link.axes[port.row].max(axis=1)
        free = (target for target in self.links[1][link.other].ports if target.tag == port.tag and target.joint not in joints)
        targets = sorted(free, key=lambda target: float(axis_errors[target.row]))
        fitting = [target for target in targets if axis_errors[target.row] <= self.tolerance]
        for target in fitting if self.exact else targets[:NEAREST]:
            sign, X = _pose_behind(port.motion, target.motion, link.T)
            if known is not None and known.other == target.other:
                yield self._add_joint(part, link, known, port, target, sign, X)
            elif known is None and target.other not in placed:
                for far in self._far_links(port, target, sign, X):
                    yield self._add_joint(part, link, far, port, target, sign, X)

    def _far_links(self, port: Port, target: Port, sign: int, X: Array) -> Iterator[LinkMap]:
        """Yield maps of the link behind a joint. `X` is the pose of this link, at q = 0 in A, in the nearer link of B."""
        b = target.motion
        one, other = self.links[0][port.other], self.links[1][target.other]
        if b.kind == "ball":
            centres = _other_end(one, port).motion.point, _other_end(other, target).motion.point
            yield from (self._link(port.other, target.other, T) for T in self._starts(one, other, centres))
            return
        line, back = AxisLine(b.point, b.axis, self.tolerance), np.linalg.inv(b.X)
        placed, there = [feature.in_frame(X) for feature in one.features], [feature.in_frame(b.X) for feature in other.features]
        values = None
        if b.kind != "rotation":
            values = line.differences(placed, there, turns=False, most=self.most)
            values = values and [value / (b.pitch or 1.0) for value in values]
        if b.kind != "translation" and values is None:
            values = line.differences(placed, there, turns=True, most=self.most)
        zeros = [self._zero_of_limits(port, target, sign) or 0.0] if values is None or not self.exact else []
        found = [self._link(port.other, target.other, back @ b.exponential(-value) @ X) for value in (*(values or ()), *zeros)]
        if not self.exact and all(far.misfits for far in found):
            found += [self._link(port.other, target.other, T) for T in self._starts(one, other)]
        yield from (far._replace(free=values is None) for far in found)

    def _add_joint(self, part: RobotMap, link: LinkMap, far: LinkMap, port: Port, target: Port, sign: int, X: Array) -> RobotMap:
        """Return a map with one more joint and the link behind it. `link` and `far` are the maps of its two links."""
        b, zero = target.motion, 0.0
        rest: Array = np.eye(4)
        if b.kind != "ball":
            move = X @ np.linalg.inv(b.X @ far.T)
            zero, zero_of_limits = b.value(move), self._zero_of_limits(port, target, sign)
            if b.kind == "rotation" and zero_of_limits is not None:
                zero += 2.0 * np.pi * round((zero_of_limits - zero) / (2.0 * np.pi))
            rest = b.exponential(-zero) @ move
        loose = np.array([*_screw(rest, b.point, self.tolerance), 0.0])
        loose[loose <= CLOSED * self.tolerance] = 0.0
        back, back_b = (_other_end(self.links[n][one.other], one) for n, one in enumerate((port, target)))
        errors = np.max([loose, link.axes[port.row, target.row], far.axes[back.row, back_b.row]], axis=0).tolist()
        new = port.other not in part.links
        joint = JointMap(port.joint, target.joint, sign, zero, new and far.free, (port.end, target.end), tuple(errors))
        misfits = part.misfits + (far.misfits if new else 0.0) + self._cost(max(errors))
        misfits -= self._cost(link.nearest[port.row]) + self._cost(far.nearest[back.row])  # the links count the nearest axes
        return RobotMap({**part.links, port.other: far}, (*part.joints, joint), misfits)

    def _zero_of_limits(self, port: Port, target: Port, sign: int) -> float | None:
        """Return the zero for which the middle of the limits of a joint is the same, or None if a joint has no limits."""
        joints = self.mechanisms[0].joints[port.joint], self.mechanisms[1].joints[target.joint]
        ends = [end for joint in joints for end in joint.limits or (None,)]
        if None in ends:
            return None
        a_low, a_high, b_low, b_high = (float(end) for end in ends if end is not None)
        return (b_low + b_high) / 2.0 - sign * (a_low + a_high) / 2.0


def _joints_from(links: Sequence[RigidLink], start: int) -> Iterator[tuple[int, Port]]:
    """Yield all joints, depth first, each with its nearer link and its end there."""
    met, joints, waiting = {start}, set[int](), [(start, port) for port in links[start].ports]
    while waiting:
        near, port = waiting.pop()
        if port.joint not in joints:
            joints.add(port.joint)
            yield near, port
            if port.other not in met:
                met.add(port.other)
                waiting += [(port.other, further) for further in links[port.other].ports]


def _lines(features: Sequence[LinkFeature]) -> list[tuple[str, Array, Array]]:
    """Return the tags, points and axes of lines, the most exact first. Directions become lines through a point of the link."""
    point = next((one.point for one in features if one.point is not None), np.zeros(3))
    lines = sorted((one for one in features if one.axis is not None), key=lambda line: line.error)
    return [(one.tag, point if one.point is None else one.point, one.axis) for one in lines if one.axis is not None]


def _pose_between(point: Array, axis: Array, to: Array, direction: Array) -> Array:
    """Return the pose that moves a point to the point `to` and turns the unit vector `axis` to `direction`, by the smallest rotation."""
    pose = np.eye(4)
    pose[:3, :3] = rotation_between(axis, direction)
    pose[:3, 3] = to - pose[:3, :3] @ point
    return pose


def _other_end(link: RigidLink, port: Port) -> Port:
    return next(back for back in link.ports if back.joint == port.joint and back.end != port.end)


def mass_differences(a: RigidLink, b: RigidLink, T: Array) -> tuple[float, float, float]:
    """Return how much the mass (as a fraction), the centre of mass [m] and the inertia (as a fraction) of two links differ.

    `T` is the pose of link `a` in the frame of link `b`. Fractions refer to the mass and the largest moment of inertia of `a`, or
    of `b` if they are 0.
    """
    turned = T[:3, :3] @ a.inertia @ T[:3, :3].T
    mass = abs(a.mass - b.mass) / (a.mass or b.mass or 1.0)
    centre = float(np.linalg.norm(apply(T, a.centre) - b.centre)) if min(a.mass, b.mass) > 0.0 else 0.0
    return mass, centre, float(np.max(abs(turned - b.inertia)) / (a.moments[2] or b.moments[2] or 1.0))


def axis_differences(a: RigidLink, b: RigidLink, T: Array, tolerance: float) -> Array:
    """Return how much the axes of ports differ: the angle [rad], the distance [m] and the travel per turn [m/rad], as an array (n, n, 3).

    `T` is the pose of link `a` in the frame of link `b`. Axes whose angle is larger than `tolerance` have the shortest distance between
    them. Centres of ball joints have only a distance, and translations only an angle. Ports with different tags have infinite differences.
    """
    away = (a.points @ T[:3, :3].T + T[:3, 3])[:, None] - b.points
    found = np.zeros((len(a.ports), len(b.ports), 3))
    axes = a.axes @ T[:3, :3].T
    across = cross(axes[:, None], b.axes)
    sine = np.linalg.norm(across, axis=2)
    found[:, :, 0] = np.arctan2(sine, abs(axes @ b.axes.T))
    shortest = abs((away * across).sum(axis=2)) / np.maximum(sine, tolerance)
    found[:, :, 1] = np.where(sine > tolerance, shortest, np.linalg.norm(cross(away, b.axes), axis=2))
    for n, m in np.ndindex(found.shape[:2]):
        one, other = a.ports[n], b.ports[m]
        if one.tag != other.tag:
            found[n, m] = np.inf
        elif one.motion.kind == "ball":
            found[n, m] = 0.0, np.linalg.norm(away[n, m]), 0.0
        elif one.motion.kind == "translation":
            found[n, m, 1] = 0.0
        found[n, m, 2] += abs(one.motion.pitch - other.motion.pitch)
    return found


def _pose_behind(a: Motion, b: Motion, T: Array) -> tuple[int, Array]:
    """Return the sign of the joint of A in B, and the pose of the other link of A, at q = 0, in the link of B.

    `T` is the pose of the nearer link of A in the link of B. The result includes the small motion that moves the axis exactly to that of B.
    """
    if a.kind == "ball":
        return 1, T @ a.X
    point, axis = apply(T, a.point), T[:3, :3] @ a.axis
    sign = 1 if axis @ b.axis > 0.0 else -1
    to = point if a.kind == "translation" else b.point + ((point - b.point) @ b.axis) * b.axis
    return sign, _pose_between(point, axis, to, sign * b.axis) @ T @ a.X


def _screw(X: Array, point: Array, tolerance: float) -> tuple[float, float]:
    """Return the angle of a motion [rad], and its translation along the axis [m], or the distance that `point` moves if the motion is a
    translation.
    """
    r, away = X[:3, :3], apply(X, point) - point
    axis = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / 2.0
    sine = float(np.linalg.norm(axis))
    angle = float(np.arctan2(sine, (np.trace(r) - 1.0) / 2.0))
    return angle, float(abs(away @ axis) / sine if sine > tolerance else np.linalg.norm(away))

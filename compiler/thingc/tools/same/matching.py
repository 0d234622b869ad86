"""Find all maps between two mechanisms: which link and which joint of one robot is which of the other, with signs and zeros."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from thingc.tools.same.features import (
    Array,
    LinkFeature,
    Motion,
    Port,
    RigidLink,
    features_of,
    joint_values,
    line_poses,
    rigid_links,
    rotation_between,
    rotations,
    translations,
)
from thingc.tools.same.mechanism import Mechanism, MechanismJoint

MOST = 64
"""Maximum number of maps that are searched for. A robot with more maps is reported as having at least this number."""
FEW = 4
"""Maximum number of maps of each part of a robot if values may differ."""
STEPS = 3_000
"""Maximum number of placed links in a search for differences."""
CLOSED = 3.0
"""Factor of the tolerance up to which the two ends of a loop may differ, because errors of several joints add up."""
OF_MASS = ("centre of mass", "principal axis 0", "principal axis 1", "principal axis 2")
"""The tags of the features that depend on the mass distribution of a link."""


class JointMap(NamedTuple):
    """A joint of A that is a joint of B: `q_B = sign * q_A + zero` [rad or m].

    `free` means that neither masses nor axes determine the zero. `ends` are the ends of the joints in A and B at which the search met them.
    """

    one: int
    other: int
    sign: int
    zero: float
    free: bool
    ends: tuple[int, int]


class RobotMap(NamedTuple):
    """A map from mechanism A to mechanism B, or a part of one. `links` maps a link of A to a link of B and to its pose in this link.

    `joints` are in the order of the search, which visits each joint after its nearer link. `cuts` are ends of joints of A that close loops,
    each with the joint and the end in B. `misfits` counts the masses, centres of mass, inertias and axes that differ.
    """

    links: dict[int, tuple[int, Array]]
    joints: tuple[JointMap, ...] = ()
    cuts: tuple[tuple[int, int, int, int], ...] = ()
    misfits: int = 0

    def with_part(self, part: RobotMap) -> RobotMap:
        """Return the union of this map and another part of the same map."""
        return RobotMap(
            {**self.links, **part.links}, self.joints + part.joints, self.cuts + part.cuts, self.misfits + part.misfits,
        )


class Tolerances(NamedTuple):
    """The differences up to which values are equal (`exact`: [m], [rad], or a fraction of masses), and axes may differ (`geometry`).

    At most `misfits` masses, centres of mass, inertias and axes may differ; if it is not 0, masses may differ by any amount.
    """

    exact: float
    geometry: float
    misfits: int = 0


def find_maps(one: Mechanism, other: Mechanism, tolerances: Tolerances) -> list[RobotMap]:
    """Return the maps from `one` to `other`, at most `MOST`. Maps that preserve names and have small zeros come first.

    If values may differ, the result contains only the first maps that are found.
    """
    if len(one.links) != len(other.links) or Counter(j.kind for j in one.joints) != Counter(j.kind for j in other.joints):
        return []
    return _Search(one, other, tolerances).maps()


class _Search:
    """The search for maps from mechanism A to mechanism B. Lists and attributes contain A first."""

    def __init__(self, one: Mechanism, other: Mechanism, tolerances: Tolerances) -> None:
        self.mechanisms = (one, other)
        self.links = tuple(rigid_links(robot, tolerances.exact) for robot in (one, other))
        self.tolerances = tolerances
        self.tree: set[int] = set()
        self.exact = tolerances.misfits == 0
        self.most = MOST if self.exact else FEW
        self.steps = STEPS
        self.likeness = [[_likeness(a, b, tolerances.exact) for b in self.links[1]] for a in self.links[0]]
        self.least = 2 if self.exact else 1

    def maps(self) -> list[RobotMap]:
        """Return all maps, the best first. If values may differ, stop at the first maps."""
        if any(max(line) < self.least for line in (*self.likeness, *zip(*self.likeness, strict=True))):
            return []
        counts = [row.count(2) or len(row) + 1 for row in self.likeness]
        start = min(range(len(counts)), key=lambda n: (counts[n], self.links[0][n].mass == 0.0, -len(self.links[0][n].ports)))
        self.tree = self._spanning_tree(start)
        found: list[RobotMap] = []
        for b in sorted(range(len(counts)), key=lambda n: -self.likeness[start][n]):
            for T in self._starts(self.links[0][start], self.links[1][b]) if self.likeness[start][b] >= self.least else ():
                found += [whole for part in self._placed(start, b, T, None, None) if (whole := self._closed(part)) is not None]
                if found and not self.exact:
                    return sorted(found, key=self.rank)
        return _distinct(sorted(found, key=self.rank))[: self.most]

    def rank(self, found: RobotMap) -> tuple[int, int, int, float]:
        """Return a key by which better maps come first: fewer differences, more names preserved, fewer signs and zeros changed."""
        A, B = self.mechanisms
        kept = sum(A.links[a].name == B.links[b].name for a, (b, _) in found.links.items())
        kept += sum(A.joints[j.one].name == B.joints[j.other].name for j in found.joints)
        return found.misfits, -kept, sum(j.sign < 0 for j in found.joints), sum(abs(j.zero) for j in found.joints)

    def _spanning_tree(self, start: int) -> set[int]:
        met, tree, waiting = {start}, set(), [start]
        while waiting:
            for port in self.links[0][waiting.pop(0)].ports:
                if port.other not in met:
                    met.add(port.other)
                    tree.add(port.joint)
                    waiting.append(port.other)
        return tree

    # --- one link ----------------------------------------------------------------------------------------------------

    def _starts(self, a: RigidLink, b: RigidLink, centre: tuple[Array, Array] | None = None) -> Iterator[Array]:
        """Yield poses of `a` in `b` that may move all features of `a` to those of `b`.

        `centre` is a point of `a` and the same point of `b`, if known.
        """
        both = [features_of(a), features_of(b)]
        sets = [both]
        if not self.exact:  # also without the features of masses, which may differ
            sets.append([[one for one in found if one.tag not in OF_MASS] for found in both])
        for ones, others in sets:
            if centre is not None:
                ones, others = [LinkFeature("given", centre[0], None, 1e-3), *ones], [LinkFeature("given", centre[1], None, 1e-3), *others]
            yield from self._starts_with(ones, others)

    def _starts_with(self, ones: list[LinkFeature], others: list[LinkFeature]) -> Iterator[Array]:
        """Yield poses that may move the features `ones` to `others`, beginning with the pose of one line."""
        lines = _lines(ones)
        if not lines:
            point = next((f.point for f in ones if f.point is not None), None)
            to = next((f.point for f in others if f.point is not None), None)
            T = np.eye(4)
            T[:3, 3] = 0.0 if point is None or to is None else to - point
            yield T
            return
        line, limit = lines[0], self.tolerances.geometry
        for end in (found for found in _lines(others) if found.tag == line.tag):
            assert end.point is not None and end.axis is not None
            for T in line_poses(end, line):
                moved = [one.moved(T) for one in ones]
                for along in translations(end.point, end.axis, others, moved, limit) or [0.0]:
                    shift = np.eye(4)
                    shift[:3, 3] = along * end.axis
                    placed = [one.moved(shift) for one in moved]
                    for angle in rotations(end.point, end.axis, others, placed, limit) or [0.0]:
                        yield Motion("rotation", T, end.point, end.axis, 0.0).exponential(angle) @ shift @ T

    # --- the tree ----------------------------------------------------------------------------------------------------

    def _placed(self, a: int, b: int, T: Array, entry_a: Port | None, entry_b: Port | None) -> list[RobotMap]:
        """Return the maps of link `a` and of all links behind it, if `a` is link `b` at the pose `T`."""
        one, other = self.links[0][a], self.links[1][b]
        misfits = int(np.sum(mass_differences(one, other, T) > self.tolerances.exact))
        self.steps -= not self.exact
        if self.likeness[a][b] < self.least or misfits > self.tolerances.misfits or self.steps < 0:
            return []
        ports = [port for port in one.ports if entry_a is None or port.joint != entry_a.joint or port.far != entry_a.far]
        targets = [port for port in other.ports if entry_b is None or port.joint != entry_b.joint or port.far != entry_b.far]
        options: list[dict[int, list[RobotMap]]] = []
        for port in ports:
            found = {n: self._across(port, target, T) for n, target in enumerate(targets)}
            options.append({n: parts for n, parts in found.items() if parts})
            if not options[-1]:
                return []
        maps = [(RobotMap({a: (b, T)}, misfits=misfits), frozenset[int]())]
        for choices in sorted(options, key=len):
            maps = [
                (known.with_part(part), taken | {n})
                for known, taken in maps for n, parts in choices.items() if n not in taken for part in parts
                if known.misfits + part.misfits <= self.tolerances.misfits
            ]
            maps = sorted(maps, key=lambda item: self.rank(item[0]))[: self.most]
        return [known for known, _ in maps]

    def _across(self, port: Port, target: Port, T: Array) -> list[RobotMap]:
        """Return the maps of a joint and of all links behind it, if a port of A, placed at `T`, is the port `target` of B."""
        a, b = port.motion, target.motion
        apart = axis_differences(a, b, T)
        if a.kind != b.kind or max(apart) > self.tolerances.geometry:
            return []
        misfits = sum(one > self.tolerances.exact for one in apart)
        if port.joint not in self.tree:
            return [RobotMap({}, (), ((port.joint, port.far, target.joint, target.far),), misfits)]
        sign = _sign(a, b, T)
        one, other = self.links[0][port.other], self.links[1][target.other]
        back_a, back_b = _other_end(one, port), _other_end(other, target)
        maps: list[RobotMap] = []
        for zero, free, at in self._values(port, target, T, sign):
            for part in self._placed(port.other, target.other, at, back_a, back_b):
                if part.misfits + misfits > self.tolerances.misfits:
                    continue
                joint = JointMap(port.joint, target.joint, sign, zero, free, (port.far, target.far))
                maps.append(RobotMap(part.links, (joint, *part.joints), part.cuts, part.misfits + misfits))
            if not self.exact and any(part.misfits == 0 for part in maps):
                break
        return sorted(maps, key=self.rank)[: self.most]

    def _values(self, port: Port, target: Port, T: Array, sign: int) -> Iterator[tuple[float, bool, Array]]:
        """Yield the zeros for which the link behind a port may be the link behind `target`, and its pose in this link."""
        a, b = port.motion, target.motion
        one, other = self.links[0][port.other], self.links[1][target.other]
        X = _aligned(a, b, T, sign) @ T @ a.X
        back = np.linalg.inv(b.X)
        if b.kind == "ball":
            centres = (_other_end(one, port).motion.point, _other_end(other, target).motion.point)
            yield from ((0.0, False, at) for at in self._starts(one, other, centres))
            return
        placed = [feature.moved(X) for feature in features_of(one, _other_end(one, port))]
        there = [feature.moved(b.X) for feature in features_of(other, _other_end(other, target))]
        values = joint_values(b, placed, there, self.tolerances.exact)
        A, B = self.mechanisms[0].joints[port.joint], self.mechanisms[1].joints[target.joint]
        wanted = _zero_of_limits(A, B, sign)
        if values is not None and not self.exact:  # each feature may be one that differs
            values += [*chain(*(joint_values(b, [one], there, self.tolerances.exact) or () for one in placed)), wanted or 0.0]
        for value in [wanted or 0.0] if values is None else values:
            zero = _unwound(b, value, wanted)
            yield zero, values is None, back @ b.exponential(-zero) @ X

    # --- loops -------------------------------------------------------------------------------------------------------

    def _closed(self, part: RobotMap) -> RobotMap | None:
        """Return the map with the joints that close loops, or None if a link or joint of B is used twice or a loop does not fit."""
        ends: dict[int, list[tuple[int, int, int]]] = {}
        for joint, end, other, other_end in part.cuts:
            ends.setdefault(joint, []).append((end, other, other_end))
        joints = list(part.joints)
        for number, both in ends.items():
            (end, other, other_end), (_, again, other_again) = sorted(both)
            if other != again or other_end == other_again:
                return None
            closing = self._closing(part, number, other, (end, other_end))
            if closing is None:
                return None
            joints.append(closing)
        used = [b for b, _ in part.links.values()]
        if len(set(used)) < len(used) or len({j.other for j in joints}) < len(joints) or len(used) < len(self.links[1]):
            return None
        return RobotMap(part.links, tuple(joints), (), part.misfits)

    def _closing(self, part: RobotMap, number: int, other: int, ends: tuple[int, int]) -> JointMap | None:
        """Return the map of a joint that closes a loop, if its two links are placed so that it moves as in B."""
        A, B = self.mechanisms[0].joints[number], self.mechanisms[1].joints[other]
        near, far = (A.parent, A.child) if ends[0] == 0 else (A.child, A.parent)
        a = next(port for port in self.links[0][near].ports if port.joint == number and port.far == ends[0])
        b = next(port for port in self.links[1][part.links[near][0]].ports if port.joint == other and port.far == ends[1])
        T_near, T_far = part.links[near][1], part.links[far][1]
        sign = _sign(a.motion, b.motion, T_near)
        if b.motion.kind == "ball":
            return JointMap(number, other, 1, 0.0, False, ends)
        X = _aligned(a.motion, b.motion, T_near, sign) @ T_near @ a.motion.X
        move = X @ np.linalg.inv(b.motion.X @ T_far)
        zero = _unwound(b.motion, _value_of(b.motion, move), _zero_of_limits(A, B, sign))
        if np.abs(b.motion.exponential(zero) - move).max() > CLOSED * self.tolerances.geometry:
            return None
        return JointMap(number, other, sign, zero, False, ends)


def _lines(features: Sequence[LinkFeature]) -> list[LinkFeature]:
    """Return the lines among features, the most exact first. A direction becomes a line through a point of the link."""
    point = next((feature.point for feature in features if feature.point is not None), np.zeros(3))
    lines = [feature if feature.point is not None else feature._replace(point=point) for feature in features if feature.axis is not None]
    return sorted(lines, key=lambda line: line.error)


def _other_end(link: RigidLink, port: Port) -> Port:
    return next(back for back in link.ports if back.joint == port.joint and back.far != port.far)


def _likeness(a: RigidLink, b: RigidLink, limit: float) -> int:
    """Return 2 if two links have the same kinds of joints, mass and principal moments, 1 for the same kinds of joints only, otherwise 0."""
    if Counter(port.motion.kind for port in a.ports) != Counter(port.motion.kind for port in b.ports):
        return 0
    scale = max(a.moments[2], b.moments[2])
    return 2 if abs(a.mass - b.mass) <= limit * max(a.mass, b.mass) and np.all(abs(a.moments - b.moments) <= limit * scale) else 1


def mass_differences(a: RigidLink, b: RigidLink, T: Array) -> Array:
    """Return how much the mass (as a fraction), the centre of mass [m] and the inertia (as a fraction) of two links differ.

    `T` is the pose of link `a` in the frame of link `b`. Fractions refer to the larger mass and the largest moment of inertia.
    """
    turned = T[:3, :3] @ a.inertia @ T[:3, :3].T
    mass = abs(a.mass - b.mass) / max(a.mass, b.mass, 1e-300)
    centre = float(np.linalg.norm(T[:3, :3] @ a.centre + T[:3, 3] - b.centre)) if min(a.mass, b.mass) > 0.0 else 0.0
    return np.array([mass, centre, np.max(abs(turned - b.inertia)) / max(a.moments[2], b.moments[2], 1e-300)])


def axis_differences(a: Motion, b: Motion, T: Array) -> tuple[float, float, float]:
    """Return how much the axes of two joints differ: the angle [rad], the distance [m] and the travel per turn [m/rad].

    `T` is the pose of the link of `a` in the frame of the link of `b`. The centres of ball joints have only a distance.
    """
    away = T[:3, :3] @ a.point + T[:3, 3] - b.point
    if a.kind == "ball":
        return 0.0, float(np.linalg.norm(away)), 0.0
    angle = float(np.linalg.norm(np.cross(T[:3, :3] @ a.axis, b.axis)))
    distance = 0.0 if a.kind == "translation" else float(np.linalg.norm(np.cross(away, b.axis)))
    return angle, distance, abs(a.pitch - b.pitch)


def _sign(a: Motion, b: Motion, T: Array) -> int:
    """Return whether the axis of `a`, placed at `T`, has the direction of the axis of `b` (1) or the opposite direction (-1)."""
    return 1 if a.kind == "ball" or T[:3, :3] @ a.axis @ b.axis > 0.0 else -1


def _unwound(motion: Motion, value: float, wanted: float | None) -> float:
    """Return the value of a rotation plus the full turns by which it is nearest to `wanted`."""
    if motion.kind != "rotation" or wanted is None:
        return value
    return value + 2.0 * np.pi * round((wanted - value) / (2.0 * np.pi))


def _aligned(a: Motion, b: Motion, T: Array, sign: int) -> Array:
    """Return the small motion that moves the axis of `a`, placed at `T`, exactly to the axis of `b`."""
    move = np.eye(4)
    point = T[:3, :3] @ a.point + T[:3, 3]
    to = b.point
    if a.kind != "ball":
        move[:3, :3] = rotation_between(T[:3, :3] @ a.axis, sign * b.axis)
        to = point if a.kind == "translation" else b.point + ((point - b.point) @ b.axis) * b.axis
    move[:3, 3] = to - move[:3, :3] @ point
    return move


def _value_of(motion: Motion, move: Array) -> float:
    """Return the coordinate [rad or m] of a motion from its pose."""
    if motion.kind == "translation":
        return float(move[:3, 3] @ motion.axis)
    if motion.kind == "screw":
        return float((move[:3, :3] @ motion.point + move[:3, 3] - motion.point) @ motion.axis) / motion.pitch
    r = move[:3, :3]
    sine = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) @ motion.axis / 2.0
    return float(np.arctan2(sine, (np.trace(r) - 1.0) / 2.0))


def _zero_of_limits(one: MechanismJoint, other: MechanismJoint, sign: int) -> float | None:
    """Return the zero for which the middle of the limits of a joint is the same, or None if a joint has no limits."""
    ends = [end for joint in (one, other) for end in joint.limits or (None,)]
    if None in ends:
        return None
    a_low, a_high, b_low, b_high = (float(end) for end in ends if end is not None)
    return (b_low + b_high) / 2.0 - sign * (a_low + a_high) / 2.0


def _distinct(maps: Sequence[RobotMap]) -> list[RobotMap]:
    """Return the maps without those that are found twice."""
    found: dict[tuple[object, ...], RobotMap] = {}
    for one in maps:
        links = ((a, b) for a, (b, _) in sorted(one.links.items()))
        joints = ((j.one, j.other, j.sign, round(j.zero, 4)) for j in sorted(one.joints))
        found.setdefault(tuple(chain(links, joints)), one)
    return list(found.values())

"""Compare two mechanisms: whether they are the same, the map between them, and what differs."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
from numpy.polynomial import Polynomial

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineStruct
from thingc.tools.same.features import Array, apply, motion_of
from thingc.tools.same.matching import MOST, RobotMap, find_maps
from thingc.tools.same.mechanism import JointProperty, Mechanism

TOLERANCE = 1e-5
"""Default tolerance: about the precision of files with six digits."""
CONFIGURATIONS = 8
"""Number of random configurations in which poses of links are compared."""
SAMPLES = (-1.0, -0.6, 0.0, 0.3, 0.7, 1.0)
"""Coordinates of a leader in B at which couplings are compared [rad or m]. They distinguish polynomials of degree 4."""
EXACT = 1e-4
"""Fraction of the tolerance up to which values are equal but for rounding errors."""
REACH = 10.0
"""Factor of the tolerance per joint up to which poses of links may differ."""

Difference = Literal[
    "mass", "centre", "inertia", "axis angle", "axis position", "lead", "limits", "coupling", "pose", "links", "joints", "arrangement",
    JointProperty,
]
OF_LINKS: tuple[Difference, ...] = ("mass", "centre", "inertia")
OF_JOINTS: tuple[Difference, ...] = ("axis angle", "axis position", "lead")


class MechanismDifference(FrozenStruct):
    """A difference between a link or joint `one` of A and `other` of B, which are names.

    `old` and `new` are the values in A and B, both in the joint coordinates of B. `by` is the difference: a fraction for masses and
    inertias, a distance [m] for positions, an angle [rad] for axes. Differences in the numbers or the arrangement of links and joints have
    no names.
    """

    what: Difference
    one: str = ""
    other: str = ""
    old: Any = None
    new: Any = None
    by: float | None = None


class LinkMatch(FrozenStruct):
    """A matched pair of links, and the differences of their masses (relative), centres of mass [m] and inertias (relative)."""

    one: str
    other: str
    mass: float
    centre: float
    inertia: float


class JointMatch(FrozenStruct):
    """A joint of A and the same joint of B. Their coordinates are related by `q_B = sign * q_A + zero` [rad or m].

    If `determined` is false, no mass and no axis determines the zero, and the limits or 0 are used.
    """

    one: str
    other: str
    kind: str
    sign: int
    zero: float
    determined: bool


class MechanismComparison(OneLineStruct):
    """The result of a comparison of two mechanisms.

    `same` is true if they differ only in root, names, link frames, joint zeros and joint signs. `limits` and `properties` contain the
    limits and the other properties of joints that differ. They do not affect `same`. `maps` is the number of maps that fit best, and
    `assignments` the number of different assignments of links and joints among them. If `complete` is false, there can be more. `links` and
    `joints` are the best map. `residual` is the largest difference [m, rad] between poses of links in random configurations.
    """

    one: str
    other: str
    same: bool
    maps: int = 0
    assignments: int = 0
    complete: bool = True
    links: tuple[LinkMatch, ...] = ()
    joints: tuple[JointMatch, ...] = ()
    differences: tuple[MechanismDifference, ...] = ()
    limits: tuple[MechanismDifference, ...] = ()
    properties: tuple[MechanismDifference, ...] = ()
    residual: tuple[float, float] | None = None


def compare_mechanisms(one: Mechanism, other: Mechanism, tolerance: float = TOLERANCE, *, explain: bool = True) -> MechanismComparison:
    """Compare two mechanisms. `tolerance` is the largest difference of equal values: [m], [rad], or a fraction of masses and inertias.

    If `explain` is false, the differences of mechanisms that are not the same are not searched for.
    """
    return match_mechanisms(one, other, tolerance, explain=explain)[0]


def match_mechanisms(
    one: Mechanism, other: Mechanism, tolerance: float = TOLERANCE, *, explain: bool = True,
) -> tuple[MechanismComparison, RobotMap | None]:
    """Compare two mechanisms like `compare_mechanisms`. Also return the best map from `one` to `other`, or None if nothing fits."""
    maps = find_maps(one, other, tolerance)
    exact, complete = bool(maps), len(maps) < MOST
    if explain and not exact:
        maps = find_maps(one, other, tolerance, exact=False)
        maps = [found for found in maps if found.misfits <= maps[0].misfits + EXACT]
    if not maps:
        return MechanismComparison(one=one.name, other=other.name, same=False, differences=tuple(_counts(one, other))), None
    fits = [(any(_couplings(one, other, found, tolerance)), len(list(_properties(one, other, found, tolerance)))) for found in maps]
    maps = [found for found, fit in zip(maps, fits, strict=True) if fit == min(fits)]
    best = min(maps, key=lambda found: max(max(link.apart) for link in found.links.values()) > EXACT * tolerance)  # the first exact one
    pairs = {(frozenset((a, b.other) for a, b in found.links.items()), frozenset((j.one, j.other) for j in found.joints)) for found in maps}
    differences = [*_differences(one, other, best, tolerance), *_couplings(one, other, best, tolerance)]
    residuals, properties = residual(one, other, best), list(_properties(one, other, best, tolerance))
    if not differences and (not exact or max(residuals) > REACH * tolerance * (len(one.joints) + 1)):
        differences.append(MechanismDifference(what="pose", by=max(residuals)))
    return MechanismComparison(
        one=one.name, other=other.name, same=exact and not differences,
        maps=len(maps) if exact else 0, assignments=len(pairs) if exact else 0,
        complete=complete, links=tuple(_links(one, other, best)), joints=tuple(_joints(one, other, best)), differences=tuple(differences),
        limits=tuple(found for found in properties if found.what == "limits"),
        properties=tuple(found for found in properties if found.what != "limits"), residual=residuals,
    ), best


def _counts(one: Mechanism, other: Mechanism) -> Iterator[MechanismDifference]:
    """Yield the differences in the numbers of links and joints, or one difference if only their arrangement differs."""
    kinds = [Counter[str](joint.kind for joint in robot.joints) for robot in (one, other)]
    if len(one.links) != len(other.links):
        yield MechanismDifference(what="links", old=len(one.links), new=len(other.links))
    if kinds[0] != kinds[1]:
        old, new = (", ".join(f"{count} {kind}" for kind, count in sorted(found.items())) or "none" for found in kinds)
        yield MechanismDifference(what="joints", old=old, new=new)
    elif len(one.links) == len(other.links):
        yield MechanismDifference(what="arrangement")


def _links(one: Mechanism, other: Mechanism, best: RobotMap) -> Iterator[LinkMatch]:
    for a, link in sorted(best.links.items()):
        mass, centre, inertia = link.apart
        yield LinkMatch(one=one.links[a].name, other=other.links[link.other].name, mass=mass, centre=centre, inertia=inertia)


def _joints(one: Mechanism, other: Mechanism, best: RobotMap) -> Iterator[JointMatch]:
    for joint in sorted(best.joints):
        a, b = one.joints[joint.one], other.joints[joint.other]
        yield JointMatch(one=a.name, other=b.name, kind=a.kind, sign=joint.sign, zero=joint.zero, determined=not joint.free)


def _differences(one: Mechanism, other: Mechanism, best: RobotMap, tolerance: float) -> Iterator[MechanismDifference]:
    """Yield the differences of masses, centres of mass, inertias and axes."""
    for a, link in sorted(best.links.items()):
        A, B = one.links[a], other.links[link.other]
        for what, by in zip(OF_LINKS, link.apart, strict=True):
            if by > tolerance:
                old, new = (A.properties.mass, B.properties.mass) if what == "mass" else (None, None)
                yield MechanismDifference(what=what, one=A.name, other=B.name, old=old, new=new, by=by)
    for joint in sorted(best.joints):
        for what, by in zip(OF_JOINTS, joint.apart, strict=True):
            if by > tolerance:
                yield MechanismDifference(what=what, one=one.joints[joint.one].name, other=other.joints[joint.other].name, by=by)


def _couplings(one: Mechanism, other: Mechanism, best: RobotMap, tolerance: float) -> Iterator[MechanismDifference]:
    """Yield the differences of couplings between joints, in the coordinates of B."""
    maps = {joint.one: joint for joint in best.joints}
    ours, theirs = _followers(one), _followers(other)
    for number in {leader for leader, _ in ours.values()}:
        _change_leader(theirs, maps[number].other)
    for joint in sorted(best.joints):
        old, new = ours.get(joint.one), theirs.get(joint.other)
        if old is not None:
            leader = maps[old[0]]
            old = leader.other, joint.sign * old[1](Polynomial([-leader.sign * leader.zero, leader.sign])) + joint.zero
        if not _equal_couplings(old, new, tolerance):
            values = (None if found is None else (other.joints[found[0]].name, *map(float, found[1].coef)) for found in (old, new))
            names = one.joints[joint.one].name, other.joints[joint.other].name
            yield MechanismDifference(what="coupling", one=names[0], other=names[1], old=next(values), new=next(values))


Follower = tuple[int, Polynomial]
"""The joint that a joint follows directly or through other joints, and the polynomial in the coordinate of this joint."""


def _followers(robot: Mechanism) -> dict[int, Follower]:
    """Return the couplings of a robot. The joints that joints follow are not coupled."""
    numbers = {joint.name: number for number, joint in enumerate(robot.joints)}
    found: dict[int, Follower] = {}
    for number, joint in enumerate(robot.joints):
        leader, polynomial, coupling = number, Polynomial([0.0, 1.0]), joint.coupling
        while coupling is not None:
            leader, polynomial = numbers[coupling.leader], polynomial(Polynomial(coupling.polynomial))
            coupling = robot.joints[leader].coupling
        if leader != number:
            found[number] = leader, polynomial
    return found


def _change_leader(followers: dict[int, Follower], new: int) -> None:
    """Express couplings in the coordinate of the follower `new`, if it follows linearly."""
    leader, polynomial = followers.get(new, (new, Polynomial([0.0])))
    if polynomial.trim().degree() == 1:
        back = Polynomial([-polynomial.coef[0], 1.0]) / polynomial.coef[1]
        followers |= {number: (new, own(back)) for number, (first, own) in followers.items() if first == leader}
        followers[leader] = new, back
        del followers[new]


def _equal_couplings(old: Follower | None, new: Follower | None, tolerance: float) -> bool:
    if old is None or new is None or old[0] != new[0]:
        return old is new is None
    limit = tolerance * (1.0 + float(np.abs(new[1].coef).max()))
    return all(abs(old[1](x) - new[1](x)) <= limit for x in SAMPLES)


def _properties(one: Mechanism, other: Mechanism, best: RobotMap, tolerance: float) -> Iterator[MechanismDifference]:
    """Yield the differences of properties that both joints specify, in the coordinate of the joint in B."""
    for joint in sorted(best.joints):
        a, b = one.joints[joint.one], other.joints[joint.other]
        ends = tuple(None if end is None else joint.sign * end + joint.zero for end in (a.limits or ())[:: joint.sign])
        pairs = zip(ends, b.limits, strict=True) if ends and b.limits else ()
        if any(x != y and (x is None or y is None or abs(x - y) > tolerance) for x, y in pairs):
            yield MechanismDifference(what="limits", one=a.name, other=b.name, old=ends, new=b.limits)
        for what, new in b.properties.items():
            old = a.properties.get(what, new)
            if what == "rest" and what in a.properties:
                old = joint.sign * old + joint.zero
            if abs(old - new) > tolerance * (1.0 if what == "rest" else max(abs(old), abs(new))):
                yield MechanismDifference(what=what, one=a.name, other=b.name, old=old, new=new)


def residual(one: Mechanism, other: Mechanism, best: RobotMap) -> tuple[float, float]:
    """Return the largest differences between two robots: of link positions [m] and rotations [rad] in random configurations.

    Both robots are computed by forward kinematics from one link. Joints that close loops are ignored.
    """
    draw = random.Random(0)
    worst = np.zeros(2)
    for _ in range(CONFIGURATIONS):
        poses: dict[int, tuple[Array, Array]] = {}
        for joint in best.joints:
            p, q = one.joints[joint.one], other.joints[joint.other]
            near, far = (p.child, p.parent) if joint.ends[0] else (p.parent, p.child)
            T, T_far = best.links[near].T, best.links[far].T
            poses = poses or {near: (T, np.eye(4))}
            if far in poses:
                continue
            a, b = motion_of(p, joint.ends[0]), motion_of(q, joint.ends[1])
            low, high = (1.0 if end is None else end for end in p.limits or (None, None))
            value = draw.uniform(min(low, high) if p.limits else -1.0, max(low, high))
            if p.kind == "ball":  # about a random axis, from the same pose
                axis = np.array([draw.gauss(0.0, 1.0) for _ in range(3)])
                a = a._replace(axis=axis / np.linalg.norm(axis))
                b = b._replace(axis=T[:3, :3] @ a.axis, X=T @ a.X @ np.linalg.inv(T_far))
            X, Y = a.exponential(value) @ a.X, b.exponential(joint.sign * value + joint.zero) @ b.X
            poses[far] = poses[near][0] @ X, poses[near][1] @ Y
            apart, centre = poses[far][0] - poses[far][1] @ T_far, np.array(one.links[far].properties.centre)
            worst = np.maximum(worst, [np.linalg.norm(apply(apart, centre)), np.linalg.norm(apart[:3, :3]) / np.sqrt(2.0)])
    return float(worst[0]), float(worst[1])

"""The features of a link, which determine how it can be placed on a link of another robot, and the values of joints that place it so.

Features of a link are its centre of mass, its principal axes, and the axes and centres of its joints. Poses are 4 x 4 matrices.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thingc.base.inertia import principal_axes
from thingc.tools.same.mechanism import Mechanism, MechanismJoint, MechanismLink, MotionKind

Array = NDArray[np.float64]

NEAR_PARALLEL = 0.05
"""Sine of the angle between two axes below which the position of an axis determines a rotation better than its direction."""
DISTINCT = 1e-6
"""Difference of two values of a joint [rad or m] below which they are one candidate."""
SYMMETRIC = 2.0
"""Relative error of a feature above which no position of the feature is distinguished from another."""


class Motion(NamedTuple):
    """A joint as it is seen from one of its links: the pose `X` of the other link at q = 0, and the line about or along which it moves.

    The line passes through `point` in the direction `axis`. `pitch` is the translation per radian.
    """

    kind: MotionKind
    X: Array
    point: Array
    axis: Array
    pitch: float

    def exponential(self, q: float) -> Array:
        """Return the motion for the coordinate `q` [rad or m] as a pose (4, 4)."""
        pose = np.eye(4)
        if self.kind == "translation":
            pose[:3, 3] = q * self.axis
            return pose
        pose[:3, :3] = rotation_about(self.axis, q)
        pose[:3, 3] = self.point - pose[:3, :3] @ self.point + self.pitch * q * self.axis
        return pose


class Port(NamedTuple):
    """One end of a joint. `far` is 0 at the parent of the joint and 1 at its child. `motion` is as seen from this end."""

    joint: int
    far: int
    other: int
    motion: Motion


class LinkFeature(NamedTuple):
    """A point, line or direction of a link. Features with the same `tag` correspond. `error` is the relative error of its position.

    A point has no `axis`, and a direction has no `point`.
    """

    tag: str
    point: Array | None
    axis: Array | None
    error: float = 1.0

    def moved(self, X: Array) -> LinkFeature:
        """Return the feature in frame A. It is expressed in frame B, whose pose in A is `X`."""
        point = None if self.point is None else X[:3, :3] @ self.point + X[:3, 3]
        return self._replace(point=point, axis=None if self.axis is None else X[:3, :3] @ self.axis)


class RigidLink(NamedTuple):
    """A link with its mass properties in arrays, its principal moments in ascending order, its ports and its features of inertia."""

    name: str
    mass: float
    centre: Array
    inertia: Array
    moments: Array
    ports: list[Port]
    features: list[LinkFeature]


def rigid_links(mechanism: Mechanism, tolerance: float) -> list[RigidLink]:
    """Return the links of a mechanism with their features. Principal moments that differ by less than `tolerance` have no axes."""
    links = [_rigid_link(link, tolerance) for link in mechanism.links]
    for number, joint in enumerate(mechanism.joints):
        links[joint.parent].ports.append(Port(number, 0, joint.child, motion_of(joint, 0)))
        links[joint.child].ports.append(Port(number, 1, joint.parent, motion_of(joint, 1)))
    return links


def _rigid_link(link: MechanismLink, tolerance: float) -> RigidLink:
    own = link.properties
    centre, inertia = np.array(own.centre), np.array(own.inertia)
    values, axes = principal_axes(own.inertia)
    order = np.argsort(values)
    moments = np.array(values)[order]
    features = [LinkFeature("centre of mass", centre, None)] if own.mass > 0.0 else []
    for number, column in enumerate(order):
        gap = min(abs(moments[number] - other) for k, other in enumerate(moments) if k != number)
        if own.mass > 0.0 and gap > tolerance * moments[2]:
            features.append(LinkFeature(f"principal axis {number}", None, np.array(axes)[:, column], moments[2] / gap))
    return RigidLink(link.name, own.mass, centre, inertia, moments, [], features)


def motion_of(joint: MechanismJoint, end: int) -> Motion:
    """Return a joint as seen from its parent (`end` is 0) or from its child (1)."""
    X, twist = joint.pose, joint.twist
    if end:
        X = X.inverse()
        twist = twist.seen_from(X).reversed()
    return Motion(joint.kind, np.array(X.rows()), np.array(twist.anchor), np.array(twist.axis), twist.pitch)


def features_of(link: RigidLink, without: Port | None = None) -> list[LinkFeature]:
    """Return all features of a link in the frame of the link, but for those of the port `without`."""
    found = list(link.features)
    for port in link.ports:
        if without is not None and (port.joint, port.far) == (without.joint, without.far):
            continue
        motion = port.motion
        match motion.kind:
            case "ball":
                found.append(LinkFeature("ball", motion.point, None))
            case "translation":
                found.append(LinkFeature("translation", None, motion.axis))
            case _:
                found.append(LinkFeature(motion.kind, motion.point, motion.axis))
    return found


def joint_values(motion: Motion, one: Sequence[LinkFeature], other: Sequence[LinkFeature], tolerance: float) -> list[float] | None:
    """Return the values z of a joint for which `exp(motion z)` moves a feature of `other` to the corresponding feature of `one`.

    At least one of the values moves all features of `other` to those of `one`, if this is possible. Return None if the features do not
    determine the value.
    """
    if motion.kind == "translation":
        return translations(motion.point, motion.axis, one, other, tolerance)
    if motion.kind == "screw" and (along := translations(motion.point, motion.axis, one, other, tolerance)) is not None:
        return [value / motion.pitch for value in along]
    return rotations(motion.point, motion.axis, one, other, tolerance)


def rotations(point: Array, axis: Array, one: Sequence[LinkFeature], other: Sequence[LinkFeature], tolerance: float) -> list[float] | None:
    """Return the angles [rad] about a line that rotate `other` to `one`, or None if all features are symmetric about the line."""
    side = np.cross(axis, np.eye(3)[int(np.argmin(abs(axis)))])
    side /= np.linalg.norm(side)
    basis = np.array([side, np.cross(axis, side)])

    def radial(feature: LinkFeature) -> tuple[float, list[float]]:
        """Return the error of the angle of a feature, and its angles."""
        if feature.axis is not None:
            x, y = basis @ feature.axis
            size = float(np.hypot(x, y))
            if size > NEAR_PARALLEL or feature.point is None:
                angle = float(np.arctan2(y, x))
                return feature.error * tolerance / max(size, 1e-300), [angle, angle + np.pi]
        assert feature.point is not None
        away = feature.point - point
        if feature.axis is not None:  # the point of a nearly parallel line in the plane through `point`
            away = away - (away @ axis) / (feature.axis @ axis) * feature.axis
        x, y = basis @ away
        return feature.error * tolerance / max(float(np.hypot(x, y)), 1e-300), [float(np.arctan2(y, x))]

    return _differences([(f.tag, *radial(f)) for f in one], [(f.tag, *radial(f)) for f in other], turns=True)


def translations(
    point: Array, axis: Array, one: Sequence[LinkFeature], other: Sequence[LinkFeature], tolerance: float,
) -> list[float] | None:
    """Return the distances [m] along a line that move `other` to `one`, or None if no feature determines the distance."""

    def axial(feature: LinkFeature) -> tuple[float, list[float]]:
        """Return the error of the position of a feature along the line, and this position."""
        if feature.point is None:
            return 2.0 * SYMMETRIC, [0.0]
        away, error = feature.point - point, tolerance
        if feature.axis is not None:
            across = feature.axis - (feature.axis @ axis) * axis
            size = float(across @ across)
            if size < NEAR_PARALLEL**2:
                return 2.0 * SYMMETRIC, [0.0]
            away = away - (away @ across) / size * feature.axis
            error /= size**0.5
        return error, [float(away @ axis)]

    return _differences([(f.tag, *axial(f)) for f in one], [(f.tag, *axial(f)) for f in other], turns=False)


Located = tuple[str, float, list[float]]


def _differences(one: Sequence[Located], other: Sequence[Located], *, turns: bool) -> list[float] | None:
    """Return the differences of the most exact coordinate in `one` to all coordinates in `other` with the same tag, or None."""
    tag, error, values = min(one, key=lambda item: item[1], default=("", 2.0 * SYMMETRIC, []))
    if error > SYMMETRIC:
        return None
    found: list[float] = []
    for name, _, bases in other:
        for base in bases if name == tag else ():
            for value in values[:1]:
                difference = float(np.remainder(value - base + np.pi, 2.0 * np.pi) - np.pi) if turns else value - base
                if all(abs(difference - known) > DISTINCT for known in found):
                    found.append(difference)
    return found


def line_poses(line: LinkFeature, other: LinkFeature) -> Iterator[Array]:
    """Yield the two poses that move the line or direction `other` to `line`: with equal and with opposite directions."""
    assert line.axis is not None and line.point is not None and other.axis is not None and other.point is not None
    for sign in (1.0, -1.0):
        pose = np.eye(4)
        pose[:3, :3] = rotation_between(other.axis, sign * line.axis)
        pose[:3, 3] = line.point - pose[:3, :3] @ other.point
        yield pose


def rotation_about(axis: Array, angle: float) -> Array:
    """Return the rotation matrix (3, 3) of a rotation by `angle` [rad] about a unit vector (Rodrigues' formula)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: Array = np.eye(3) + np.sin(angle) * K + 2.0 * np.sin(angle / 2.0) ** 2 * (K @ K)
    return rotation


def rotation_between(one: Array, other: Array) -> Array:
    """Return the smallest rotation (3, 3) that turns the unit vector `one` to `other`."""
    across = np.cross(one, other)
    sine = float(np.linalg.norm(across))
    if sine < 1e-12:
        if one @ other > 0.0:
            return np.eye(3)
        across, sine = np.cross(one, np.eye(3)[int(np.argmin(abs(one)))]), 0.0
    return rotation_about(across / np.linalg.norm(across), float(np.arctan2(sine, one @ other)))

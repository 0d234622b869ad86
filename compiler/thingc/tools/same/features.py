"""The features of a link: its centre of mass, its principal axes, and the axes and centres of its joints. Poses are 4 x 4 matrices.

They determine how the link can be placed on a link of another robot, and the values of joints at which two links coincide.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thingc.base.inertia import principal_axes
from thingc.modes.frames import rotation
from thingc.tools.same.mechanism import Mechanism, MechanismJoint, MechanismLink, MotionKind

Array = NDArray[np.float64]

_NEXT, _LAST = [1, 2, 0], [2, 0, 1]
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
        pose[:3, :3] = rotation(q * self.axis)
        pose[:3, 3] = self.point - pose[:3, :3] @ self.point + self.pitch * q * self.axis
        return pose

    def value(self, pose: Array) -> float:
        """Return the coordinate [rad or m] of a motion from its pose."""
        if self.kind == "translation":
            return float(pose[:3, 3] @ self.axis)
        if self.kind == "screw":
            return float((apply(pose, self.point) - self.point) @ self.axis) / self.pitch
        r = pose[:3, :3]
        sine = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) @ self.axis / 2.0
        return float(np.arctan2(sine, (np.trace(r) - 1.0) / 2.0))


class Port(NamedTuple):
    """One end of a joint, at its parent (`end` is 0) or its child (1). `motion` is as seen from this end, and `other` is the other link.

    Only ports with the same `tag` correspond. `row` is the number of the port in its link.
    """

    joint: int
    end: int
    other: int
    motion: Motion
    tag: str
    row: int


class LinkFeature(NamedTuple):
    """A point, line or direction of a link. Features with the same `tag` correspond. `error` is the relative error of its position.

    A point has no `axis`, and a direction has no `point`.
    """

    tag: str
    point: Array | None
    axis: Array | None
    error: float = 1.0

    def in_frame(self, X: Array) -> LinkFeature:
        """Return the feature in frame A. It is expressed in frame B, whose pose in A is `X`."""
        point = None if self.point is None else apply(X, self.point)
        return self._replace(point=point, axis=None if self.axis is None else X[:3, :3] @ self.axis)


class RigidLink(NamedTuple):
    """A link with its mass properties in arrays, its principal moments in ascending order, its features and its ports.

    `points` and `axes` are those of the ports, as arrays (n, 3).
    """

    mass: float
    centre: Array
    inertia: Array
    moments: Array
    features: list[LinkFeature]
    ports: list[Port]
    points: Array
    axes: Array


def rigid_links(mechanism: Mechanism, tolerance: float) -> list[RigidLink]:
    """Return the links of a mechanism with their features. Principal moments that differ by less than `tolerance` have no axes.

    Ports that the graph of links and joints does not distinguish have equal tags.
    """
    shapes = [0] * len(mechanism.links)  # Weisfeiler and Leman: links are distinguished by the shapes of their neighbours
    for _ in shapes:
        around: list[list[tuple[str, int]]] = [[] for _ in shapes]
        for joint in mechanism.joints:
            around[joint.parent].append((joint.kind, shapes[joint.child]))
            around[joint.child].append((joint.kind, shapes[joint.parent]))
        shapes = [hash((shape, *sorted(found))) for shape, found in zip(shapes, around, strict=True)]
    ports: list[list[Port]] = [[] for _ in shapes]
    for number, joint in enumerate(mechanism.joints):
        for end, (here, there) in enumerate(((joint.parent, joint.child), (joint.child, joint.parent))):
            tag = f"{joint.kind} {shapes[here]} {shapes[there]}"
            ports[here].append(Port(number, end, there, motion_of(joint, end), tag, len(ports[here])))
    return [_rigid_link(link, own, tolerance) for link, own in zip(mechanism.links, ports, strict=True)]


def _rigid_link(link: MechanismLink, ports: list[Port], tolerance: float) -> RigidLink:
    properties = link.properties
    centre, inertia = np.array(properties.centre), np.array(properties.inertia)
    values, axes = principal_axes(properties.inertia)
    order = np.argsort(values)
    moments = np.array(values)[order]
    features = [LinkFeature("centre of mass", centre, None)] if properties.mass > 0.0 else []
    for number, column in enumerate(order):
        gap = min(abs(moments[number] - other) for k, other in enumerate(moments) if k != number)
        if properties.mass > 0.0 and gap > tolerance * moments[2]:
            features.append(LinkFeature(f"principal axis {number}", None, np.array(axes)[:, column], moments[2] / gap))
    for port in ports:
        kind, _, point, axis, _ = port.motion
        features.append(LinkFeature(port.tag, None if kind == "translation" else point, None if kind == "ball" else axis))
    points, directions = (np.array([getattr(port.motion, name) for port in ports]).reshape(-1, 3) for name in ("point", "axis"))
    return RigidLink(properties.mass, centre, inertia, moments, features, ports, points, directions)


def motion_of(joint: MechanismJoint, end: int) -> Motion:
    """Return a joint as seen from its parent (`end` is 0) or from its child (1)."""
    X, twist = joint.pose, joint.twist
    if end:
        X = X.inverse()
        twist = twist.seen_from(X).inverse()
    return Motion(joint.kind, np.array(X.rows()), np.array(twist.anchor), np.array(twist.axis), twist.pitch)


Located = tuple[str, float, list[float]]
"""The tag of a feature, the error of its coordinate, and the coordinate: two angles of a line without direction."""


class AxisLine(NamedTuple):
    """A line in space. Features are located by their angle about it and by their position along it. `tolerance` is their error."""

    point: Array
    axis: Array
    tolerance: float

    def differences(self, one: Sequence[LinkFeature], other: Sequence[LinkFeature], *, turns: bool, most: int) -> list[float] | None:
        """Return the angles [rad] or distances [m] by which features of `other` move to those of `one` with the same tag.

        Only the `most` most exact features of `one` are used. Return None if none of them is exact enough.
        """
        ones, others = (
            [item for item in (self._angles if turns else self._heights)(features) if item[1] <= SYMMETRIC] for features in (one, other)
        )
        found: list[float] = []
        for tag, _, values in sorted(ones, key=lambda item: item[1])[:most]:
            for base in (base for name, _, bases in others if name == tag for base in bases):
                difference = float(np.remainder(values[0] - base + np.pi, 2.0 * np.pi) - np.pi) if turns else values[0] - base
                if all(abs(difference - known) > DISTINCT for known in found):
                    found.append(difference)
        return found if ones else None

    def _angles(self, features: Sequence[LinkFeature]) -> Iterator[Located]:
        """Yield the angles [rad] of features about the line."""
        side = cross(self.axis, np.eye(3)[int(np.argmin(abs(self.axis)))])
        side /= np.linalg.norm(side)
        basis = np.array([side, cross(self.axis, side)])
        for tag, point, axis, error in features:
            x, y = basis @ axis if axis is not None else (0.0, 0.0)
            turns = [0.0, np.pi]
            if point is not None and np.hypot(x, y) <= NEAR_PARALLEL:
                error, turns, away = 1.0, [0.0], point - self.point
                if axis is not None:  # the point of a nearly parallel line in the plane through the point
                    away = away - (away @ self.axis) / (axis @ self.axis) * axis
                x, y = basis @ away
            angle = float(np.arctan2(y, x))
            yield tag, float(error * self.tolerance / max(np.hypot(x, y), 1e-300)), [angle + turn for turn in turns]

    def _heights(self, features: Sequence[LinkFeature]) -> Iterator[Located]:
        """Yield the positions [m] of features along the line: of a point, and of the point that is nearest to another line."""
        for tag, point, axis, _ in features:
            across = np.zeros(3) if axis is None else axis - (axis @ self.axis) * self.axis
            size = 1.0 if axis is None else float(across @ across)
            if point is not None and size >= NEAR_PARALLEL**2:
                away = point - self.point
                away = away if axis is None else away - (away @ across) / size * axis
                yield tag, self.tolerance / size**0.5, [float(away @ self.axis)]


def cross(a: Array, b: Array) -> Array:
    """Return the cross products of vectors (..., 3). `numpy.cross` takes several times as long for few vectors."""
    product: Array = a[..., _NEXT] * b[..., _LAST] - a[..., _LAST] * b[..., _NEXT]
    return product


def apply(X: Array, point: Array) -> Array:
    """Return a point in frame A. It is expressed in frame B, whose pose in A is `X`."""
    return X[:3, :3] @ point + X[:3, 3]


def rotation_between(one: Array, other: Array) -> Array:
    """Return the smallest rotation (3, 3) that turns the unit vector `one` to `other`."""
    across = cross(one, other)
    sine = float(np.linalg.norm(across))
    if sine < 1e-12:
        if one @ other > 0.0:
            return np.eye(3)
        across, sine = cross(one, np.eye(3)[int(np.argmin(abs(one)))]), 0.0
    return rotation(across / np.linalg.norm(across) * np.arctan2(sine, one @ other))

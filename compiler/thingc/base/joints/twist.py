"""The motion of one joint coordinate (a twist), and the physical dimensions of its stiffness, damping and other values.

By Chasles' theorem any rigid motion of one coordinate at a constant rate is a rotation about a line with a translation along it. One type
therefore covers revolute, prismatic and screw joints. For the exponential and changes of frame see Lynch and Park, Modern Robotics, 2017,
sections 3.3.2 and 3.3.3.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Literal

from thingc.base import units
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import degrees, hypot, pi, remainder, sin, sum_of, tau
from thingc.base.pose import IDENTITY, NO_POSE, Pose, Vector, cross, dot, rotate, turned_about, turned_x, turned_y, turned_z

TURN: Mapping[str, units.Dimension] = {
    **dict.fromkeys(("lower", "upper", "offset", "rest"), units.ANGLE), **dict.fromkeys(("effort", "friction", "stall"), units.TORQUE),
    **dict.fromkeys(("kv", "damping"), units.ANGULAR_DAMPING), **dict.fromkeys(("kp", "stiffness"), units.ANGULAR_STIFFNESS),
    "velocity": units.ANGULAR_VELOCITY, "armature": units.INERTIA, "delay": units.TIME,
}
"""Physical dimensions of the values of a rotational coordinate, by key."""
SLIDE: Mapping[str, units.Dimension] = {
    **dict.fromkeys(("lower", "upper", "offset", "rest"), units.LENGTH), **dict.fromkeys(("effort", "friction", "stall"), units.FORCE),
    **dict.fromkeys(("kv", "damping"), units.LINEAR_DAMPING), **dict.fromkeys(("kp", "stiffness"), units.LINEAR_STIFFNESS),
    "velocity": units.VELOCITY, "armature": units.MASS, "delay": units.TIME,
}
"""Physical dimensions of the values of a translational coordinate, by key."""


def dimensions_of(coordinate: units.Dimension) -> Mapping[str, units.Dimension]:
    """Return the physical dimension of each value of a joint coordinate, such as `kp` or `damping`, by the key of the value.

    `coordinate` is the physical dimension of the joint coordinate: an angle or a length.
    """
    return TURN if coordinate == units.ANGLE else SLIDE


NONE: Vector = (0.0, 0.0, 0.0)


class Twist(FrozenStruct, kw_only=False):
    """A twist: the rigid motion of a frame per unit of a joint coordinate q.

    `angular` is the rotation axis as a unit vector, or 0 for a pure translation. `anchor` [m] is a point on the rotation axis. `linear` is
    the translation of this point along the axis, or a unit vector for a pure translation. All vectors are expressed in the same frame.
    """

    angular: Vector = NONE
    linear: Vector = NONE
    anchor: Vector = NONE

    @property
    def core(self) -> Literal["hinge", "slide"]:
        """The type of the motion: `hinge` for a rotation about an axis, or `slide` for a translation along an axis."""
        return "hinge" if self.angular != NONE else "slide"

    @property
    def turns(self) -> bool:
        """Whether the joint coordinate q is an angle [rad]. Otherwise, q is a length [m]."""
        return self.angular != NONE

    @property
    def axis(self) -> Vector:
        """The unit vector of the rotation axis or of the direction of translation."""
        return self.angular if self.turns else self.linear

    @property
    def pitch(self) -> float:
        """The translation along the axis per radian of rotation [m/rad]. The value is 0 for a pure rotation and for a pure translation."""
        return dot(self.angular, self.linear)

    @property
    def coordinate(self) -> units.Dimension:
        """The physical dimension of the joint coordinate q: an angle for a rotation, or a length for a translation."""
        return units.ANGLE if self.turns else units.LENGTH

    @property
    def dimensions(self) -> Mapping[str, units.Dimension]:
        """The physical dimension of each value of this joint coordinate, such as `kp` or `damping`, by the key of the value."""
        return dimensions_of(self.coordinate)

    def format(self, q: float) -> str:
        """Format the value `q` [rad or m] of a joint coordinate for display, such as `30 deg` or `20 mm`."""
        return f"{degrees(q):z.6g} deg" if self.turns else f"{q * 1000.0:z.6g} mm"

    def exponential(self, q: float) -> Pose:
        """Return the pose of a moving frame, relative to its pose at q = 0, for the joint coordinate `q` [rad or m].

        At q = 0, the pose is the identity. Rotations about x, y and z through the origin are exact at multiples of 90 degrees. All other
        rotations are computed with Rodrigues' formula.
        """
        lx, ly, lz = self.linear
        if not self.turns:
            return Pose(translation=(lx * q, ly * q, lz * q))
        if self.anchor == NONE and self.linear == NONE and self.angular in _PLAIN:
            return _PLAIN[self.angular](q)
        rotation, a = turned_about(self.angular, q), self.anchor
        moved = rotate(rotation, a)
        return Pose(rotation=rotation, translation=(a[0] - moved[0] + lx * q, a[1] - moved[1] + ly * q, a[2] - moved[2] + lz * q))

    def velocity(self, point: Vector) -> tuple[Vector, Vector]:
        """Return the linear velocity of a point [m] and the angular velocity of this motion, both per unit of the joint coordinate q."""
        if not self.turns:
            return self.linear, NONE
        a, w, v = self.anchor, self.angular, self.linear
        x, y, z = cross(w, (point[0] - a[0], point[1] - a[1], point[2] - a[2]))
        return (x + v[0], y + v[1], z + v[2]), w

    def seen_from(self, X_AB: Pose) -> Twist:
        """Return the same twist expressed in frame A. This twist is expressed in frame B, and `X_AB` is the pose of B in A."""
        turn = X_AB.rotation
        return Twist(rotate(turn, self.angular), rotate(turn, self.linear), X_AB.apply(self.anchor))

    def inverse(self) -> Twist:
        """Return the twist of the inverse motion. `inverse().exponential(q)` is the inverse of `exponential(q)`."""
        return Twist(_negate(self.angular), _negate(self.linear), self.anchor)


X, Y, Z = IDENTITY
_PLAIN = {X: turned_x, Y: turned_y, Z: turned_z}


def pose_after(twists: tuple[Twist, ...], q: tuple[float, ...], *, at_once: bool = False) -> Pose:
    """Return the pose of a frame after the motions of several twists. `q` contains one joint coordinate [rad or m] for each twist.

    The twists are applied in sequence, each in the frame that the preceding twists have moved. With `at_once`, the coordinates of rotations
    are the components of a rotation vector (exponential coordinates), and their axes pass through a common point.
    """
    pose = NO_POSE
    if at_once:
        for part, values in _parts(twists, q):
            vector = rotation_vector(part, values)
            angle = hypot(*vector)
            if not part[0].turns:
                pose = pose @ pose_after(part, values)
            elif angle != 0.0:
                x, y, z = vector
                turned = Twist(angular=(x / angle, y / angle, z / angle), anchor=part[0].anchor).exponential(angle)
                pose = turned if pose is NO_POSE else pose @ turned
        return pose
    for number, (twist, value) in enumerate(zip(twists, q, strict=True)):
        pose = pose @ twist.exponential(value) if number else twist.exponential(value)
    return pose


def velocities(twists: tuple[Twist, ...], q: tuple[float, ...], pose: Pose, *, at_once: bool = False) -> Iterator[tuple[int, Twist]]:
    """Yield the index of each joint coordinate and the twist of its motion at the coordinates `q`, from the last coordinate to the first.

    `pose` is the current pose of the moved frame in a reference frame, in which the yielded twists are expressed. With `at_once`, `q`
    contains exponential coordinates, and the angular part of a yielded twist is not a unit vector.
    """
    if at_once:
        number = len(twists)
        for part, values in reversed(_parts(twists, q)):
            turned = rotation_vector(part, values)
            for twist in reversed(part):
                number -= 1
                if twist.turns:
                    twist = Twist(_right_jacobian(turned, twist.angular), NONE, twist.anchor)
                yield number, twist.seen_from(pose)
            if number:
                pose = pose @ pose_after(part, values, at_once=True).inverse()
        return
    for number in range(len(twists) - 1, -1, -1):
        yield number, twists[number].seen_from(pose)
        if number:
            pose = pose @ twists[number].exponential(-q[number])


def _parts(twists: tuple[Twist, ...], q: tuple[float, ...]) -> list[tuple[tuple[Twist, ...], tuple[float, ...]]]:
    """Split twists and their coordinates into translations and rotations, which follow each other in the joint."""
    first = len([twist for twist in twists if twist.turns == twists[0].turns])
    return [(twists[part], q[part]) for part in (slice(None, first), slice(first, None)) if twists[part]]


def within_turn(vector: Vector) -> Vector:
    """Return the rotation vector [rad] with a length of at most pi that describes the same rotation as `vector`."""
    angle = hypot(*vector)
    if angle <= pi:
        return vector
    scale = remainder(angle, tau) / angle
    return (scale * vector[0], scale * vector[1], scale * vector[2])


def rotation_vector(twists: tuple[Twist, ...], q: tuple[float, ...]) -> Vector:
    """Return the rotation vector (axis times angle [rad]) of a ball joint, whose twists have the exponential coordinates `q`."""
    x, y, z = (sum_of(value * twist.angular[k] for twist, value in zip(twists, q, strict=True)) for k in range(3))
    return (x, y, z)


def _right_jacobian(w: Vector, v: Vector) -> Vector:
    """Return the angular velocity, in the axes of the body, of a body whose rotation vector is w and changes at the rate v.

    The angular velocity is `v - b w x v + c w x (w x v)`, where `b = (1 - cos a) / a^2`, `c = (a - sin a) / a^3` and `a = |w|`. See
    Chirikjian, Stochastic Models, Information Theory, and Lie Groups 2, 2012, section 10.3.3. Near a = 0, b and c are computed by their
    series.
    """
    a = hypot(*w)
    if a < 1e-2:
        b, c = 0.5 - a * a / 24.0 + a**4 / 720.0, 1.0 / 6.0 - a * a / 120.0 + a**4 / 5040.0
    else:
        b, c = 2.0 * (sin(a / 2.0) / a) ** 2, (a - sin(a)) / a**3
    once = cross(w, v)
    twice = cross(w, once)
    return (v[0] - b * once[0] + c * twice[0], v[1] - b * once[1] + c * twice[1], v[2] - b * once[2] + c * twice[2])


def _negate(v: Vector) -> Vector:
    return (0.0 - v[0], 0.0 - v[1], 0.0 - v[2])  # 0 - 0 is 0, but negation would give -0.0, and files would contain -0.0

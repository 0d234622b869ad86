"""Twists, which describe the motion of a joint coordinate, and the physical dimensions of its values.

By Chasles' theorem any rigid motion of one coordinate at a constant rate is a rotation about a line with a translation along it. One type
therefore covers revolute, prismatic and screw joints. For the exponential and changes of frame see Lynch and Park, Modern Robotics, 2017,
sections 3.3.2 and 3.3.3.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Literal

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import degrees, hypot, pi, remainder, sin, sum_of, tau
from thingc.base.pose import IDENTITY, NO_POSE, Pose, Vector, cross, dot, rotate, turned_about, turned_x, turned_y, turned_z
from thingc.base.units import (
    ANGLE,
    ANGULAR_DAMPING,
    ANGULAR_STIFFNESS,
    ANGULAR_VELOCITY,
    FORCE,
    INERTIA,
    LENGTH,
    LINEAR_DAMPING,
    LINEAR_STIFFNESS,
    MASS,
    TORQUE,
    VELOCITY,
    Dimension,
)

TURN: Mapping[str, Dimension] = {
    "lower": ANGLE, "upper": ANGLE, "offset": ANGLE, "kp": ANGULAR_STIFFNESS, "kv": ANGULAR_DAMPING, "effort": TORQUE,
    "velocity": ANGULAR_VELOCITY, "damping": ANGULAR_DAMPING, "friction": TORQUE, "armature": INERTIA, "stiffness": ANGULAR_STIFFNESS,
    "rest": ANGLE,
}
"""Physical dimensions of the values of a rotational coordinate, by key."""
SLIDE: Mapping[str, Dimension] = {
    "lower": LENGTH, "upper": LENGTH, "offset": LENGTH, "kp": LINEAR_STIFFNESS, "kv": LINEAR_DAMPING, "effort": FORCE,
    "velocity": VELOCITY, "damping": LINEAR_DAMPING, "friction": FORCE, "armature": MASS, "stiffness": LINEAR_STIFFNESS,
    "rest": LENGTH,
}
"""Physical dimensions of the values of a translational coordinate, by key."""


def dimensions_of(coordinate: Dimension) -> Mapping[str, Dimension]:
    """Return the physical dimensions of the values of a coordinate by key.

    These dimensions depend on the physical dimension of the coordinate.
    """
    return TURN if coordinate == ANGLE else SLIDE


NONE: Vector = (0.0, 0.0, 0.0)


class Twist(FrozenStruct, kw_only=False):
    """A twist: the motion of a joint coordinate per unit of q, in some frame.

    The motion is a rotation by `angular` (a unit vector, or 0 for a pure translation), while the point `anchor` [m] on the axis moves by
    `linear` (parallel to the axis; a unit vector for a pure translation).
    """

    angular: Vector = NONE
    linear: Vector = NONE
    anchor: Vector = NONE

    @property
    def core(self) -> Literal["hinge", "slide"]:
        """The type of the motion: a `hinge` rotates about an axis, and a `slide` moves along an axis."""
        return "hinge" if self.angular != NONE else "slide"

    @property
    def turns(self) -> bool:
        """Whether q is an angle [rad]; otherwise it is a length [m]."""
        return self.angular != NONE

    @property
    def axis(self) -> Vector:
        """The unit vector of the rotation axis or of the direction of translation."""
        return self.angular if self.turns else self.linear

    @property
    def pitch(self) -> float:
        """Advance along the axis [m/rad]. The pitch is 0 for a pure rotation or translation."""
        return dot(self.angular, self.linear)

    @property
    def coordinate(self) -> Dimension:
        """The physical dimension of the coordinate q."""
        return ANGLE if self.turns else LENGTH

    @property
    def dimensions(self) -> Mapping[str, Dimension]:
        """Physical dimensions of the values of this coordinate by key (`kp`, `damping`, ...)."""
        return dimensions_of(self.coordinate)

    def shown(self, q: float) -> str:
        """Format a coordinate [rad or m] for display: `30 deg`, `20 mm`."""
        return f"{degrees(q):z.6g} deg" if self.turns else f"{q * 1000.0:z.6g} mm"

    def exponential(self, q: float) -> Pose:
        """Return the pose at `q` [rad or m] of a frame that is at the identity at q = 0.

        Rotations about x, y and z through the origin are exact at quarter turns; others use Rodrigues' formula.
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
        """Return (linear, angular), the velocity of a point [m] and the angular velocity, per unit of q."""
        if not self.turns:
            return self.linear, NONE
        a, w, v = self.anchor, self.angular, self.linear
        x, y, z = cross(w, (point[0] - a[0], point[1] - a[1], point[2] - a[2]))
        return (x + v[0], y + v[1], z + v[2]), w

    def seen_from(self, X_AB: Pose) -> Twist:
        """Transform this twist from frame B to frame A."""
        turn = X_AB.rotation
        return Twist(rotate(turn, self.angular), rotate(turn, self.linear), X_AB.apply(self.anchor))

    def reversed(self) -> Twist:
        """Return the inverse twist: `reversed().exponential(q)` is the inverse of `exponential(q)`."""
        return Twist(_negated(self.angular), _negated(self.linear), self.anchor)


X, Y, Z = IDENTITY
_PLAIN = {X: turned_x, Y: turned_y, Z: turned_z}


def moved(twists: tuple[Twist, ...], q: tuple[float, ...], *, at_once: bool = False) -> Pose:
    """Return the pose of a frame moved by twists with coordinates `q` (one per twist).

    The function applies the twists in sequence, each in the frame that the preceding twists have moved. With `at_once`, `q` contains
    exponential coordinates: the sum of the twists is a rotation vector about an axis through their common point.
    """
    if at_once:
        vector = rotation_vector(twists, q)
        angle = hypot(*vector)
        if angle == 0.0:
            return NO_POSE
        x, y, z = vector
        return Twist(angular=(x / angle, y / angle, z / angle), anchor=twists[0].anchor).exponential(angle)
    pose = NO_POSE
    for number, (twist, value) in enumerate(zip(twists, q, strict=True)):
        pose = pose @ twist.exponential(value) if number else twist.exponential(value)
    return pose


def velocities(twists: tuple[Twist, ...], q: tuple[float, ...], pose: Pose, *, at_once: bool = False) -> Iterator[tuple[int, Twist]]:
    """Yield the index and the twist of the motion of every coordinate at `q`, from the last to the first.

    Twists are in the reference frame of `pose`, which is the pose of the frame that the twists move. With `at_once`, the angular part is
    not a unit vector.
    """
    if at_once:
        turned = rotation_vector(twists, q)
        for number in range(len(twists) - 1, -1, -1):
            yield number, Twist(_right_jacobian(turned, twists[number].angular), NONE, twists[number].anchor).seen_from(pose)
        return
    for number in range(len(twists) - 1, -1, -1):
        yield number, twists[number].seen_from(pose)
        if number:
            pose = pose @ twists[number].exponential(-q[number])


def within_turn(vector: Vector) -> Vector:
    """Return the equivalent rotation vector [rad] with a length of at most pi."""
    angle = hypot(*vector)
    if angle <= pi:
        return vector
    scale = remainder(angle, tau) / angle
    return (scale * vector[0], scale * vector[1], scale * vector[2])


def rotation_vector(twists: tuple[Twist, ...], q: tuple[float, ...]) -> Vector:
    """Return the rotation vector (axis times angle [rad]) of twists with exponential coordinates `q`."""
    x, y, z = (sum_of(value * twist.angular[k] for twist, value in zip(twists, q, strict=True)) for k in range(3))
    return (x, y, z)


def _right_jacobian(w: Vector, v: Vector) -> Vector:
    """Return the angular velocity in body axes for a rotation vector w with the time derivative v.

    This is `v - b w x v + c w x (w x v)` with b = (1 - cos a) / a^2, c = (a - sin a) / a^3, a = |w| (Chirikjian, Stochastic Models,
    Information Theory, and Lie Groups 2, 2012, section 10.3.3); near 0, the function computes b and c by their series.
    """
    a = hypot(*w)
    if a < 1e-2:
        b, c = 0.5 - a * a / 24.0 + a**4 / 720.0, 1.0 / 6.0 - a * a / 120.0 + a**4 / 5040.0
    else:
        b, c = 2.0 * (sin(a / 2.0) / a) ** 2, (a - sin(a)) / a**3
    once = cross(w, v)
    twice = cross(w, once)
    return (v[0] - b * once[0] + c * twice[0], v[1] - b * once[1] + c * twice[1], v[2] - b * once[2] + c * twice[2])


def _negated(v: Vector) -> Vector:
    return (0.0 - v[0], 0.0 - v[1], 0.0 - v[2])  # 0 - 0 is 0, but negation would give -0.0, and files would contain -0.0

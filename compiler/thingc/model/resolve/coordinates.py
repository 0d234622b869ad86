"""Data types for the coordinates of joints: names, limits, dynamics, mimics, and the values of drives and transmissions."""

from __future__ import annotations

import re

from thingc.base.joints.kinds import JointKind
from thingc.base.joints.twist import Twist
from thingc.base.numeric import inf, sum_of
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import Vector
from thingc.base.source import Origin


class Limit(OneLineStruct):
    """The limits of a joint: position from `lower` to `upper` [rad or m], `effort` [N m or N] and `velocity` [rad/s or m/s].

    A limit that is None does not apply.

    For a ball joint, `cone` is the largest rotation angle [rad] from q = 0 about any axis.
    """

    lower: float | None = None
    upper: float | None = None
    cone: float | None = None
    effort: float | None = None
    velocity: float | None = None

    @property
    def bounded(self) -> bool:
        """Whether the position of the joint has a lower or an upper limit."""
        return (self.lower, self.upper, self.cone) != (None, None, None)

    def contains(self, q: float) -> bool:
        """Return whether a position [rad or m] is within the limits, except for rounding errors."""
        return (self.lower is None or q >= self.lower - 1e-9) and (self.upper is None or q <= self.upper + 1e-9)

    def format(self, twist: Twist) -> str:
        """Format the position limits of a joint with the given motion for display, such as `-90 deg to 90 deg`."""
        return " to ".join("no limit" if end is None else twist.format(end) for end in (self.lower, self.upper))


class Dynamics(OneLineStruct):
    """The passive dynamics of a joint in SI units. A value is None if the document does not specify it.

    `damping` is viscous friction, `friction` is dry friction, and `armature` is the reflected inertia. `stiffness` and `rest` are the
    stiffness and the rest position of a spring.
    """

    damping: float | None = None
    friction: float | None = None
    armature: float | None = None
    stiffness: float | None = None
    rest: float | None = None

    def sprung(self, q: float) -> float:
        """Return the torque [N m] or force [N] of the joint's spring at the position `q` [rad or m].

        A positive value acts in the direction of positive q.
        """
        return 0.0 if self.stiffness is None else self.stiffness * ((self.rest or 0.0) - q)

    @property
    def acts(self) -> bool:
        """Whether damping, friction, armature or spring stiffness of the joint is not 0."""
        return any((self.damping, self.friction, self.armature, self.stiffness))


class CoordinateName(str):
    """The name of a joint coordinate in documents: `hand.wrist[0]`, or `hand.yaw` for a joint with one coordinate.

    `joint` is the name of the joint, and `number` is the index of the coordinate (None if the joint has only one coordinate). `path` is the
    name of the coordinate in files: `hand/wrist_0`.
    """

    joint: str
    number: int | None
    path: str

    def __new__(cls, text: str) -> CoordinateName:
        """Parse the name of a coordinate in a document, such as `wrist[0]`.

        If the brackets do not contain a number, they are part of the name of the joint.
        """
        name = super().__new__(cls, text)
        numbered = _NUMBERED.fullmatch(text)
        name.joint, name.number = (numbered[1], int(numbered[2])) if numbered is not None else (text, None)
        name.path = name.joint.replace(".", "/") + ("" if name.number is None else f"_{name.number}")
        return name

    def in_files(self, path: str) -> CoordinateName:
        """Return a copy of the coordinate's name with `path` as its name in output files."""
        name = CoordinateName(self)
        name.path = path
        return name

    def with_number(self, number: int) -> CoordinateName:
        """Return the name of the coordinate with the index `number`, such as `wrist[1]` for the joint `wrist`."""
        return CoordinateName(f"{self.joint}[{number}]")


_NUMBERED = re.compile(r"(.*)\[(\d+)\]")


class Mimic(OneLineStruct):
    """The polynomial by which a joint mimics another joint.

    In SI units, the position q of the joint follows from the position x of the other joint:

        q = offset + multiplier * x + higher[0] * x^2 + higher[1] * x^3 ...

    `joint` is the name of a coordinate in the same document. `name` is the name of the MuJoCo equality, or None.
    """

    joint: CoordinateName
    multiplier: float
    offset: float
    origin: Origin
    higher: tuple[float, ...] = ()
    name: str | None = None

    @property
    def polynomial(self) -> tuple[float, ...]:
        """The coefficients of the polynomial in ascending order of the powers, starting with the constant."""
        return (self.offset, self.multiplier, *self.higher)

    def tangent(self, x: float) -> tuple[float, float]:
        """Linearize the polynomial near `x`, and return the coefficients (m, c) of q = m q(joint) + c."""
        if not self.higher:
            return self.multiplier, self.offset
        slope = self.multiplier + sum_of(k * c * x ** (k - 1) for k, c in enumerate(self.higher, start=2))
        return slope, self.at(x) - slope * x

    def at(self, x: float) -> float:
        """Compute the position of the joint when the joint that it mimics is at `x`. If the result overflows, it is infinite."""
        linear = self.multiplier * x + self.offset
        try:
            return linear if not self.higher else linear + sum_of(c * x**k for k, c in enumerate(self.higher, start=2))
        except OverflowError:
            return inf


class Coordinate(OneLineStruct):
    """One coordinate of a joint: its name, the type of the joint, and its limits, dynamics and mimic in SI units."""

    name: CoordinateName
    kind: JointKind
    limit: Limit
    dynamics: Dynamics
    offset: float
    mimic: Mimic | None
    origin: Origin

    @property
    def path(self) -> str:
        """The name of the coordinate in files, such as `hand/wrist_0`."""
        return self.name.path


class Gear(OneLineStruct):
    """A transmission between an actuator and a joint.

    `ratio` is the motion of the actuator per motion of the joint [rad/rad, rad/m, m/rad or m/m], and `efficiency` is between 0 and 1.
    `turns` states whether the actuator is rotary. `inertia` [kg m^2 or kg] is the inertia of the transmission at the actuator. `backlash`
    [rad or m] is measured at the joint. In a differential, the ratio is 1, because each drive acts on the coordinate of its actuator.
    """

    name: str
    turns: bool
    ratio: float
    efficiency: float
    inertia: float | None
    backlash: float | None = None


class DriveValues(OneLineStruct):
    """The values of a drive in a document and in the linked robot, in SI units.

    `effort` is the limit of the force or torque of the drive. Commands act after `delay` [s]. `deadband` and `noise` have the unit of the
    command. For a ball joint, `axis` is a unit vector in the axes of the parent mount at q = 0. The axis is fixed in the child.
    """

    kp: float | None = None
    kv: float | None = None
    effort: float | None = None
    velocity: float | None = None
    axis: Vector | None = None
    delay: float | None = None
    deadband: float | None = None
    noise: float | None = None
    origin: Origin = ()

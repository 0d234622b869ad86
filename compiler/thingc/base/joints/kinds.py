"""The table of joint kinds, each a sequence of twists, and the motions of bases."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal, assert_never

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import Twist, X, Y, Z
from thingc.base.pose import Vector
from thingc.base.units import Dimension

JointType = Literal["fixed", "revolute", "continuous", "prismatic", "cylindrical", "universal", "ball", "planar", "screw"]
"""Values of a joint's `type:`, the names of all kinds (`KINDS`)."""

Limits = Literal["required", "optional", "none", "cone"]
"""Whether `limit.lower` and `limit.upper` are required, optional or not allowed, or whether `limit.cone` is allowed."""


class JointKind(FrozenStruct):
    """A kind of joint, such as `revolute`: the twists of its coordinates, and the keys that it accepts.

    `twists` contains the motions of its coordinates, in order. Each twist is in the parent mount's frame, which the preceding twists have
    moved: the child's side is at `exp(twist_0 q_0) exp(twist_1 q_1) ...` relative to the parent's side. A joint without twists does not
    move. `limits` applies to `limit.lower` and `limit.upper` of each coordinate. If the kind `leads`, the document specifies the lead,
    which is the advance per turn. With `at_once`, the coordinates are exponential coordinates, a rotation vector about axes through the
    mount's origin: the child's side is at `exp(twist_0 q_0 + twist_1 q_1 + ...)`.
    """

    name: JointType
    twists: tuple[Twist, ...]
    limits: Limits
    leads: bool = False
    at_once: bool = False

    def with_lead(self, lead: float) -> tuple[Twist, ...]:
        """Return the twists of this kind with an advance of `lead` [m] along the axis per turn."""
        turn = lead / (2.0 * math.pi)
        return tuple(replace(one, linear=(turn * one.angular[0], turn * one.angular[1], turn * one.angular[2])) for one in self.twists)

    @property
    def axial(self) -> bool:
        """Whether all motions of the joint are about or along z, so that another axis can replace z."""
        return self.moves and all(one.axis == Z for one in self.twists)

    def about(self, axis: Vector, lead: float = 0.0) -> tuple[Twist, ...]:
        """Return the twists of an `axial` joint about the unit vector `axis` instead of z. `lead` [m] is used if the kind `leads`."""
        twists = self.with_lead(lead) if self.leads else self.twists
        return tuple(Twist(angular=_scaled(axis, one.angular[2]), linear=_scaled(axis, one.linear[2])) for one in twists)

    @property
    def moves(self) -> bool:
        """Whether the joint has a coordinate. A joint without coordinates connects its components to one link."""
        return bool(self.twists)

    @property
    def may_stop(self) -> bool:
        """Whether `limit.lower` and `limit.upper` are allowed."""
        match self.limits:
            case "required" | "optional":
                return True
            case "none" | "cone":
                return False
            case _:
                assert_never(self.limits)

    @property
    def coordinate(self) -> Dimension | None:
        """Physical dimension of q for a joint with exactly one coordinate, otherwise None."""
        return self.twists[0].coordinate if len(self.twists) == 1 else None


def _scaled(v: Vector, by: float) -> Vector:
    return (by * v[0] + 0.0, by * v[1] + 0.0, by * v[2] + 0.0)  # -0.0 + 0.0 is 0


KINDS: Mapping[str, JointKind] = {kind.name: kind for kind in (
    # Permanently mated mounts: the joint connects parts into one link.
    JointKind(name="fixed", twists=(), limits="none"),
    # Rotation about the parent mount's z, within two limits or unlimited.
    JointKind(name="revolute", twists=(Twist(angular=Z),), limits="required"),
    JointKind(name="continuous", twists=(Twist(angular=Z),), limits="none"),
    # Translation along the parent mount's z within two limits.
    JointKind(name="prismatic", twists=(Twist(linear=Z),), limits="required"),
    # Rotation about the parent mount's z and an independent translation along it.
    JointKind(name="cylindrical", twists=(Twist(angular=Z), Twist(linear=Z)), limits="optional"),
    # Rotation about the parent mount's x, then about the y axis that it has rotated.
    JointKind(name="universal", twists=(Twist(angular=X), Twist(angular=Y)), limits="optional"),
    # Any rotation about the parent mount's origin. q is a rotation vector: the axis times the angle.
    JointKind(name="ball", twists=(Twist(angular=X), Twist(angular=Y), Twist(angular=Z)), limits="cone", at_once=True),
    # Translations along the parent mount's x and y, then a rotation about z.
    JointKind(name="planar", twists=(Twist(linear=X), Twist(linear=Y), Twist(angular=Z)), limits="optional"),
    # Rotation about the parent mount's z with a translation along it by `lead` per turn. q is the angle.
    JointKind(name="screw", twists=(Twist(angular=Z),), limits="optional", leads=True),
)}
"""All kinds, keyed by `type:`, in the order of `JointType`."""


def coordinates_of(kind: JointType) -> range:
    """Return the indices of the coordinates of a kind with several coordinates. The result is empty for other kinds."""
    count = len(KINDS[kind].twists)
    return range(count if count > 1 else 0)


BaseType = Literal["fixed", "held", "free", "planar", "ball"]
"""Values of a mode's `base:`."""


def moving_as(base: BaseType) -> JointKind | None:
    """Return the joint kind of a base's motion, or None for a fixed, held or free base."""
    match base:
        case "planar" | "ball":
            return KINDS[base]
        case "fixed" | "held" | "free":
            return None
        case _:
            assert_never(base)


def stays(base: BaseType) -> bool:
    """Return whether the root link stays at the pose of the mode unless a program moves it at run time."""
    match base:
        case "fixed" | "held":
            return True
        case "free" | "planar" | "ball":
            return False
        case _:
            assert_never(base)

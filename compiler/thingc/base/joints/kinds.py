"""The table of all joint kinds. Each joint kind is a sequence of rotations and translations. The module also defines the motions of bases.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import Twist, X, Y, Z
from thingc.base.pose import Vector, scale_vector
from thingc.base.units import Dimension

JointType = Literal["fixed", "revolute", "continuous", "prismatic", "cylindrical", "universal", "ball", "planar", "screw", "free"]
"""Values of a joint's `type:`, the names of all kinds (`KINDS`)."""

Limits = Literal["required", "optional", "none", "cone"]
"""Whether `limit.lower` and `limit.upper` are required, optional or not allowed, or whether `limit.cone` is allowed."""


class JointKind(FrozenStruct):
    """A kind of joint, such as `revolute`, with the motions that it allows and the keys that it accepts in documents.

    `twists` contains the twist of each coordinate, in order. A joint without twists does not move. Each twist is expressed in the frame of
    the parent mount after the motions of all preceding twists. The pose of the child's side of the joint relative to the parent's side is
    `exp(twist_0 q_0) exp(twist_1 q_1) ...`. `limits` specifies whether `limit.lower` and `limit.upper` of each coordinate are required,
    optional or invalid. If `leads` is true, the document must specify the lead, which is the advance per turn.

    If `at_once` is true, the coordinates of rotations are the components of a rotation vector (exponential coordinates). The axes of
    rotation pass through the origin of the mount, and the pose is `exp(twist_0 q_0 + twist_1 q_1 + ...)`. A free joint translates before
    it rotates.
    """

    name: JointType
    twists: tuple[Twist, ...]
    limits: Limits
    leads: bool = False
    at_once: bool = False

    def with_lead(self, lead: float) -> tuple[Twist, ...]:
        """Return the twists of a screw joint that moves by `lead` [m] along its axis for each full turn."""
        turn = lead / (2.0 * math.pi)
        return tuple(replace(one, linear=(turn * one.angular[0], turn * one.angular[1], turn * one.angular[2])) for one in self.twists)

    @property
    def axial(self) -> bool:
        """Whether a document can replace z by another axis, because the joint only rotates about z or moves along z."""
        return self.moves and all(one.axis == Z for one in self.twists)

    def twists_about(self, axis: Vector, lead: float = 0.0) -> tuple[Twist, ...]:
        """Return the twists of this joint kind about the unit vector `axis` instead of the z axis. Only valid for `axial` joint kinds.

        `lead` [m] is the advance per turn, and is used only by joint kinds with a lead.
        """
        twists = self.with_lead(lead) if self.leads else self.twists
        return tuple(Twist(angular=scale_vector(axis, one.angular[2]), linear=scale_vector(axis, one.linear[2])) for one in twists)

    @property
    def moves(self) -> bool:
        """Whether the joint has at least one coordinate. A joint without coordinates connects its two components rigidly into one link."""
        return bool(self.twists)

    @property
    def words(self) -> str:
        """The kind in a sentence such as `joint x is revolute`."""
        return f"a {self.name} joint" if self.name in ("ball", "screw") else self.name

    @property
    def free(self) -> bool:
        """Whether the joint does not constrain the motion of its child."""
        return len(self.twists) == 6

    @property
    def may_stop(self) -> bool:
        """Whether a joint of this kind can have the keys `limit.lower` and `limit.upper` in a document."""
        match self.limits:
            case "required" | "optional":
                return True
            case "none" | "cone":
                return False

    @property
    def coordinate(self) -> Dimension | None:
        """The physical dimension of the joint coordinate (angle or length) if the joint has exactly one coordinate, otherwise None."""
        return self.twists[0].coordinate if len(self.twists) == 1 else None


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
    # Any motion: translations along the parent mount's x, y and z, then any rotation about the moved origin.
    JointKind(
        name="free", limits="none", at_once=True,
        twists=(Twist(linear=X), Twist(linear=Y), Twist(linear=Z), Twist(angular=X), Twist(angular=Y), Twist(angular=Z)),
    ),
)}
"""All kinds, keyed by `type:`, in the order of `JointType`."""


def coordinates_of(kind: JointType) -> range:
    """Return the indices of the coordinates of a joint kind that has several coordinates.

    Return an empty range for all other joint kinds.
    """
    count = len(KINDS[kind].twists)
    return range(count if count > 1 else 0)


BaseType = Literal["fixed", "held", "free", "planar", "ball"]
"""Values of a mode's `base:`."""


def moving_as(base: BaseType) -> JointKind | None:
    """Return the joint kind that describes how a planar or ball base moves. Return None for a fixed, held or free base."""
    match base:
        case "planar" | "ball":
            return KINDS[base]
        case "fixed" | "held" | "free":
            return None


def stays(base: BaseType) -> bool:
    """Return whether the root link stays at the pose that the mode specifies, unless a program moves the root link at run time."""
    match base:
        case "fixed" | "held":
            return True
        case "free" | "planar" | "ball":
            return False

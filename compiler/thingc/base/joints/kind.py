"""Definition of a joint kind, which the table of kinds and the passes use."""

from __future__ import annotations

import math
from typing import Literal, assert_never

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import Twist, Z
from thingc.base.pose import Vector
from thingc.base.units import Dimension

JointType = Literal["fixed", "revolute", "continuous", "prismatic", "cylindrical", "universal", "ball", "planar", "screw"]
"""Values of a joint's `type:`, the names of all kinds (`kinds.KINDS`)."""

Limits = Literal["required", "optional", "none", "cone"]
"""Whether `limit.lower` and `limit.upper` are required, optional or not allowed, or whether `limit.cone` is allowed."""


class JointKind(FrozenStruct):
    """A kind of joint.

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
        """Whether all motions are about z or along z, so that another axis can replace z."""
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

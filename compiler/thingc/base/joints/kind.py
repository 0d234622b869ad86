"""What a joint kind is: the contract between the table of kinds and the passes."""

from __future__ import annotations

import math
from typing import Literal, assert_never

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import Twist, Z
from thingc.base.pose import Vector
from thingc.base.units import Dimension

JointType = Literal["fixed", "revolute", "continuous", "prismatic", "cylindrical", "universal", "ball", "planar", "screw"]
"""What may be written after `type:` of a joint: the names of all kinds (`kinds.KINDS`)."""

Limits = Literal["required", "optional", "none", "cone"]
"""Whether `limit.lower` and `limit.upper` must, may or must not be written; or `limit.cone` may."""


class JointKind(FrozenStruct):
    """One kind of joint.

    `twists` are what its coordinates do, in order, each seen in the parent mount's frame as those before it have moved it: the
    child's side is at `exp(twist_0 q_0) exp(twist_1 q_1) ...` in the parent's. None: it does not move. `limits` is what is expected
    of `limit.lower` and `limit.upper` of each; where it `leads`, a document says by how much it slides in a turn. The twists of one that
    turns `at_once` are turns about axes through the mount's origin, and its coordinates together a rotation vector: the child's side is at
    `exp(twist_0 q_0 + twist_1 q_1 + ...)`.
    """

    name: JointType
    twists: tuple[Twist, ...]
    limits: Limits
    leads: bool = False
    at_once: bool = False

    def with_lead(self, lead: float) -> tuple[Twist, ...]:
        """The twists of a joint of this kind that also slides by `lead` [m] along its axis in every turn."""
        turn = lead / (2.0 * math.pi)
        return tuple(replace(one, linear=(turn * one.angular[0], turn * one.angular[1], turn * one.angular[2])) for one in self.twists)

    @property
    def axial(self) -> bool:
        """Whether all that it does is about z, or along it, so that another axis may take its place."""
        return self.moves and all(one.axis == Z for one in self.twists)

    def about(self, axis: Vector, lead: float = 0.0) -> tuple[Twist, ...]:
        """The twists of an `axial` joint about the unit vector `axis` in place of z; of one that leads with its `lead` [m]."""
        twists = self.with_lead(lead) if self.leads else self.twists
        return tuple(Twist(angular=_scaled(axis, one.angular[2]), linear=_scaled(axis, one.linear[2])) for one in twists)

    @property
    def moves(self) -> bool:
        """Whether the joint has a coordinate: one that has none fuses what it connects into one link."""
        return bool(self.twists)

    @property
    def may_stop(self) -> bool:
        """Whether a document may say `limit.lower` and `limit.upper`."""
        match self.limits:
            case "required" | "optional":
                return True
            case "none" | "cone":
                return False
            case _:
                assert_never(self.limits)

    @property
    def coordinate(self) -> Dimension | None:
        """The dimension of q, where there is one coordinate."""
        return self.twists[0].coordinate if len(self.twists) == 1 else None


def _scaled(v: Vector, by: float) -> Vector:
    return (by * v[0] + 0.0, by * v[1] + 0.0, by * v[2] + 0.0)  # -0.0 + 0.0 is 0

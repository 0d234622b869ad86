"""What a joint kind is: the small contract between one file per kind and the passes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from thingc.joints.twist import Twist
from thingc.units import Dimension

Limits = Literal["required", "optional", "none"]
"""Whether `limit.lower` and `limit.upper` must, may or must not be written."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointKind:
    """One kind of joint.

    `twists` are what its coordinates do, in order, each seen in the parent mount's frame as those before it have moved it: the
    child's side is at `exp(twist_0 q_0) exp(twist_1 q_1) ...` in the parent's. None: it does not move. `limits` is what is expected
    of `limit.lower` and `limit.upper` of each.
    """

    name: str
    twists: tuple[Twist, ...]
    limits: Limits

    @property
    def moves(self) -> bool:
        """Whether the joint has a coordinate: one that has none fuses what it connects into one link."""
        return bool(self.twists)

    @property
    def coordinate(self) -> Dimension | None:
        """The dimension of q, where there is one coordinate."""
        return self.twists[0].coordinate if len(self.twists) == 1 else None

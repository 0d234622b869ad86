"""What a joint kind is: the small contract between one file per kind and the passes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from thingc.pose import Pose
from thingc.units import Dimension

Limits = Literal["required", "optional", "none"]
"""Whether `limit.lower` and `limit.upper` must, may or must not be written."""

Core = Literal["hinge", "slide"]
"""The joints every target has, along or about one axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointKind:
    """One kind of joint.

    `coordinate` is the dimension of q (None: there is no coordinate); `limits` what is expected of `limit.lower` and
    `limit.upper`; `core` the joint of the core it lowers to, about or along z of the parent mount (None: it does not
    move); `motion(q)` the pose X_J(q) of the child's side in the parent's, q in rad or m.
    """

    name: str
    coordinate: Dimension | None
    limits: Limits
    core: Core | None
    motion: Callable[[float], Pose]

    @property
    def moves(self) -> bool:
        """Whether the joint has a coordinate: one that has none fuses what it connects into one link."""
        return self.core is not None

    def shown(self, q: float) -> str:
        """A coordinate [rad or m] as a person would write it: `30 deg`, `20 mm`."""
        return f"{math.degrees(q):.6g} deg" if self.core == "hinge" else f"{q * 1000.0:.6g} mm"

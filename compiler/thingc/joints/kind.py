"""What a joint kind is: the small contract between one file per kind and the passes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from thingc.pose import Pose
from thingc.units import (
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

Limits = Literal["required", "optional", "none"]
"""Whether `limit.lower` and `limit.upper` must, may or must not be written."""

Core = Literal["hinge", "slide"]
"""The joints every target has, along or about one axis."""

TURN: Mapping[str, Dimension] = {
    "lower": ANGLE, "upper": ANGLE, "offset": ANGLE, "kp": ANGULAR_STIFFNESS, "kv": ANGULAR_DAMPING, "effort": TORQUE,
    "velocity": ANGULAR_VELOCITY, "damping": ANGULAR_DAMPING, "friction": TORQUE, "armature": INERTIA, "stiffness": ANGULAR_STIFFNESS,
}
"""The dimension of every value of a joint that turns, by its key."""
SLIDE: Mapping[str, Dimension] = {
    "lower": LENGTH, "upper": LENGTH, "offset": LENGTH, "kp": LINEAR_STIFFNESS, "kv": LINEAR_DAMPING, "effort": FORCE,
    "velocity": VELOCITY, "damping": LINEAR_DAMPING, "friction": FORCE, "armature": MASS, "stiffness": LINEAR_STIFFNESS,
}
"""The same of one that slides."""


def dimensions_of(coordinate: Dimension) -> Mapping[str, Dimension]:
    """The dimension of every value of a joint with this coordinate, by key."""
    return TURN if coordinate == ANGLE else SLIDE


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

"""Coordinates lowered to MuJoCo's joints: a turn is a hinge, a slide a slide. MuJoCo has no screw; there it is both, tied together."""

from __future__ import annotations

from typing import Literal

from thingc.frozen import dataclass
from thingc.joints import Twist
from thingc.pose import Vector


@dataclass(frozen=True, slots=True)
class ModelJoint:
    """A joint of MuJoCo's: its `name`, `type`, unit `axis`, and by how much it moves per unit of the coordinate (`ratio`)."""

    name: str
    type: Literal["hinge", "slide"]
    axis: Vector
    ratio: float = 1.0


def lowered(path: str, twist: Twist) -> tuple[ModelJoint, ...]:
    """The joints of the coordinate at `path`; the first has its name and its values."""
    first = ModelJoint(path, twist.core, twist.axis)
    return (first, ModelJoint(f"{path}:slide", "slide", twist.axis, twist.pitch)) if twist.pitch else (first,)

"""What a mode lets its root link do in the world."""

from __future__ import annotations

from typing import Literal, assert_never

from thingc.base.joints.kind import JointKind
from thingc.base.joints.kinds import KINDS

BaseType = Literal["fixed", "held", "free", "planar", "ball"]
"""What may be written after `base:` of a mode."""


def moving_as(base: BaseType) -> JointKind | None:
    """The joint kind as which a base moves; None where it stays, or floats, which is no joint of ours."""
    match base:
        case "planar" | "ball":
            return KINDS[base]
        case "fixed" | "held" | "free":
            return None
        case _:
            assert_never(base)


def stays(base: BaseType) -> bool:
    """Whether the root link stays where the mode puts it, as long as nobody moves it at run time."""
    match base:
        case "fixed" | "held":
            return True
        case "free" | "planar" | "ball":
            return False
        case _:
            assert_never(base)

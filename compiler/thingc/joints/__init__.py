"""Joint kinds, one file each: how a joint moves, as a sequence of twists."""

from __future__ import annotations

from collections.abc import Mapping
from typing import assert_never, get_args

from thingc.joints import continuous, cylindrical, fixed, planar, prismatic, revolute, screw, universal
from thingc.joints.dimensions import SLIDE, TURN, dimensions_of
from thingc.joints.kind import JointKind, JointType, Limits
from thingc.joints.twist import Twist, moved


def kind_of(name: JointType) -> JointKind | None:
    """The kind of this name; None of one that the language names and this version does not build yet."""
    match name:
        case "fixed":
            return fixed.KIND
        case "revolute":
            return revolute.KIND
        case "continuous":
            return continuous.KIND
        case "prismatic":
            return prismatic.KIND
        case "screw":
            return screw.KIND
        case "cylindrical":
            return cylindrical.KIND
        case "universal":
            return universal.KIND
        case "planar":
            return planar.KIND
        case "ball":
            return None
        case _:
            assert_never(name)


KINDS: Mapping[str, JointKind] = {name: kind for name in get_args(JointType) if (kind := kind_of(name)) is not None}
"""Every kind that can be built, by the word written after `type:`."""


def coordinates_of(kind: JointType) -> range:
    """The numbers of the coordinates of a kind that has several; nothing of any other."""
    found = kind_of(kind)
    count = len(found.twists) if found is not None else 0
    return range(count if count > 1 else 0)

__all__ = ["KINDS", "SLIDE", "TURN", "JointKind", "JointType", "Limits", "Twist", "coordinates_of", "dimensions_of", "kind_of", "moved"]

"""Joint kinds, one file each: how a joint moves, as a sequence of twists."""

from __future__ import annotations

from collections.abc import Mapping
from typing import assert_never, get_args

from thingc.base.joints import ball, continuous, cylindrical, fixed, planar, prismatic, revolute, screw, universal
from thingc.base.joints.kind import JointKind, JointType


def kind_of(name: JointType) -> JointKind:
    """The kind of this name."""
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
            return ball.KIND
        case _:
            assert_never(name)


KINDS: Mapping[str, JointKind] = {name: kind_of(name) for name in get_args(JointType)}
"""Every kind, by the word written after `type:`."""


def coordinates_of(kind: JointType) -> range:
    """The numbers of the coordinates of a kind that has several; nothing of any other."""
    count = len(kind_of(kind).twists)
    return range(count if count > 1 else 0)


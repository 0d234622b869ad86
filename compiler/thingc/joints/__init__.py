"""Joint kinds, one file each: how a joint moves, as a sequence of twists."""

from __future__ import annotations

from thingc.joints import continuous, cylindrical, fixed, planar, prismatic, revolute, screw, universal
from thingc.joints.dimensions import SLIDE, TURN, dimensions_of
from thingc.joints.kind import JointKind, Limits
from thingc.joints.twist import Twist, moved

KINDS: dict[str, JointKind] = {
    module.KIND.name: module.KIND for module in (fixed, revolute, continuous, prismatic, screw, cylindrical, universal, planar)
}
"""Every kind that can be built, by the word written after `type:`."""


def coordinates_of(kind: str) -> range:
    """The numbers of the coordinates of a kind that has several; nothing of any other."""
    count = len(KINDS[kind].twists) if kind in KINDS else 0
    return range(count if count > 1 else 0)


LATER: frozenset[str] = frozenset({"ball"})
"""Kinds that the language names and this version does not build yet: a diagnostic says so."""

__all__ = ["KINDS", "LATER", "SLIDE", "TURN", "JointKind", "Limits", "Twist", "coordinates_of", "dimensions_of", "moved"]

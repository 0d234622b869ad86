"""Joint kinds, one file each: how a joint moves, as a sequence of twists."""

from __future__ import annotations

from thingc.joints import continuous, fixed, prismatic, revolute, screw
from thingc.joints.dimensions import SLIDE, TURN, dimensions_of
from thingc.joints.kind import JointKind, Limits
from thingc.joints.twist import Twist, moved

KINDS: dict[str, JointKind] = {
    module.KIND.name: module.KIND for module in (fixed, revolute, continuous, prismatic, screw)
}
"""Every kind that can be built, by the word written after `type:`."""

LATER: frozenset[str] = frozenset({"cylindrical", "universal", "ball", "planar"})
"""Kinds that the language names and this version does not build yet: a diagnostic says so."""

__all__ = ["KINDS", "LATER", "SLIDE", "TURN", "JointKind", "Limits", "Twist", "dimensions_of", "moved"]

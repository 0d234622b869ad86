"""The table of joint kinds, each a sequence of twists, and the motions of bases."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, assert_never

from thingc.base.joints.kind import JointKind, JointType
from thingc.base.joints.twist import Twist, X, Y, Z

KINDS: Mapping[str, JointKind] = {kind.name: kind for kind in (
    # Permanently mated mounts: the joint connects parts into one link.
    JointKind(name="fixed", twists=(), limits="none"),
    # Rotation about the parent mount's z, within two limits or unlimited.
    JointKind(name="revolute", twists=(Twist(angular=Z),), limits="required"),
    JointKind(name="continuous", twists=(Twist(angular=Z),), limits="none"),
    # Translation along the parent mount's z within two limits.
    JointKind(name="prismatic", twists=(Twist(linear=Z),), limits="required"),
    # Rotation about the parent mount's z and an independent translation along it.
    JointKind(name="cylindrical", twists=(Twist(angular=Z), Twist(linear=Z)), limits="optional"),
    # Rotation about the parent mount's x, then about the y axis that it has rotated.
    JointKind(name="universal", twists=(Twist(angular=X), Twist(angular=Y)), limits="optional"),
    # Any rotation about the parent mount's origin. q is a rotation vector: the axis times the angle.
    JointKind(name="ball", twists=(Twist(angular=X), Twist(angular=Y), Twist(angular=Z)), limits="cone", at_once=True),
    # Translations along the parent mount's x and y, then a rotation about z.
    JointKind(name="planar", twists=(Twist(linear=X), Twist(linear=Y), Twist(angular=Z)), limits="optional"),
    # Rotation about the parent mount's z with a translation along it by `lead` per turn. q is the angle.
    JointKind(name="screw", twists=(Twist(angular=Z),), limits="optional", leads=True),
)}
"""All kinds, keyed by `type:`, in the order of `JointType`."""


def coordinates_of(kind: JointType) -> range:
    """Return the indices of the coordinates of a kind with several coordinates. The result is empty for other kinds."""
    count = len(KINDS[kind].twists)
    return range(count if count > 1 else 0)


BaseType = Literal["fixed", "held", "free", "planar", "ball"]
"""Values of a mode's `base:`."""


def moving_as(base: BaseType) -> JointKind | None:
    """Return the joint kind of a base's motion, or None for a fixed, held or free base."""
    match base:
        case "planar" | "ball":
            return KINDS[base]
        case "fixed" | "held" | "free":
            return None
        case _:
            assert_never(base)


def stays(base: BaseType) -> bool:
    """Return whether the root link stays at the pose of the mode unless a program moves it at run time."""
    match base:
        case "fixed" | "held":
            return True
        case "free" | "planar" | "ball":
            return False
        case _:
            assert_never(base)

"""Joints as SDF has them: each about, or along, axes through a point that is fixed in its child, and at 0 where the file has the links.

Turns, slides, screws, balls, and two turns about axes that meet (`universal`) are there; what else has several coordinates is a chain, with
almost massless links between.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, assert_never

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import Twist
from thingc.base.pose import NO_POSE, Vector
from thingc.model.assembly.types import JointEdge
from thingc.model.robot.types import TreeJoint
from thingc.targets.capabilities import joint_cell
from thingc.targets.connections import Connection
from thingc.targets.sdf.capabilities import CAPABILITIES

SdfType = Literal["fixed", "continuous", "revolute", "prismatic", "screw", "universal", "ball"]

LINK = "_link"
"""What the name of a link between the joints of a chain ends with, behind that of the joint before: components are called like joints."""


class SdfAxis(FrozenStruct):
    """A coordinate of a joint, and what it does, seen in the child link's frame where the file has it."""

    joint: TreeJoint | JointEdge
    twist: Twist


class SdfJoint(FrozenStruct):
    """A joint of SDF's: `path` names it, `at` is its origin in the child link's frame [m], `axes` are those that it turns about or slides
    along, none where it is `fixed` or a `ball`."""

    path: str
    type: SdfType
    at: Vector
    axes: tuple[SdfAxis, ...] = ()


def chain(connection: Connection, q: Mapping[str, float]) -> tuple[SdfJoint, ...]:
    """The joints of SDF that connect two bodies, one after the other; where the file has them the coordinates are at `q` [rad or m], those
    of a base, of which it says nothing, at 0."""
    path, joints = connection.path, connection.coordinates
    if not joints:
        return (SdfJoint(path=path, type="ball" if connection.turns else "fixed", at=connection.X_1.translation),)
    twists = [twist.seen_from(connection.X_1) for twist in connection.twists]
    form = CAPABILITIES["joints"][joint_cell(joints[0].kind)].by
    if form == "ball":
        return (SdfJoint(path=path, type="ball", at=twists[0].anchor),)
    axes: list[SdfAxis] = []
    later = NO_POSE
    for joint, twist in zip(reversed(joints), reversed(twists), strict=True):
        axes.insert(0, SdfAxis(joint=joint, twist=twist.seen_from(later.inverse())))
        later = twist.exponential(q.get(joint.path, 0.0)) @ later
    match form:
        case "universal":
            return (SdfJoint(path=path, type="universal", at=axes[1].twist.anchor, axes=tuple(axes)),)
        case "each":
            return tuple(SdfJoint(path=axis.joint.path, type=_type(axis), at=axis.twist.anchor, axes=(axis,)) for axis in axes)
        case _:
            assert_never(form)


def _type(axis: SdfAxis) -> SdfType:
    if not axis.twist.turns:
        return "prismatic"
    if axis.twist.pitch:
        return "screw"
    return "revolute" if axis.joint.limit.bounded else "continuous"

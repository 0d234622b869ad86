"""Joints as URDF has them: each turns about, or slides along, an axis through the origin of its child.

A joint of several coordinates is a chain of such with almost massless links between, a screw a turn that a slide follows, a ball three
turns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, assert_never

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import NO_POSE, Pose, Vector, shifted
from thingc.model.robot.types import TreeJoint
from thingc.targets.capabilities import joint_cell
from thingc.targets.urdf.capabilities import CAPABILITIES

SLIDE = "_slide"
"""What the name of a screw's slide ends with."""


class Move(FrozenStruct):
    """A joint of URDF's: `path` names it, `type` says how it moves about or along the unit vector `axis`; `origin` is its frame, and its
    child's, in the frame of the joint or link before it, all at q = 0. `follows` is what a screw's slide follows, by how much [m/rad]."""

    path: str
    type: Literal["turn", "slide"]
    axis: Vector
    origin: Pose
    joint: TreeJoint
    follows: tuple[str, float] | None = None


def own_frame(joints: Sequence[TreeJoint]) -> Pose:
    """The frame of a link as URDF has it, on the last of the `joints` that lead to it, in the link's own."""
    return shifted(*joints[-1].twist.anchor) if joints else NO_POSE


def moves(joints: Sequence[TreeJoint], X_PL: Pose) -> Iterator[Move]:
    """The joints of URDF's that lead to a link, which the `joints` move one after the other; `X_PL` is the link's own frame in that of its
    parent as URDF has it."""
    before = X_PL
    for joint in joints:
        twist, at = joint.twist, shifted(*joint.twist.anchor)
        one = Move(path=joint.path, type="turn" if twist.turns else "slide", axis=twist.axis, origin=before @ at, joint=joint)
        form = CAPABILITIES["joints"][joint_cell(joint.kind)].by
        match form:
            case "each":
                yield one
            case "threaded":
                yield one
                path, follows = f"{joint.path}{SLIDE}", (joint.path, twist.pitch)
                yield Move(path=path, type="slide", axis=twist.axis, origin=NO_POSE, joint=joint, follows=follows)
            case _:
                assert_never(form)
        before = at.inverse()

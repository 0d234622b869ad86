"""Convert the joints of a mode to joints of URDF. A URDF joint rotates about an axis, or slides along an axis, through the origin of its
child link.

A joint with several coordinates becomes a chain of URDF joints, with almost massless links between them. A screw becomes a rotation and a
slide that mimics the rotation. A ball becomes three rotations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import NO_POSE, Pose, Vector, shifted
from thingc.model.robot.types import TreeJoint
from thingc.targets.capabilities import joint_cell
from thingc.targets.urdf.capabilities import CAPABILITIES

SLIDE = "_slide"
"""Suffix of the name of the slide that represents the translation of a screw."""


class Move(FrozenStruct):
    """A joint in a URDF file.

    `path` is the name of the joint. `type` is the kind of its motion about or along the unit vector `axis`, or `floating`. `origin` is the
    frame of the joint and of its child at q = 0, relative to the previous joint or link. `follows` is the joint that the slide of a screw
    mimics, and the ratio [m/rad].
    """

    path: str
    type: Literal["turn", "slide", "floating"]
    axis: Vector
    origin: Pose
    joint: TreeJoint
    follows: tuple[str, float] | None = None


def own_frame(joints: Sequence[TreeJoint]) -> Pose:
    """Return the URDF frame of a link, relative to the link's own frame.

    The URDF frame is located at the last of the `joints` that lead to the link. A free joint does not have a location.
    """
    return shifted(*joints[-1].twist.anchor) if joints and not joints[-1].kind.free else NO_POSE


def moves(joints: Sequence[TreeJoint], X_PL: Pose) -> Iterator[Move]:
    """Yield the URDF joints that lead to a link. Each motion of `joints` becomes one URDF joint.

    `X_PL` is the pose of the link's own frame in the URDF frame of its parent link.
    """
    before = X_PL
    for joint in joints[:1] if joints and joints[0].kind.free else joints:
        twist, at = joint.twist, shifted(*joint.twist.anchor)
        one = Move(path=joint.path, type="turn" if twist.turns else "slide", axis=twist.axis, origin=before @ at, joint=joint)
        form = CAPABILITIES["joints"][joint_cell(joint.kind)].by
        match form:
            case "each":
                yield one
            case "floating":
                yield replace(one, path=joint.path.rpartition("_")[0], type="floating", origin=X_PL)
            case "threaded":
                yield one
                path, follows = f"{joint.path}{SLIDE}", (joint.path, twist.pitch)
                yield Move(path=path, type="slide", axis=twist.axis, origin=NO_POSE, joint=joint, follows=follows)
        before = at.inverse()

"""Convert the joints of a mode to joints of URDF. A URDF joint rotates about an axis, or slides along an axis, through the origin of its
child link.

A joint with several coordinates becomes a chain of URDF joints, with almost massless links between them. A screw becomes a rotation and a
slide that mimics the rotation. A ball becomes three rotations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import NO_POSE, Pose, Vector, make_translation
from thingc.model.assembly.kinematics import joints_of, leaders
from thingc.model.assembly.types import JointEdge
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets.capabilities import joint_cell
from thingc.targets.urdf.capabilities import CAPABILITIES

SLIDE = "_slide"
"""Suffix of the name of the slide that represents the translation of a screw."""


class Move(FrozenStruct):
    """A joint in a URDF file.

    `path` is the name of the joint. `type` is the kind of its motion about or along the unit vector `axis`, or `floating`. `origin` is the
    frame of the joint and of its child at q = 0, relative to the previous joint or link. `mimic` contains the independent joint that this
    joint mimics, the multiplier and the offset. `thread` is the ratio [m/rad] of the slide of a screw, which mimics the rotation.
    """

    path: str
    type: Literal["turn", "slide", "floating"]
    axis: Vector
    origin: Pose
    joint: TreeJoint
    mimic: tuple[JointEdge, float, float] | None = None
    thread: float | None = None


def mimics_of(robot: Robot) -> dict[str, tuple[JointEdge, float, float]]:
    """Return the independent joint, the multiplier and the offset of each mimic joint in the tree of a mode, by path.

    If the leader of a mimic joint is also a mimic joint, the independent joint is written as the leader. Not every reader supports chains
    of mimic joints.
    """
    in_tree = {joint.path for body in robot.bodies for joint in body.joints}
    edges = {joint.path: joint for joint in joints_of(robot.assembly) if joint.path in in_tree}
    followed = leaders(edges.values()).items()
    return {path: (edges[leader], multiplier, offset) for path, (leader, multiplier, offset) in followed if leader != path}


def own_frame(joints: Sequence[TreeJoint]) -> Pose:
    """Return the URDF frame of a link, relative to the link's own frame.

    The URDF frame is located at the last of the `joints` that lead to the link. A free joint does not have a location.
    """
    return make_translation(*joints[-1].twist.anchor) if joints and not joints[-1].kind.free else NO_POSE


def moves(joints: Sequence[TreeJoint], X_PL: Pose, mimics: Mapping[str, tuple[JointEdge, float, float]]) -> Iterator[Move]:
    """Yield the URDF joints that lead to a link. Each motion of `joints` becomes one URDF joint.

    `X_PL` is the pose of the link's own frame in the URDF frame of its parent link. `mimics` contains the mimic joints (see `mimics_of`).
    """
    before = X_PL
    for joint in joints[:1] if joints and joints[0].kind.free else joints:
        twist, at, mimic = joint.twist, make_translation(*joint.twist.anchor), mimics.get(joint.path)
        kind: Literal["turn", "slide"] = "turn" if twist.turns else "slide"
        move = Move(path=joint.path, type=kind, axis=twist.axis, origin=before @ at, joint=joint, mimic=mimic)
        form = CAPABILITIES["joints"][joint_cell(joint.kind)].by
        match form:
            case "each":
                yield move
            case "floating":
                yield replace(move, path=joint.path.rpartition("_")[0], type="floating", origin=X_PL)
            case "threaded":
                yield move
                leader, multiplier, offset = mimic or (joint, 1.0, 0.0)
                follows = leader, multiplier * twist.pitch, offset * twist.pitch
                yield replace(move, path=f"{joint.path}{SLIDE}", type="slide", origin=NO_POSE, mimic=follows, thread=twist.pitch)
        before = at.inverse()

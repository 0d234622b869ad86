"""Convert joint coordinates to MuJoCo joints: hinges, slides and balls. A screw becomes a hinge and a slide that are coupled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import rotation_vector
from thingc.base.pose import Pose, Vector, quaternion_of
from thingc.model.robot.types import Body, Robot, TreeJoint
from thingc.targets.capabilities import joint_cell
from thingc.targets.mjcf.capabilities import CAPABILITIES


class MujocoJoint(FrozenStruct, kw_only=False):
    """A MuJoCo joint: its `name`, its `type`, and the unit vector `axis`. `ratio` is the motion of the joint per unit of the coordinate."""

    name: str
    type: Literal["hinge", "slide"]
    axis: Vector
    ratio: float = 1.0


def mujoco_joints(joint: TreeJoint) -> tuple[MujocoJoint, ...]:
    """Return the MuJoCo joints for a joint coordinate. The first of these joints has the name and the values of the coordinate.

    The result is empty for a coordinate of a ball joint or free joint, because all its coordinates become a single MuJoCo joint.
    """
    path, twist = joint.path, joint.twist
    form = CAPABILITIES["joints"][joint_cell(joint.kind)].by
    match form:
        case "each":
            return (MujocoJoint(path, twist.core, twist.axis),)
        case "threaded":
            return (MujocoJoint(path, twist.core, twist.axis), MujocoJoint(f"{path}:slide", "slide", twist.axis, twist.pitch))
        case "ball" | "free":
            return ()


def is_ball(joints: Sequence[TreeJoint]) -> bool:
    """Return whether the joint coordinates that move a body belong to a ball joint."""
    return bool(joints) and CAPABILITIES["joints"][joint_cell(joints[0].kind)].by == "ball"


def positions(body: Body, q: Mapping[str, float], pose: Pose) -> tuple[float, ...]:
    """Convert joint values [rad or m] to the `qpos` entries of the joints of a body. `q` contains the joint values, by path.

    The entries of a free joint are the `pose` of the body in the world.
    """
    if body.free:
        return (*pose.translation, *pose.quaternion())
    if is_ball(body.joints):
        return quaternion_of(rotation_vector(body.twists, tuple(q[joint.path] for joint in body.joints)))
    return tuple(mujoco_joint.ratio * q[joint.path] for joint in body.joints for mujoco_joint in mujoco_joints(joint))


def in_body(body: Body, axis: Vector) -> Vector:
    """Convert the axis of a ball joint's drive from the axes of the document to the axes of the body.

    If the joint is reversed in the tree, the axis changes its sign. The sign changes because the drive moves the document's parent relative
    to the child.
    """
    joints = body.joints[::-1] if body.joints[0].reversed else body.joints
    return rotation_vector(tuple(joint.twist for joint in joints), axis)


def base_positions(robot: Robot) -> tuple[float, ...]:
    """Return the `qpos` of a planar or ball base in the pose of the mode."""
    return positions(replace(robot.bodies[0], joints=robot.moves), {joint.path: 0.0 for joint in robot.moves}, robot.bodies[0].X_PL)


def sizes(joints: Sequence[TreeJoint]) -> tuple[int, int]:
    """Return the numbers of entries in `qpos` and in `qvel` that belong to the joints of a body."""
    if is_ball(joints):
        return 4, 3
    if joints and joints[0].kind.free:
        return 7, 6
    count = sum(len(mujoco_joints(joint)) for joint in joints)
    return count, count

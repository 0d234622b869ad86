"""Joints lowered to MuJoCo's: a turn is a hinge, a slide a slide, a ball a ball. MuJoCo has no screw; there it is a hinge and a slide, tied
together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, assert_never

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import rotation_vector
from thingc.base.pose import Vector, quaternion_of
from thingc.model.robot.types import Body, Robot, TreeJoint
from thingc.targets.capabilities import joint_cell
from thingc.targets.mjcf.capabilities import CAPABILITIES


class MujocoJoint(FrozenStruct, kw_only=False):
    """A joint of MuJoCo's: its `name`, `type`, unit `axis`, and by how much it moves per unit of the coordinate (`ratio`)."""

    name: str
    type: Literal["hinge", "slide"]
    axis: Vector
    ratio: float = 1.0


def lowered(joint: TreeJoint) -> tuple[MujocoJoint, ...]:
    """The joints of a coordinate; the first has its name and its values. None of one of a ball, which is one joint for all of them."""
    path, twist = joint.path, joint.twist
    form = CAPABILITIES["joints"][joint_cell(joint.kind)].by
    match form:
        case "each":
            return (MujocoJoint(path, twist.core, twist.axis),)
        case "threaded":
            return (MujocoJoint(path, twist.core, twist.axis), MujocoJoint(f"{path}:slide", "slide", twist.axis, twist.pitch))
        case "ball":
            return ()
        case _:
            assert_never(form)


def is_ball(joints: Sequence[TreeJoint]) -> bool:
    """Whether these coordinates are one joint of MuJoCo's, a ball."""
    return bool(joints) and CAPABILITIES["joints"][joint_cell(joints[0].kind)].by == "ball"


def positions(body: Body, q: Mapping[str, float]) -> tuple[float, ...]:
    """What MuJoCo's `qpos` has of the joints of a body at `q` (every joint by path, rad or m)."""
    if is_ball(body.joints):
        return quaternion_of(rotation_vector(body.twists, tuple(q[joint.path] for joint in body.joints)))
    return tuple(one.ratio * q[joint.path] for joint in body.joints for one in lowered(joint))


def in_body(body: Body, axis: Vector) -> Vector:
    """The axis of a drive of the ball that a body turns on (as the document writes it) in the axes of the body; where
    the tree crosses the joint backwards the opposite: the drive turns the document's parent against its child."""
    joints = body.joints[::-1] if body.joints[0].reversed else body.joints
    return rotation_vector(tuple(joint.twist for joint in joints), axis)


def base_positions(robot: Robot) -> tuple[float, ...]:
    """What `qpos` has of a base that moves in part, where the mode puts it."""
    return positions(replace(robot.bodies[0], joints=robot.moves), {joint.path: 0.0 for joint in robot.moves})


def sizes(joints: Sequence[TreeJoint]) -> tuple[int, int]:
    """How many entries of `qpos` and of `qvel` the joints of a body have."""
    if is_ball(joints):
        return 4, 3
    count = sum(len(lowered(joint)) for joint in joints)
    return count, count

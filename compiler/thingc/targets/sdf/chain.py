"""Convert the joints of a mode to SDF joints. An SDF joint rotates about axes, or slides along axes, through a fixed point of its child.

SDF supports rotations, slides, screws, balls, and two rotations about intersecting axes (`universal`). Any other joint with several
coordinates becomes a chain of joints with almost massless links between them. The file is written in a pose in which all joints are at 0,
and in which loops and holds are closed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import Twist
from thingc.base.pose import NO_POSE, Pose, Vector
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import JointEdge
from thingc.model.robot.kinematics import placed_bodies
from thingc.model.robot.loop_solver import Loops, SolverState
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets.capabilities import joint_cell
from thingc.targets.connections import Connection
from thingc.targets.sdf.capabilities import CAPABILITIES

SdfType = Literal["fixed", "continuous", "revolute", "prismatic", "screw", "universal", "ball"]


class SdfAxis(FrozenStruct):
    """A coordinate of an SDF joint, with the twist that describes its motion in the frame of the child link.

    The twist applies in the pose in which the file is written.
    """

    joint: TreeJoint | JointEdge
    twist: Twist


class SdfJoint(FrozenStruct):
    """A joint in an SDF file.

    `path` is the name of the joint, and `at` is its origin in the frame of the child link [m]. `axes` is empty for a `fixed` joint or a
    `ball`.
    """

    path: str
    type: SdfType
    at: Vector
    axes: tuple[SdfAxis, ...] = ()


def chain(connection: Connection, q: Mapping[str, float]) -> tuple[SdfJoint, ...]:
    """Return the SDF joints that connect two bodies, in order.

    `q` contains the coordinates [rad or m] in the pose in which the file is written. Coordinates of a base are at 0 in this pose.
    """
    path, joints = connection.path, connection.coordinates
    if not joints:
        return (SdfJoint(path=path, type="ball" if connection.turns else "fixed", at=connection.X_1.translation),)
    twists = [twist.seen_from(connection.X_1) for twist in connection.twists]
    form = CAPABILITIES["joints"][joint_cell(joints[0].kind)].by
    if form == "free":
        return ()
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


def _type(axis: SdfAxis) -> SdfType:
    if not axis.twist.turns:
        return "prismatic"
    if axis.twist.pitch:
        return "screw"
    return "revolute" if axis.joint.limit.bounded else "continuous"


class ZeroState(FrozenStruct):
    """The state of a robot in which all joints of its SDF file are at zero.

    The fields contain the values `q` [rad or m] of the document's joints by path, and the pose of the root link in the world. `pose` is the
    name of this pose in the document. `pose` is None if all joints of the document are at 0. `closed` is True if loops and holds are closed
    in this state.
    """

    q: dict[str, float]
    base: Pose
    pose: str | None = None
    closed: bool = True


def zero_state(robot: Robot) -> ZeroState:
    """Return the state of a robot in which the joints of its SDF file are at zero.

    If loops and holds are closed when all joints of the document are at 0, return this state. Otherwise, return the first pose of the
    document in which loops and holds are closed.
    """
    q = {joint.path: 0.0 for joint in joints_of(robot.assembly)}
    if not robot.closures:
        return ZeroState(q=q, base=robot.bodies[0].X_PL)
    base = _as_held(robot, q)
    loops = Loops(robot.bodies, robot.closures, joints_of(robot.assembly), base)
    if loops.are_closed(SolverState(q=q, base=base)):
        return ZeroState(q=q, base=base)
    if not robot.keyframes:
        return ZeroState(q=q, base=robot.bodies[0].X_PL, closed=False)
    frame = robot.keyframes[0]
    return ZeroState(q=frame.q, base=frame.base or robot.bodies[0].X_PL, pose=frame.name)


def _as_held(robot: Robot, q: dict[str, float]) -> Pose:
    """Return the pose of the root link in the world for joint values `q`. If the base is free, its pose is determined by the first hold."""
    base = robot.bodies[0].X_PL
    hold = next((closure for closure in robot.closures if closure.hold), None)
    if robot.base != "free" or hold is None:
        return base
    X_WB = placed_bodies(robot.bodies, q, base)[hold.child] @ hold.X_CB
    if hold.turns:
        shift = [target - found for target, found in zip(hold.X_PA.translation, X_WB.translation, strict=True)]
        return Pose(translation=(shift[0], shift[1], shift[2])) @ base
    return hold.X_PA @ X_WB.inverse() @ base

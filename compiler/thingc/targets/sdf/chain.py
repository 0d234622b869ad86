"""Joints as SDF has them: each about, or along, axes through a point that is fixed in its child, and at 0 where the file has the links.

Turns, slides, screws, balls, and two turns about axes that meet (`universal`) are there; what else has several coordinates is a chain, with
almost massless links between. Where a file has a robot, its joints are at 0 and closed, loops and holds among them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, assert_never

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


class ZeroState(FrozenStruct):
    """`q` [rad or m] of every joint by path, and the pose of the root link in the world; `pose` is the pose of the document that this is
    (None: all joints at 0), `closed` whether loops and holds are closed there."""

    q: dict[str, float]
    base: Pose
    pose: str | None = None
    closed: bool = True


def zero_state(robot: Robot) -> ZeroState:
    """All joints at 0, where loops and holds let them be; else the first pose in which they are closed."""
    q = {joint.path: 0.0 for joint in joints_of(robot.assembly)}
    if not robot.closures:
        return ZeroState(q=q, base=robot.bodies[0].X_PL)
    base = _as_held(robot, q)
    loops = Loops(robot.bodies, robot.closures, joints_of(robot.assembly), base)
    if loops.closed(SolverState(q=q, base=base)):
        return ZeroState(q=q, base=base)
    for frame in robot.keyframes:
        return ZeroState(q=frame.q, base=frame.base or robot.bodies[0].X_PL, pose=frame.name)
    return ZeroState(q=q, base=robot.bodies[0].X_PL, closed=False)


def _as_held(robot: Robot, q: dict[str, float]) -> Pose:
    """Where the root is at `q`: of a free base that is held where its first hold wants it."""
    base = robot.bodies[0].X_PL
    hold = next((closure for closure in robot.closures if closure.hold), None)
    if robot.base != "free" or hold is None:
        return base
    X_WB = placed_bodies(robot.bodies, q, base)[hold.child] @ hold.X_CB
    if hold.turns:
        shift = [wanted - found for wanted, found in zip(hold.X_PA.translation, X_WB.translation, strict=True)]
        return Pose(translation=(shift[0], shift[1], shift[2])) @ base
    return hold.X_PA @ X_WB.inverse() @ base

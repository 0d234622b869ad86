"""Where an SDF file has a robot. The joints of SDF are at 0 there and closed, loops and holds among them."""

from __future__ import annotations

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Pose
from thingc.model.assembly.kinematics import joints_of
from thingc.model.robot.kinematics import placed_bodies
from thingc.model.robot.loop_solver import Loops, SolverState
from thingc.model.robot.types import Robot


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

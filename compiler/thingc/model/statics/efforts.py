"""Compute the efforts with which drives hold a robot still against gravity and springs, and the margins of the drives.

The coordinates of a robot are the joints that do not mimic others. Q is the load of gravity and springs on the coordinates. The columns of
N are a basis of the motions that the closing conditions of the loops allow. The matrix S maps the efforts t of the drives to loads on the
coordinates. The efforts balance the load if

    N' (Q + S t) = 0

In a tree, N is the identity. If no feet support the tree and each drive acts on a single coordinate, the efforts are computed separately
for each coordinate. In all other cases, the load is distributed by least squares (`load_sharing.py`, the only module of this folder that
imports numpy). Dry friction in joints is not taken into account.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from thingc.base import numeric
from thingc.base.joints.twist import velocities
from thingc.base.memo import Memo
from thingc.base.pose import NO_POSE, Pose, Vector, cross, dot
from thingc.model.assembly.kinematics import joints_of, leaders
from thingc.model.assembly.types import JointEdge
from thingc.model.robot.kinematics import course_of, in_world, rates
from thingc.model.robot.types import Robot
from thingc.model.statics.types import DriveTransmission, Efforts, answer


def static_efforts(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose], memo: Memo | None = None) -> Efforts:
    """Compute the drive efforts that hold the robot still at the joint positions `q` [rad or m], which is a mapping by joint path.

    `q` contains all joints, and the kinematic loops must be closed at `q`.

    `bodies` contains the poses of all bodies in the world. A free base is supported by the feet and holds of the mode. Without feet and
    holds, a free base counts as fixed. Every other base also counts as fixed. `memo` caches the distribution of loads.
    """
    return balance_loads(robot, q, bodies, *problem(robot, q, bodies), memo)


def balance_loads(
    robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose], load: Mapping[str, float], drives: Sequence[DriveTransmission],
    memo: Memo | None = None,
) -> Efforts:
    """Compute the drive efforts that balance the loads on the joint coordinates. For the other arguments, see `static_efforts`."""
    if not robot.closures and not robot.carried and all(len(drive.moves) == 1 for drive in drives):
        return balance_tree(load, drives)
    from thingc.model.statics.load_sharing import balance_shared

    return balance_shared(robot, q, bodies, load, drives, memo)


def problem(
    robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose], moving: Mapping[str, float] | None = None,
) -> tuple[dict[str, float], list[DriveTransmission]]:
    """Return the load [N m or N] on each joint coordinate, and the drives that exist in the mode.

    `moving` contains additional loads on joints by path, such as the loads of a motion (`model/dynamics/inertial_loads.py`). The other
    arguments have the same meaning as for `static_efforts`.
    """
    joints = joints_of(robot.assembly)
    on_joints = loads(robot, q, bodies)
    load: dict[str, float] = {}
    drives: list[DriveTransmission] = []
    following = leaders(joints, q)
    for joint in joints:
        path, limit = joint.path, joint.limit.effort
        leader, factor, _ = following[path]
        own = on_joints[path] if moving is None else on_joints[path] + moving.get(path, 0.0)
        load[leader] = load.get(leader, 0.0) + factor * own
        if path in robot.present:
            axis = joint.actuator.axis if joint.actuator is not None else None
            moves = ((leader, factor),) if axis is None else _drive_speeds(joint, axis, joints, q)
            drives.append(DriveTransmission(path, moves, limit, limit or 1.0))
    for tendon in robot.assembly.tendons:
        if tendon.path in robot.pulled and tendon.actuator is not None:
            by_leader: dict[str, float] = {}
            for path, own in rates(robot, tendon, q, bodies).items():
                leader, factor, _ = following[path]
                by_leader[leader] = by_leader.get(leader, 0.0) + own * factor
            limit = tendon.actuator.effort
            drives.append(DriveTransmission(tendon.path, tuple(by_leader.items()), limit, limit or 1.0))
    return load, drives


def _drive_speeds(joint: JointEdge, axis: Vector, joints: Iterable[JointEdge], q: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """Return the speed of a drive of a ball joint per speed of each coordinate.

    The speed is the angular velocity about the `axis` of the drive, which is fixed in the child.
    """
    ball = tuple(coordinate for coordinate in joints if coordinate.name.joint == joint.name.joint)
    values = tuple(q[coordinate.path] for coordinate in ball)
    twists = velocities(tuple(coordinate.twist for coordinate in ball), values, NO_POSE, at_once=True)
    return tuple((ball[number].path, dot(axis, twist.angular)) for number, twist in twists)


def balance_tree(load: Mapping[str, float], drives: Sequence[DriveTransmission]) -> Efforts:
    """Compute the drive efforts that balance the loads of a robot without loops.

    `load` maps the paths of coordinates to loads [N m or N].

    Several drives can act on one coordinate with the load Q. The drives have the factors f and the weights l. The least sum of (t / l)^2
    with sum f t = -Q is at t = -Q f l^2 / sum (f l)^2.
    """
    largest: dict[str, float] = {}  # scale the limits, because the square of a limit may overflow
    for _, ((leader, factor),), _, weight in drives:
        largest[leader] = numeric.maximum(largest.get(leader, 0.0), abs(factor * weight))

    def weight_square(leader: str, factor: float, weight: float) -> float:
        return (factor * weight / largest[leader]) ** 2 if largest[leader] > 0.0 else 0.0

    total: dict[str, float] = {}
    for _, ((leader, factor),), _, weight in drives:
        total[leader] = total.get(leader, 0.0) + weight_square(leader, factor, weight)
    efforts: dict[str, float] = {}
    for path, ((leader, factor),), _, weight in drives:
        share = weight_square(leader, factor, weight)
        # A single drive has a share of exactly 1. A drive that does not move with its coordinate has no share.
        efforts[path] = 0.0 - load[leader] * (share / total[leader]) / factor if share > 0.0 else 0.0
    held = {leader for leader, value in total.items() if value > 0.0}
    unheld, where = 0.0, next(iter(load), "")
    for path, value in load.items():
        if path not in held and abs(value) > unheld:
            unheld, where = abs(value), path
    greatest = numeric.maximum(map(abs, load.values()), default=0.0)
    return answer(drives, efforts, greatest, unheld, where, len(drives) - len(held))


def loads(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose]) -> dict[str, float]:
    """Compute the load [N m or N] on every joint, which is caused by gravity and by the spring of the joint.

    The result is keyed by joint path. A positive load acts in the direction of positive q.

    `q` maps the paths of all joints to positions [rad or m], and `bodies` contains the poses of all bodies in the world. The gravity load
    of a joint is a moment about its axis: the sum over the weights of all bodies below the joint in the kinematic tree. Kinematic loops
    count as open. A free joint has no load. Closed loops do no work along the motions that they allow, so the loads are also the
    generalized forces of a robot with loops. A joint at which a loop was cut has only the load of its spring. For the moments of weights,
    see Featherstone, Rigid Body Dynamics Algorithms, section 5.3 (inverse dynamics at rest). The time is linear in the number of bodies.
    """
    count = len(robot.bodies)
    masses = [0.0] * count
    moments: list[Vector] = [(0.0, 0.0, 0.0)] * count
    for index in range(count - 1, -1, -1):
        body = robot.bodies[index]
        own = robot.assembly.links[body.link].properties
        x, y, z = bodies[index].apply(own.centre)
        mass = masses[index] = masses[index] + own.mass
        mx, my, mz = moments[index]
        moment = moments[index] = (mx + own.mass * x, my + own.mass * y, mz + own.mass * z)
        if body.parent is not None and not body.free:
            masses[body.parent] += mass
            px, py, pz = moments[body.parent]
            moments[body.parent] = (px + moment[0], py + moment[1], pz + moment[2])
    load_of: dict[str, float] = {}
    for index, body in enumerate(robot.bodies):
        load_of.update((joint.path, 0.0) for joint in body.joints if body.free)
        for joint, twist in in_world(body, bodies[index], q) if not body.free else ():
            p, s, m = twist.anchor, moments[index], masses[index]
            arm = (s[0] - m * p[0], s[1] - m * p[1], s[2] - m * p[2])
            weight = dot(twist.angular, cross(arm, robot.gravity)) + m * dot(twist.linear, robot.gravity)
            load_of[joint.path] = weight + joint.dynamics.sprung(q[joint.path])
    for closure in robot.closures:
        for cut in closure.joints:
            load_of[cut.path] = cut.dynamics.sprung(q[cut.path])
    for tendon in robot.assembly.tendons:
        if tendon.dynamics.stiffness is None:
            continue
        long = course_of(robot, tendon, bodies).length if tendon.steps else tendon.length(q)
        pull = tendon.dynamics.sprung(long)
        for path, factor in rates(robot, tendon, q, bodies).items():
            load_of[path] = load_of.get(path, 0.0) + factor * pull
    return load_of

"""Loads of gravity and springs on the joints of a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from thingc.base.pose import Pose, Vector, cross, dot
from thingc.model.robot.kinematics import course_of, in_world, rates
from thingc.model.robot.types import Robot


def loads(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose]) -> dict[str, float]:
    """Return the load of gravity and of its own spring on every joint [N m or N] by joint path, positive along positive q.

    `q` has all joints by path (rad or m); the poses of the bodies are in the world. The gravity load is the moment about the joint's axis
    of everything behind the joint in the tree, with loops open. A closed loop does no work along motions that it allows, so the loads are
    also the generalized forces of a robot with loops. A joint that was cut has only the load of its spring. For the moments of weights
    about axes see Featherstone, Rigid Body Dynamics Algorithms, section 5.3 (inverse dynamics at rest). The time is linear in the number of
    bodies.
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
        if body.parent is not None:
            masses[body.parent] += mass
            px, py, pz = moments[body.parent]
            moments[body.parent] = (px + moment[0], py + moment[1], pz + moment[2])
    load_of: dict[str, float] = {}
    for index, body in enumerate(robot.bodies):
        for joint, twist in in_world(body, bodies[index], q):
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

"""Compute the loads of a motion on the joints, in addition to the static loads (`model/statics/efforts.py`).

The loads are caused by inertia, armature, damping and dry friction. The inertia of links is computed with the recursive Newton-Euler
algorithm in world coordinates (Featherstone, Rigid Body Dynamics Algorithms, section 5.3). Spatial vectors `(6,)` contain the angular part
and then the linear part at the origin of the world. The base does not move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from thingc.base.inertia import MassProperties
from thingc.base.numeric import maximum, sum_of
from thingc.base.pose import Pose
from thingc.model.dynamics.motion_curve import JointStates
from thingc.model.resolve.coordinates import Dynamics
from thingc.model.robot.kinematics import body_poses, in_world, rates
from thingc.model.robot.types import Body, Robot, TreeJoint

Array = NDArray[np.float64]

STEP = 1e-4
"""Change of joint coordinates [rad or m] in central differences, for the axes of ball joints and for the paths of tendons."""
STILL = 1e-9
"""Velocities [rad/s or m/s] below this value are rounding errors, at which dry friction does not act."""


def inertial_loads(robot: Robot, bodies: Sequence[Pose], state: JointStates) -> dict[str, float]:
    """Compute the loads [N m or N] of a motion on all joints of a robot, by joint path. Kinematic loops count as open.

    A positive load acts in the direction of positive q. `bodies` contains the poses of all bodies in the world.
    """
    velocity, acceleration, force = (np.zeros((len(robot.bodies), 6)) for _ in range(3))
    axes: list[list[tuple[TreeJoint, Array]]] = []
    loads: dict[str, float] = {}
    for index, body in enumerate(robot.bodies):
        axes.append([] if body.free else _axes(body, bodies[index], state.q))
        if body.parent is not None and not body.free:
            velocity[index], acceleration[index] = velocity[body.parent], acceleration[body.parent]
        around = velocity[index].copy()
        for joint, axis in axes[index]:
            v = state.v[joint.path]
            acceleration[index] += axis * state.a[joint.path] + _cross(around if body.at_once else velocity[index]) @ axis * v
            velocity[index] += axis * v
        if body.at_once and axes[index]:
            acceleration[index] += _bend(body, bodies[index], state)
        links = robot.assembly.links[body.link].properties
        force[index] = _force(links.seen_from(bodies[index]), velocity[index], acceleration[index])
    for index in range(len(robot.bodies) - 1, -1, -1):
        body = robot.bodies[index]
        for joint, axis in axes[index]:
            loads[joint.path] = -float(axis @ force[index]) - _resistance(joint.dynamics, state.v[joint.path], state.a[joint.path])
        if body.parent is not None and not body.free:
            force[body.parent] += force[index]
    for closure in robot.closures:
        for cut in closure.joints:
            loads[cut.path] = -_resistance(cut.dynamics, state.v[cut.path], state.a[cut.path])
    _add_tendons(robot, bodies, state, loads)
    return loads


def _axes(body: Body, pose: Pose, q: Mapping[str, float]) -> list[tuple[TreeJoint, Array]]:
    """Return the joints of a body from the first to the last, each with the spatial velocity of the body per unit of its coordinate."""
    found = [(joint, twist.velocity((0.0, 0.0, 0.0))) for joint, twist in in_world(body, pose, q)]
    return [(joint, np.array([*angular, *linear])) for joint, (linear, angular) in reversed(found)]


def _bend(body: Body, pose: Pose, state: JointStates) -> Array:
    """Return the acceleration of a ball joint that is caused by the change of its axes, whose coordinates are a rotation vector."""
    fastest = maximum(abs(state.v[joint.path]) for joint in body.joints)
    if fastest == 0.0:
        return np.zeros(6)
    step = STEP / fastest

    def speed(time: float) -> Array:
        q = {joint.path: state.q[joint.path] + time * state.v[joint.path] for joint in body.joints}
        return sum((axis * state.v[joint.path] for joint, axis in _axes(body, pose, q)), np.zeros(6))

    return (speed(step) - speed(-step)) / (2.0 * step)


def _force(own: MassProperties, velocity: Array, acceleration: Array) -> Array:
    """Return the spatial force that moves a body, whose mass properties are in the axes of the world."""
    inertia = np.zeros((6, 6))
    arm = _skew(np.array(own.centre))
    inertia[:3, :3] = np.array(own.inertia) - own.mass * arm @ arm
    inertia[:3, 3:], inertia[3:, :3] = own.mass * arm, -own.mass * arm
    inertia[3:, 3:] = own.mass * np.eye(3)
    force: Array = inertia @ acceleration - _cross(velocity).T @ inertia @ velocity
    return force


def _cross(velocity: Array) -> Array:
    """Return the matrix `(6, 6)` of the spatial cross product with a velocity."""
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = matrix[3:, 3:] = _skew(velocity[:3])
    matrix[3:, :3] = _skew(velocity[3:])
    return matrix


def _skew(vector: Array) -> Array:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _resistance(dynamics: Dynamics, v: float, a: float) -> float:
    """Return the torque [N m] or force [N] that armature, damping and dry friction need at a velocity and an acceleration."""
    dry = 0.0 if abs(v) < STILL else float(np.copysign(dynamics.friction or 0.0, v))
    return (dynamics.armature or 0.0) * a + (dynamics.damping or 0.0) * v + dry


def _add_tendons(robot: Robot, bodies: Sequence[Pose], state: JointStates, loads: dict[str, float]) -> None:
    """Add the loads of armature, damping and dry friction of tendons to `loads`."""
    for tendon in robot.assembly.tendons:
        if not tendon.dynamics.acts:
            continue
        slopes = rates(robot, tendon, state.q, bodies)
        v, a = (sum_of(slope * own[path] for path, slope in slopes.items()) for own in (state.v, state.a))
        fastest = maximum(map(abs, state.v.values()), default=0.0)
        if tendon.steps and tendon.dynamics.armature and fastest:
            ends = []
            for step in (STEP / fastest, -STEP / fastest):
                q = {path: value + step * state.v[path] for path, value in state.q.items()}
                moved = rates(robot, tendon, q, body_poses(robot, q, bodies[0]))
                ends.append(sum_of(slope * state.v[path] for path, slope in moved.items()))
            a += (ends[0] - ends[1]) * fastest / (2.0 * STEP)
        pull = _resistance(tendon.dynamics, v, a)
        for path, slope in slopes.items():
            loads[path] = loads.get(path, 0.0) - slope * pull

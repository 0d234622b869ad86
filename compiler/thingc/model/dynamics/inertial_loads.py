"""Compute the loads of a motion on the joints, in addition to the static loads (`model/statics/efforts.py`).

The loads are caused by inertia, armature, damping and dry friction. The base does not move. Spatial vectors `(6,)` contain the angular part
and then the linear part at the origin of the world. The force that moves a link is the rate of change of its spatial momentum
(Featherstone, Rigid Body Dynamics Algorithms, section 2.13). This rate is computed by differences along the motion that has the same
velocity and acceleration.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from thingc.base.inertia import MassProperties
from thingc.base.numeric import maximum, sqrt, sum_of
from thingc.base.pose import Pose, cross, rotate
from thingc.model.dynamics.motion_curve import JointStates
from thingc.model.resolve.coordinates import Dynamics
from thingc.model.robot.kinematics import body_poses, in_world, rates
from thingc.model.robot.types import Robot

Array = NDArray[np.float64]
Vector6 = tuple[float, float, float, float, float, float]

STEP = 3e-3
"""Largest change of a joint coordinate [rad or m] in the differences, whose errors are of the fourth order."""
STILL = 1e-9
"""Velocities [rad/s or m/s] below this value are rounding errors, at which dry friction does not act."""


def inertial_loads(robot: Robot, bodies: Sequence[Pose], state: JointStates) -> dict[str, float]:
    """Compute the loads [N m or N] of a motion on all joints of a robot, by joint path. Kinematic loops count as open.

    A positive load acts in the direction of positive q. `bodies` contains the poses of all bodies in the world.
    """
    fastest = maximum((maximum(abs(v), sqrt(abs(state.a[path]))) for path, v in state.v.items()), default=0.0)
    step = STEP / fastest if fastest > 0.0 else 1.0
    far, near, after, later = (_momenta(robot, bodies[0], state, k * step) for k in (-2.0, -1.0, 1.0, 2.0))
    change = (far - 8.0 * near + 8.0 * after - later) / (12.0 * step)
    force = change[: len(robot.bodies)]
    loads: dict[str, float] = {}
    for index in range(len(robot.bodies) - 1, -1, -1):
        body = robot.bodies[index]
        for path, axis in _axes(robot, index, bodies[index], state.q).items():
            loads[path] = -float(axis @ force[index])
        if body.parent is not None and not body.free:
            force[body.parent] += force[index]
    joints = [*(joint for body in robot.bodies for joint in body.joints), *(joint for one in robot.closures for joint in one.joints)]
    for joint in joints:
        loads[joint.path] = loads.get(joint.path, 0.0) - _resistance(joint.dynamics, state.v[joint.path], state.a[joint.path])
    for number, tendon in enumerate(robot.assembly.tendons):
        slopes = rates(robot, tendon, state.q, bodies) if tendon.dynamics.acts else {}
        v = sum_of(slope * state.v[path] for path, slope in slopes.items())
        for path, slope in slopes.items():
            loads[path] = loads.get(path, 0.0) - slope * _resistance(tendon.dynamics, v, float(change[len(robot.bodies) + number, 0]))
    return loads


def _momenta(robot: Robot, base: Pose, state: JointStates, time: float) -> Array:
    """Return the spatial momentum of each body `(bodies, 6)` at a time [s] after the state. Rows of tendons follow, with their speeds."""
    q = {path: value + time * (state.v[path] + time * state.a[path] / 2.0) for path, value in state.q.items()}
    v = {path: value + time * state.a[path] for path, value in state.v.items()}
    bodies, count = body_poses(robot, q, base), len(robot.bodies)
    velocity, momenta = np.zeros((count, 6)), np.zeros((count + len(robot.assembly.tendons), 6))
    for index, body in enumerate(robot.bodies):
        if body.parent is not None and not body.free:
            velocity[index] = velocity[body.parent]
        velocity[index] += sum((axis * v[path] for path, axis in _axes(robot, index, bodies[index], q).items()), np.zeros(6))
        momenta[index] = _momentum(robot.assembly.links[body.link].properties.seen_from(bodies[index]), *velocity[index].tolist())
    for number, tendon in enumerate(robot.assembly.tendons):
        if tendon.dynamics.acts:
            momenta[count + number] = sum_of(slope * v[path] for path, slope in rates(robot, tendon, q, bodies).items())
    return momenta


def _axes(robot: Robot, index: int, pose: Pose, q: Mapping[str, float]) -> dict[str, Array]:
    """Return the spatial velocity of a body per unit of each coordinate of its joints, by path. A free joint carries no load."""
    if robot.bodies[index].free:
        return {}
    moves = {joint.path: twist.velocity((0.0, 0.0, 0.0)) for joint, twist in in_world(robot.bodies[index], pose, q)}
    return {path: np.array([*angular, *linear]) for path, (linear, angular) in moves.items()}


def _momentum(own: MassProperties, wx: float, wy: float, wz: float, vx: float, vy: float, vz: float) -> Vector6:
    """Return the spatial momentum of a body with a spatial velocity. The mass properties are in the axes of the world."""
    spin, m = (wx, wy, wz), own.mass
    x, y, z = cross(spin, own.centre)
    linear = (m * (vx + x), m * (vy + y), m * (vz + z))
    (lx, ly, lz), (ox, oy, oz) = rotate(own.inertia, spin), cross(own.centre, linear)
    return (lx + ox, ly + oy, lz + oz, *linear)


def _resistance(dynamics: Dynamics, v: float, a: float) -> float:
    """Return the torque [N m] or force [N] that armature, damping and dry friction need at a velocity and an acceleration."""
    dry = 0.0 if abs(v) < STILL else float(np.copysign(dynamics.friction or 0.0, v))
    return (dynamics.armature or 0.0) * a + (dynamics.damping or 0.0) * v + dry

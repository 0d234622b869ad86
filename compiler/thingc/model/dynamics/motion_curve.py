"""Compute positions, velocities and accelerations of all joints during a motion of the document."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray
from scipy.interpolate import BPoly, CubicSpline

from thingc.base.numeric import sum_of
from thingc.model.assembly.kinematics import coordinates, joints_of
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.types import NamedMotion
from thingc.model.robot.loop_closure import close_pose
from thingc.model.robot.loop_solver import Loops, SolverState
from thingc.model.robot.types import Robot

SAMPLES = 200
"""Number of intervals at whose ends a motion is examined; more if the motion has more times, up to `MOST`."""
MOST = 2000


class JointStates(NamedTuple):
    """Positions [rad or m], velocities [1/s] and accelerations [1/s^2] of all joints by path."""

    q: dict[str, float]
    v: dict[str, float]
    a: dict[str, float]


class MotionCurve:
    """The joint coordinates of a motion as functions of time.

    Between two poses, each coordinate moves with minimum jerk from rest to rest: `q0 + (q1 - q0) (10 s^3 - 15 s^4 + 6 s^5)`. See Flash and
    Hogan, "The coordination of arm movements", 1985. The positions of a file are joined by natural cubic splines.
    """

    def __init__(self, assembly: Assembly, motion: NamedMotion) -> None:
        self.times = np.array(motion.times)
        self._joints = {joint.path: joint for joint in joints_of(assembly)}
        self._paths = tuple(motion.values)
        values = np.array([motion.values[path] for path in self._paths], dtype=np.float64).reshape(len(self._paths), len(self.times)).T
        rest = np.zeros_like(values)
        self._curve = (
            CubicSpline(self.times, values, bc_type="natural") if motion.smooth
            else BPoly.from_derivatives(self.times, np.stack([values, rest, rest], axis=1))
        )

    def samples(self) -> NDArray[np.float64]:
        """Return the times [s] at which the motion is examined: all times of the motion, and equal steps between them."""
        last = len(self.times) - 1
        per, stride = -(-SAMPLES // last), -(-last // MOST)
        places = np.append(np.arange(0, last * per, stride), last * per) / per
        return np.asarray(np.interp(places, np.arange(last + 1), self.times), dtype=np.float64)

    def positions(self, time: float) -> dict[str, float]:
        """Return the positions [rad or m] of the joints that the motion sets, at a time [s]."""
        return dict(zip(self._paths, self._curve(time).tolist(), strict=True))

    def at(self, time: float) -> JointStates:
        """Return the state of all joints at a time [s], including joints that mimic others."""
        q, v, a = (dict(zip(self._paths, self._curve(time, order).tolist(), strict=True)) for order in range(3))
        q = coordinates(self._joints.values(), q)
        for path in q:
            self._follow(path, q, v, a)
        return JointStates(q, v, a)

    def _follow(self, path: str, q: dict[str, float], v: dict[str, float], a: dict[str, float]) -> None:
        """Add the velocity and the acceleration of a joint to `v` and `a`. A joint that mimics another joint follows its polynomial."""
        mimic = self._joints[path].mimic
        if path in v or mimic is None:
            v.setdefault(path, 0.0)
            a.setdefault(path, 0.0)
            return
        leader = mimic.joint.path
        self._follow(leader, q, v, a)
        bend = sum_of(k * (k - 1) * c * q[leader] ** (k - 2) for k, c in enumerate(mimic.polynomial) if k > 1)
        slope, _ = mimic.tangent(q[leader])
        v[path], a[path] = slope * v[leader], slope * a[leader] + bend * v[leader] ** 2


def with_closed_loops(robot: Robot, motion: NamedMotion) -> NamedMotion | None:
    """Return a smooth motion of all independent joints in which the loops of the robot are closed at all examined times.

    Without loops, return the motion unchanged. Return None if the loops do not close. As in poses, joints that the motion does not set move
    first. Each search for a closed state begins at the state before it.
    """
    if not robot.closures:
        return motion
    curve, joints = MotionCurve(robot.assembly, motion), joints_of(robot.assembly)
    base_moves = robot.base == "free" and any(closure.hold for closure in robot.closures)
    loops = Loops(robot.bodies, robot.closures, joints, robot.bodies[0].X_PL)
    free = [joint.path for joint in joints if joint.mimic is None]
    times, values, state = curve.samples().tolist(), [], SolverState(q={}, base=loops.base)
    for time in times:
        before = {path: state.q.get(path, 0.0) for path in free}
        start = SolverState(q=coordinates(joints, before | curve.positions(time)), base=state.base)
        solution = close_pose(loops, start, motion.values.keys(), base_moves)
        if not solution.closed:
            return None
        state = solution.state
        values.append([state.q[path] for path in free])
    by_path = dict(zip(free, map(tuple, zip(*values, strict=True)), strict=True))
    return replace(motion, times=tuple(times), values=by_path, smooth=True)

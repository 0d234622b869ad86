"""Compute the poses and Jacobians of the bodies of a robot at given joint positions, in numpy arrays."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from thingc.base.pose import Pose
from thingc.model.assembly.kinematics import balls, coordinates, in_cones, joints_of
from thingc.model.assembly.types import MountAt
from thingc.model.robot.kinematics import in_world, placed_bodies
from thingc.model.robot.loop_solver import Loops, SolverState
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Robot

Array = NDArray[np.float64]

ROUND = np.pi
"""Limit [rad] for joints without limits, in both directions. Such a joint therefore has a range of one turn."""


class NumpyTree:
    """The kinematic tree of a robot, for searches over joint positions in numpy.

    Joints that mimic other joints are not independent coordinates. `paths` contains the paths of the n independent joint coordinates, and
    `lower` and `upper` their limits [rad or m]. The base of the robot is fixed, even if the mode has a floating base.
    """

    def __init__(self, robot: Robot, base: Pose | None = None) -> None:
        self.robot = robot
        self.base = robot.bodies[0].X_PL if base is None else base
        self._loops = loops = Loops(robot.bodies, robot.closures, joints_of(robot.assembly), self.base)
        self.paths = [c.path for c in loops.coordinates]
        self.lower = np.array([max(c.lower, -ROUND) if np.isinf(c.lower) else c.lower for c in loops.coordinates])
        self.upper = np.array([min(c.upper, ROUND) if np.isinf(c.upper) else c.upper for c in loops.coordinates])
        self._column = {path: k for k, path in enumerate(self.paths)}
        self._balls = tuple(balls(joints_of(robot.assembly)))
        self._joints = {joint.path: joint for joint in joints_of(robot.assembly)}
        self._body_of = {body.link: index for index, body in enumerate(robot.bodies)}
        self._in_link = in_link(robot.assembly)

    def x(self, q: Mapping[str, float]) -> Array:
        """Convert a mapping of joint paths to positions [rad or m] to an array (n,) of the independent joint coordinates."""
        return np.array([q[path] for path in self.paths], dtype=np.float64)

    def q(self, x: Array) -> dict[str, float]:
        """Return the positions [rad or m] of all joints by path, including mimic joints.

        `x` (n,) contains the independent joint coordinates.
        """
        free = {path: float(value) for path, value in zip(self.paths, x, strict=True)}
        return coordinates(self._joints.values(), free | in_cones(self._balls, free))

    def cones(self, x: Array) -> tuple[Array, Array]:
        """Return the distance [rad^2] of each of k ball joints from its cone limit, and the derivatives `(k, n)`.

        The distance (k,) is the square of the limit angle minus the square of the current angle. The derivatives are with respect to the
        joint coordinates `x` (n,).
        """
        distances, derivatives = [], []
        for ball in self._balls:
            if ball[0].limit.cone is not None:
                columns = [self._column[joint.path] for joint in ball]
                distances.append(ball[0].limit.cone ** 2 - float(x[columns] @ x[columns]))
                derivatives.append(np.zeros(len(x)))
                derivatives[-1][columns] = -2.0 * x[columns]
        return np.array(distances), np.array(derivatives).reshape(len(distances), len(x))

    def bodies(self, q: Mapping[str, float]) -> tuple[Pose, ...]:
        """Return the pose of every body in the world at the joint positions `q`."""
        return placed_bodies(self.robot.bodies, q, self.base)

    def mount(self, mount: MountAt) -> tuple[int, Pose]:
        """Return the index of the body that contains a mount, and the pose of the mount in the frame of the body."""
        return self._body_of[self.robot.assembly.link_of[mount.occurrence]], self._in_link[mount.occurrence] @ mount.pose

    def jacobian(self, body: int | None, point: Array, q: Mapping[str, float], poses: tuple[Pose, ...]) -> Array:
        """Return the Jacobian `(6, n)` of a point of a body: three rows for the linear velocity, then three rows for the angular velocity.

        `point` (3,) is the position of the point in the world [m]. `body` is the index of the body, or None for the world, whose Jacobian
        is 0. `poses` contains the poses of all bodies at the joint positions `q`.
        """
        x, y, z = (float(coordinate) for coordinate in point)
        J = np.zeros((6, len(self.paths)))
        follows = self._loops.follows(q)
        while body is not None:
            link = self.robot.bodies[body]
            for joint, twist in in_world(link, poses[body], q):
                path, factor = follows[joint.path]
                J[:, self._column[path]] += factor * np.concatenate(twist.velocity((x, y, z)))
            body = link.parent
        return J

    def closure_errors(self, q: Mapping[str, float]) -> tuple[Array, Array]:
        """Return the closure errors of all kinematic loops, and their derivatives with respect to the independent joint coordinates.

        Each loop has six errors in world axes: the translation [m], then the rotation [rad].
        """
        error, columns = self._loops.linearize(SolverState(q=dict(q), base=self.base))
        return np.array(error), np.array(columns, dtype=np.float64).reshape(len(self.paths), -1).T


def quasi_random(count: int, dimensions: int) -> Array:
    """Return `count` evenly distributed points in the unit cube, as an array (count, dimensions).

    The same points are returned in every run. In one dimension, the points are equally spaced from end to end. In more dimensions, the
    corners of the cube come first, if they are at most a quarter of the points. The other points follow the additive recurrence of the
    generalised golden ratio g, which is the root of g**(d + 1) = g + 1. See Roberts, "The unreasonable effectiveness of quasirandom
    sequences", 2018.
    """
    if dimensions == 0:
        return np.zeros((1, 0))
    if dimensions == 1:
        return np.linspace(0.0, 1.0, count)[:, None] if count > 1 else np.array([[0.5]])
    corners = np.zeros((0, dimensions))
    if dimensions < 20 and 2**dimensions <= count // 4:
        corners = np.array([[number >> k & 1 for k in range(dimensions)] for number in range(2**dimensions)], dtype=np.float64)
    golden = 2.0
    for _ in range(64):
        golden = (1.0 + golden) ** (1.0 / (dimensions + 1.0))
    steps = golden ** -np.arange(1.0, dimensions + 1.0)
    inside = (0.5 + np.arange(1, count - len(corners) + 1)[:, None] * steps) % 1.0
    return np.concatenate([corners, inside])

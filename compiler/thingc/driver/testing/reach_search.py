"""Search for the largest distance between two mounts, and for the joint positions that bring a mount closest to a point."""

from __future__ import annotations

import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import NO_POSE, Pose, rotate
from thingc.base.source import Origin
from thingc.documents.checks.point import PointCheck
from thingc.driver.testing.numpy_tree import Array, NumpyTree, quasi_random
from thingc.driver.testing.poses import pose_robot, sweep_poses
from thingc.model.assembly.kinematics import joints_of, on_loops
from thingc.model.assembly.types import MountAt
from thingc.model.resolve.types import JointRange, NamedPose
from thingc.model.robot.types import Keyframe, Robot

SAMPLES = 1000
"""Number of joint positions that are sampled."""
LOOPED = 100
"""Number of joint positions that are sampled for a robot with kinematic loops. Fewer positions are sampled, because closing the loops takes
time.
"""
CLIMBED = 6
"""Number of the best samples that are optimized further."""
STARTS = 24
"""Number of joint positions from which the search for a point starts."""
CLOSED = 1e-6
"""Largest closure error [m or rad] of a joint position that counts as closed."""


def farthest(robot: Robot, mount: MountAt, base: MountAt, origin: Origin) -> tuple[float, dict[str, float]]:
    """Search for the largest distance [m] between two mounts. Return this distance, and the joint positions [rad or m] by path.

    The result is a lower bound of the true maximum. The search evaluates samples over the joint ranges, and optimizes the best samples
    within the joint limits (SLSQP, with closed loops as constraints). `robot` must be in a mode without holds. `origin` is the location in
    the document to which the poses of the search are attributed.
    """
    chain = NumpyTree(robot)
    ends = chain.mount(mount), chain.mount(base)
    best, best_x = -1.0, np.zeros(len(chain.paths))
    starts = [(_distance(chain, ends, x)[0], x) for x in _start_positions(chain, origin)]
    for distance, x in sorted(starts, key=lambda pair: -pair[0])[:CLIMBED]:
        if distance > best:
            best, best_x = distance, x
        optimized = _maximize_distance(chain, ends, x)
        if optimized is not None and optimized[0] > best:
            best, best_x = optimized
    return best, _joints(chain, best_x)


def _start_positions(chain: NumpyTree, origin: Origin) -> list[Array]:
    """Return the joint coordinates (n,) of all positions at which the search starts. All start positions are within the joint limits.

    For a robot with kinematic loops, poses of the document are included, and the loops are closed in all start positions.
    """
    assembly = chain.robot.assembly
    if not chain.robot.closures:
        return [chain.lower + part * (chain.upper - chain.lower) for part in quasi_random(SAMPLES, len(chain.paths))]
    # Only the driven joints of a loop get sampled values. With sampled values for all joints, loops would rarely close.
    loop_joints = on_loops(len(assembly.occurrences), assembly.mates)
    sampled = {joint.path for joint in joints_of(assembly) if joint.path not in loop_joints or joint.actuator is not None}
    sampled |= set() if sampled & loop_joints else {next(path for path in chain.paths if path in loop_joints)}
    ranges = tuple(
        JointRange(joint=path, lower=low, upper=high)
        for path, low, high in zip(chain.paths, chain.lower.tolist(), chain.upper.tolist(), strict=True) if path in sampled
    )
    start = NamedPose(name="reach", values={}, origins={}, origin=origin)
    robot = pose_robot(assembly, chain.robot.mode, [*assembly.poses, *sweep_poses(start, ranges, LOOPED)])
    return [] if robot is None else [chain.x(frame.q) for frame in robot.keyframes]


Ends = tuple[tuple[int, Pose], tuple[int, Pose]]


def _distance(chain: NumpyTree, ends: Ends, x: Array) -> tuple[float, Array]:
    """Return the distance [m] between two mounts, and its derivatives (n,) with respect to the joint coordinates."""
    q = chain.q(x)
    poses = chain.bodies(q)
    first, second = (np.array((poses[body] @ pose).translation) for body, pose in ends)
    distance = float(np.linalg.norm(first - second))
    if distance == 0.0:
        return 0.0, np.zeros(len(x))
    jacobian = chain.jacobian(ends[0][0], first, q, poses)[:3] - chain.jacobian(ends[1][0], second, q, poses)[:3]
    return distance, (first - second) / distance @ jacobian


def _maximize_distance(chain: NumpyTree, ends: Ends, start: Array) -> tuple[float, Array] | None:
    from scipy.optimize import minimize

    def negative_distance(x: Array) -> tuple[float, Array]:
        distance, slope = _distance(chain, ends, x)
        return -distance, -slope

    loops = {"type": "eq", "fun": lambda x: chain.closure_errors(chain.q(x))[0], "jac": lambda x: chain.closure_errors(chain.q(x))[1]}
    constraints = [loops] if chain.robot.closures else []
    if len(chain.cones(start)[0]):
        constraints.append({"type": "ineq", "fun": lambda x: chain.cones(x)[0], "jac": lambda x: chain.cones(x)[1]})
    if not len(start):
        return None
    optimum = minimize(
        negative_distance, start, jac=True, method="SLSQP", bounds=list(zip(chain.lower, chain.upper, strict=True)),
        constraints=constraints, options={"maxiter": 200, "ftol": 1e-12},
    )
    x = chain.x(chain.q(np.clip(np.asarray(optimum.x, dtype=np.float64), chain.lower, chain.upper)))
    if chain.robot.closures and float(np.abs(chain.closure_errors(chain.q(x))[0]).max()) > CLOSED:
        return None
    return _distance(chain, ends, x)[0], x


def nearest(
    robot: Robot, frame: Keyframe, mount: MountAt, seen_from: MountAt | None, check: PointCheck,
) -> tuple[float, float, dict[str, float]] | None:
    """Search for the joint positions in which a mount is closest to the point of a test.

    The point is in the frame of the mount `seen_from`, or of the world if `seen_from` is None. Return the distance [m], the angle [rad]
    between the z axis of the mount and the required direction, and the joint positions by path. Return None if the kinematic loops of the
    robot do not close in any tried position.

    The method is inverse kinematics within the joint limits, by trust-region least squares (scipy's `trf`). The search starts from the
    keyframe, and then from positions spread over the joint ranges, until a result is close enough.
    """
    chain = NumpyTree(robot, frame.base)
    search = _PointSearch(chain, chain.mount(mount), None if seen_from is None else chain.mount(seen_from), check)
    best: tuple[float, float, Array] | None = None
    for start in _point_starts(chain, frame):
        x = search.approach(start)
        distance, angle, closure_error = search.errors_at(x)
        if closure_error > 1e-5:
            continue
        if best is None or max(distance / check.within, angle / check.angle) < max(best[0] / check.within, best[1] / check.angle):
            best = distance, angle, x
        if distance <= check.within and angle <= check.angle:
            break
    return None if best is None else (best[0], best[1], _joints(chain, best[2]))


def _point_starts(chain: NumpyTree, frame: Keyframe) -> list[Array]:
    middle = chain.lower + 0.5 * (chain.upper - chain.lower)
    spread_out = [chain.lower + part * (chain.upper - chain.lower) for part in quasi_random(STARTS, len(chain.paths))]
    return [chain.x(frame.q), middle, *spread_out]


class _PointSearch(FrozenStruct, kw_only=False):
    """A search for the joint positions in which a mount is at a point.

    `mount` is the mount, and `frame` the mount in whose frame the point is given (None: the world). Each is the index of a body, and a pose
    in the frame of this body.
    """

    chain: NumpyTree
    mount: tuple[int, Pose]
    frame: tuple[int, Pose] | None
    check: PointCheck

    def state_at(self, x: Array) -> tuple[dict[str, float], tuple[Pose, ...], tuple[Array, Array], tuple[Array, Array]]:
        """Return the state of the robot at the joint coordinates x (n,).

        The result contains the joint positions by path, the poses of all bodies, the origin and the z axis of the mount, and the point and
        the direction of the goal. All vectors (3,) are in the world.
        """
        q = self.chain.q(x)
        poses = self.chain.bodies(q)
        X_WM, X_WF = poses[self.mount[0]] @ self.mount[1], NO_POSE if self.frame is None else poses[self.frame[0]] @ self.frame[1]
        direction = self.check.direction or (0.0, 0.0, 1.0)
        return q, poses, (np.array(X_WM.translation), np.array(X_WM.rotation)[:, 2]), (
            np.array(X_WF.apply(self.check.point)), np.array(rotate(X_WF.rotation, direction)),
        )

    def residual(self, x: Array) -> Array:
        """Return the errors of the position, the direction and the loops, relative to their tolerances."""
        q, _, (position, axis), (goal, direction) = self.state_at(x)
        parts = [(position - goal) / self.check.within]
        if self.check.direction is not None:
            parts.append((axis - direction) / self.check.angle)
        if self.chain.robot.closures:
            parts.append(self.chain.closure_errors(q)[0] / (0.01 * min(self.check.within, self.check.angle)))
        return np.concatenate(parts)

    def jacobian(self, x: Array) -> Array:
        """Return the derivatives of `residual` with respect to the joint coordinates, an array `(errors, n)`."""
        q, poses, (position, axis), (goal, direction) = self.state_at(x)
        of_mount = self.chain.jacobian(self.mount[0], position, q, poses)
        of_goal = self.chain.jacobian(None if self.frame is None else self.frame[0], goal, q, poses)
        parts = [(of_mount[:3] - of_goal[:3]) / self.check.within]
        if self.check.direction is not None:
            parts.append((np.cross(of_mount[3:].T, axis).T - np.cross(of_goal[3:].T, direction).T) / self.check.angle)
        if self.chain.robot.closures:
            parts.append(self.chain.closure_errors(q)[1] / (0.01 * min(self.check.within, self.check.angle)))
        return np.concatenate(parts)

    def approach(self, start: Array) -> Array:
        """Return the joint coordinates to which the optimization converges from `start`."""
        from scipy.optimize import least_squares

        if not len(start):
            return start
        lower, upper = self.chain.lower, self.chain.upper
        margin = 1e-9 * (upper - lower)
        solution = least_squares(
            self.residual, np.clip(start, lower + margin, upper - margin), jac=self.jacobian, bounds=(lower, upper), xtol=1e-12, ftol=1e-12,
            gtol=1e-12, max_nfev=200,
        )
        return np.asarray(solution.x, dtype=np.float64)

    def errors_at(self, x: Array) -> tuple[float, float, float]:
        """Return the distance [m] from the goal, the angle [rad] from the required direction, and the largest closure error."""
        q, _, (position, axis), (goal, direction) = self.state_at(x)
        angle = 0.0
        if self.check.direction is not None:
            angle = float(np.arctan2(np.linalg.norm(np.cross(axis, direction)), axis @ direction))
        error, _ = self.chain.closure_errors(q)
        return float(np.linalg.norm(position - goal)), angle, float(np.abs(error).max(initial=0.0))


def _joints(chain: NumpyTree, x: Array) -> dict[str, float]:
    """Convert the joint coordinates x (n,) of the search to independent joint positions [rad or m] by path."""
    q = chain.q(x)
    return {path: q[path] for path in chain.paths}

"""Compute static efforts by least squares, for loads that loops, holds and feet on the floor can share in several ways.

The coordinates x of a robot include the six coordinates of a floating base. Q is the load of gravity and springs on the coordinates, and
the columns of N are a basis of the motions that loops and holds allow. The matrix S maps the efforts t of the drives to loads on the
coordinates. The matrix J maps the rates of x to the velocities of the feet, and f are the forces of the floor. The efforts and forces
balance the load if

    N' (Q + S t + J' f) = 0,    every f within the cone |f_t| <= mu f_n of its foot

The cone of a foot with adhesion is moved down its axis by the force of adhesion. The result is the t with the smallest sum of squares of
effort divided by limit. For a robot without feet, this result follows from a pseudo-inverse. With feet, the f are nonnegative sums of the
edges of pyramids within the cones. The problem is then nonnegative least squares with equality constraints. A large weight enforces the
constraints (Haskell and Hanson, "An algorithm for linear least squares problems with equality and nonnegativity constraints", 1981). The
last step keeps the set of used edges and solves the remaining equations exactly.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from thingc.base.memo import Memo
from thingc.base.numeric import hypot, isinf, pi
from thingc.base.pose import Pose, add_scaled, cross
from thingc.model.assembly.kinematics import joints_of, leaders
from thingc.model.robot.loop_solver import Loops, SolverState
from thingc.model.robot.types import Robot
from thingc.model.statics.support import Support, outside, stance
from thingc.model.statics.types import DriveTransmission, Efforts, Topple, answer

Array = NDArray[np.float64]

RANK = 1e-9
"""Singular values below this fraction of the largest singular value are treated as 0."""

EDGES = 16
"""Number of edges of the pyramid that approximates a friction cone. The friction of the pyramid is at most 1 - cos(pi / 16) = 2 % less than
the friction of the cone.
"""

HEAVY = 1e5
"""Weight of the balance equations in least squares, relative to the weight of the efforts."""

MET = 1e-7
"""Tolerance of the balance equations, relative to the load."""


def balance_shared(
    robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose], load: Mapping[str, float], drives: Sequence[DriveTransmission],
    memo: Memo | None = None,
) -> Efforts:
    """Compute the drive efforts for a robot whose loads are shared by kinematic loops, feet or holds.

    `load` maps the paths of coordinates to loads [N m or N].

    For a robot without closures and feet, the result is the same as from `balance_tree`. The base counts as fixed, unless it is free and
    supported by feet or holds. `memo` caches the result.
    """
    loops = Loops(robot.bodies, robot.closures, joints_of(robot.assembly), bodies[0])
    closing = loops.linearize(SolverState(q=dict(q), base=bodies[0]), base_moves=robot.carried)[1]
    paths = [coordinate.path for coordinate in loops.coordinates]
    support = stance(robot, q, bodies) if robot.carried else None
    following = leaders(joints_of(robot.assembly), q) if support is not None else {}
    holds = any(closure.hold for closure in robot.closures)
    place = ("efforts", robot.mode.name)
    return (memo or Memo())(place, balance, paths, closing, load, drives, support, following, loops.length, holds)


def balance(
    paths: Sequence[str], closing: Sequence[Sequence[float]], load: Mapping[str, float], drives: Sequence[DriveTransmission],
    support: Support | None, following: Mapping[str, tuple[str, float, float]], size: float, holds: bool,
) -> Efforts:
    """Compute the drive efforts that balance the loads on the coordinates `paths`.

    `closing` contains the derivatives of the closing conditions of all loops, with one column per coordinate.
    """
    column = {path: k for k, path in enumerate(paths)}
    count = len(paths) + (0 if support is None else 6)
    free = _null_space(np.array(closing, dtype=np.float64).reshape(count, -1).T)
    known, pushed = np.array([load[path] for path in paths]), np.zeros((count, 0))
    if support is not None:
        torque = cross(add_scaled(support.centre, support.origin, -1.0), support.weight)
        known = np.concatenate([known, np.array(support.weight) * size, torque])
        J = list(_feet(following, support, column, size))
        known -= sum((foot.pull * moves[2] for foot, moves in zip(support.feet, J, strict=True)), np.zeros(count))
        pushed = np.hstack([pushed, *(moves.T @ edges(foot.friction).T for foot, moves in zip(support.feet, J, strict=True))])
    weights = np.array([drive.weight for drive in drives])
    moved = np.zeros((count, len(drives)))
    for number, drive in enumerate(drives):
        for path, factor in drive.moves:
            moved[column[path], number] = factor
    shares, forces, choices = _share(free.T @ moved * weights, free.T @ known, free.T @ pushed)
    effort = weights * shares
    residual = np.abs(free @ (free.T @ (known + moved @ effort + pushed @ forces)))
    efforts = {drive.path: float(value) + 0.0 for drive, value in zip(drives, effort, strict=True)}
    worst = int(residual.argmax()) if count else 0
    return answer(
        drives, efforts, float(np.abs(known).max(initial=0.0)), float(residual.max(initial=0.0)),
        paths[worst] if worst < len(paths) else "", choices, fall=None if support is None or holds else _fall(support),
    )


def _feet(following: Mapping[str, tuple[str, float, float]], support: Support, column: Mapping[str, int], size: float) -> Iterator[Array]:
    """Yield the Jacobian (3 x n) of the position [m] of each foot with respect to the coordinates.

    The coordinates are the joints, three translations of the base (in units of `size` [m]), and three rotations of the base about its
    origin.
    """
    for foot in support.feet:
        J = np.zeros((3, len(column) + 6))
        for path, velocity in foot.moves.items():
            leader, factor, _ = following[path]
            J[:, column[leader]] += factor * np.array(velocity)
        x, y, z = np.array(foot.point) - np.array(support.origin)
        J[:, -6:-3] = np.eye(3) * size
        J[:, -3:] = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
        yield J


def _fall(support: Support) -> Topple | None:
    """Return the reason why the floor cannot support the robot, whatever the efforts of its drives. Return None if no reason is found."""
    known = np.concatenate([support.weight, np.cross(np.subtract(support.centre, support.feet[0].point), support.weight)])
    pushed: list[Array] = []
    for foot in support.feet:
        arm = np.subtract(foot.point, support.feet[0].point)
        forces = edges(foot.friction)
        pushed.append(np.hstack([forces, np.cross(arm, forces)]).T)
        known -= np.concatenate([(0.0, 0.0, foot.pull), np.cross(arm, (0.0, 0.0, foot.pull))])
    matrix = np.hstack(pushed)
    _, left = nnls(matrix, -known, maxiter=50 * matrix.shape[1])
    if left <= MET * float(np.linalg.norm(known)):
        return None
    far = outside(support)
    if isinf(far):
        return Topple("pulls" if support.weight[2] > 1e-9 * hypot(*support.weight) else "slides", far)
    return Topple("tips" if far > 0.0 else "slides", far)


def edges(friction: float) -> Array:
    """Return the edges `(n, 3)` of the pyramid inside the friction cone of a foot on the floor. The z component of each edge is 1."""
    if friction == 0.0:
        return np.array([[0.0, 0.0, 1.0]])
    angles = 2.0 * pi * np.arange(EDGES) / EDGES
    return np.stack([friction * np.cos(angles), friction * np.sin(angles), np.ones(EDGES)], axis=1)


def _share(held: Array, known: Array, pushed: Array) -> tuple[Array, Array, int]:
    """Solve `held x + known + pushed y = 0` as far as possible, with the least |x|.

    The vector x contains the drive efforts divided by their weights, and y >= 0 contains the forces along the edges of the pyramids. Return
    x, y and the dimension of the space of solutions.
    """
    left, sizes, right = np.linalg.svd(held) if held.size else (np.eye(len(known)), np.zeros(0), np.eye(held.shape[1]))
    rank = int((sizes > RANK * sizes.max(initial=0.0)).sum())
    inverse = right[:rank].T / sizes[:rank] @ left[:, :rank].T
    rigid = left[:, rank:].T  # the directions in which no drive can balance the load
    y = _forces(rigid @ pushed, rigid @ known, inverse @ pushed, inverse @ known) if pushed.shape[1] else np.zeros(0)
    inner = inverse @ pushed @ _null_space(rigid @ pushed) if pushed.shape[1] else np.zeros((len(inverse), 0))
    open_ = held.shape[1] - rank + (int(np.linalg.matrix_rank(inner, tol=1e-9 * np.abs(inverse @ pushed).max())) if inner.size else 0)
    return -inverse @ (known + pushed @ y), y, open_


def _forces(must: Array, due: Array, costs: Array, before: Array) -> Array:
    """Return the vector y >= 0 with the least |costs y + before| for which `must y + due = 0`."""
    scale = np.abs(due).max(initial=0.0) or 1.0
    y, _ = nnls(np.vstack([HEAVY / scale * must, costs]), -np.concatenate([HEAVY / scale * due, before]), maxiter=50 * must.shape[1])
    used = np.flatnonzero(y > 0.0)
    start = np.linalg.lstsq(must[:, used], -due, rcond=RANK)[0]
    open_ = _null_space(must[:, used])
    exact = start
    if open_.shape[1]:
        exact = start - open_ @ np.linalg.lstsq(costs[:, used] @ open_, costs[:, used] @ start + before, rcond=RANK)[0]
    if exact.min(initial=0.0) >= -MET and np.abs(must[:, used] @ exact + due).max(initial=0.0) <= MET * scale:
        y[used] = np.maximum(exact, 0.0)
    return np.asarray(y)


def _null_space(rows: Array) -> Array:
    """Return an orthonormal basis (n x k) of the null space of the rows (m x n)."""
    if not rows.size:
        return np.eye(rows.shape[1])
    _, sizes, right = np.linalg.svd(rows)
    rank = int((sizes > RANK * max(float(sizes.max(initial=0.0)), 1e-12)).sum())
    return np.asarray(right[rank:].T, dtype=np.float64)

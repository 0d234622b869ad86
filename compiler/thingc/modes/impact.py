"""Compute how the velocity of a robot changes when a mode switch suddenly holds moving links, as in a perfectly inelastic impact."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from thingc.base.one_line_repr import OneLineStruct
from thingc.modes.cut_joints import constraint_projector, coordinates, usual
from thingc.modes.frames import Array, back_substitute, cross, cross_columns, half_solve, inverse, product, projection, smallest_solution
from thingc.modes.kinematics import kinematics
from thingc.modes.state import RobotState, State
from thingc.modes.tree import Cut, Hold, Inertias, Mode


class Impact(OneLineStruct, eq=False):
    """The effect of a mode switch on a link that the new mode holds.

    Attributes:
        removed: The twist (6,) [m/s, rad/s] that the link loses. If the hold allows rotation about the mount, the array contains the
            velocity of the mount's origin, followed by zeros.
        impulse: The impulse (6,) that acts on the link, or 0 without an impact: the linear impulse [N s] in world axes, followed by the
            angular impulse [N m s] about the origin of the link frame in the axes of the link.
    """

    removed: Array
    impulse: Array


def caught(mode: Mode, state: RobotState, inertias: Inertias | None = None) -> tuple[RobotState, Array, Mapping[str, Array]]:
    """Compute the state of a robot after a perfectly inelastic impact, in which all links that `mode` holds stop.

    Also return the impulse (6,) on the root link, and a mapping from the path of each other held mount to the impulse (6,) on its link.
    """
    after, impulse, holds = stop(mode, mode.arrays(state), mode.inertias if inertias is None else inertias, np)
    return mode.robot_state(after), impulse, dict(zip((hold.path for hold in mode.holds), holds, strict=True))


def stop(mode: Mode, state: State[Any], inertias: Inertias, xp: Any, **newton: int) -> tuple[State[Any], Array, list[Array]]:
    """Compute the state after a perfectly inelastic impact, and the impulses (6,) on the root link and on the other held links.

    The velocity of the robot is u = (twist of the base, joint velocities v), and the mode imposes the constraints C u = 0. The constraints
    stop all held links, and also the root link unless the base is free. The constraints also couple each mimic joint to its leading joint,
    and keep kinematic loops closed.

    The impulses p of the constraints change the velocity from u to u'. With the mass matrix M, the equations are `M (u' - u) = C^T p` and
    `C u' = 0`. With a basis N of the allowed velocities, these equations become `u' = N w` and `N^T M N w = N^T M u`. The velocity u' is
    the orthogonal projection of u in the metric M, and therefore the nearest allowed velocity. The impact removes the kinetic energy of the
    velocity difference u - u' (Carnot's theorem). If constraints are redundant, p is the solution with the smallest norm.
    """
    kin = kinematics(mode)
    q = state.q[kin.rows]
    frames = kin.frames(state.base, q, xp)
    poses, jacobians = kin.poses(frames), kin.jacobians(frames, xp)
    u = xp.concatenate([state.twist, state.v[kin.rows]])
    coupling = kin.coupling(q, xp)
    moves = np.eye(6)[:, : 6 if mode.base == "free" else 0] if mode.part is None else mode.part.motions(state.base, xp)
    N = xp.concatenate([coupling[:, :6] @ moves, coupling[:, 6:]], axis=1)
    M = kin.mass_matrix(frames, inertias, xp)
    momenta = M @ N if kin.is_coupled or moves.shape[1] else M[:, 6:]
    reduced = N.T @ momenta if kin.is_coupled or moves.shape[1] else momenta[6:]
    constraints = [_hold_jacobian(hold, poses[hold.link], jacobians[hold.link], xp) for hold in mode.holds]
    constraints += [_ends_meet(mode, poses, cut, jacobians, xp, newton) for cut in mode.cuts]
    C = xp.concatenate([np.zeros((0, len(u))), *constraints])
    # In the coordinates y = U w, the reduced mass matrix is 1, and projections are orthogonal. The constraints are A y = 0.
    U, known = half_solve(reduced, xp.concatenate([(u @ momenta)[:, None], (C @ N).T], axis=1), xp)
    y, A = known[:, 0], known[:, 1:].T
    removed = smallest_solution(A, A @ y, xp) if constraints else 0.0
    w = back_substitute(U, y - removed, xp)
    after = N @ w
    total = M[:6] @ (after - u)
    impulse, others = _impulses(total, moves, constraints, A, removed, xp)
    v = xp.concatenate([after[6:], state.v])[kin.gathered]
    return State(state.base, after[:6], state.q, v), impulse, [
        _at_hold(hold, poses[hold.link], hold_impulse, xp) for hold, hold_impulse in zip(mode.holds, others, strict=False)
    ]


def _impulses(total: Array, moves: Array, constraints: list[Array], A: Array, removed: Any, xp: Any) -> tuple[Array, list[Array]]:
    """Return the impulse (6,) of the base, and the impulse of each constraint, which together change the linear and angular momentum of the
    robot by `total` (6,).

    In the coordinates y of `stop`, the impulses p of the constraints change y by A^T p = -`removed`. The impulse of the base is then
    `total` - B p in the directions that the base constrains. If p is not unique, the sum of the squares of all impulses is the smallest.
    """
    if not constraints:
        return total, []
    C = xp.concatenate(constraints)
    stays = np.eye(6) - projection(moves, xp) if moves.shape[1] else np.eye(6)
    B = product(stays, C[:, :6].T, xp)
    # In the coordinates V p, the sum is the square of the distance from z, plus a constant.
    V, known = half_solve(np.eye(len(C)) + product(B.T, B, xp), xp.concatenate([(B.T @ total)[:, None], A], axis=1), xp)
    z, D = known[:, 0], known[:, 1:].T
    p = back_substitute(V, z - smallest_solution(D, D @ z + removed, xp), xp)
    return stays @ total - B @ p, xp.split(p, np.cumsum([len(rows) for rows in constraints[:-1]]))


def _at_hold(hold: Hold, X: Array, hold_impulse: Array, xp: Any) -> Array:
    """Return the impulse (6,) on a held link with the pose X (4, 4): the linear impulse, then the angular impulse about the link's origin.

    The linear impulse is in world axes, and the angular impulse is in link axes.
    """
    turning = cross(X[:3, :3] @ hold.X_LM[:3, 3], hold_impulse, xp) if hold.turns else hold_impulse[3:]
    impulse: Array = xp.concatenate([hold_impulse[:3], X[:3, :3].T @ turning])
    return impulse


def _hold_jacobian(hold: Hold, X: Array, J: Array, xp: Any) -> Array:
    """Return the Jacobian of the velocity that a hold constrains to zero, for a held link with the pose X (4, 4).

    `J` is the Jacobian (6, n) of the link. If the hold allows rotation, return the Jacobian (3, n) of the mount's origin, otherwise return
    `J`.
    """
    return J[:3] - cross_columns(X[:3, :3] @ hold.X_LM[:3, 3], J[3:], xp) if hold.turns else J


def at_point(hold: Hold, X: Array, twist: Array) -> Array:
    """Return the velocity [m/s] of the origin of a held mount in world axes, followed by three zeros, as an array (6,).

    `X` (4, 4) is the pose of the link. `twist` (6,) is the velocity of the origin of the link frame in world axes, followed by the angular
    velocity of the link in its own axes.
    """
    linear = twist[:3] + cross(X[:3, :3] @ twist[3:], X[:3, :3] @ hold.X_LM[:3, 3])
    return np.concatenate([linear, np.zeros(3)])


def _ends_meet(mode: Mode, poses: Array, cut: Cut, jacobians: Array, xp: Any, newton: dict[str, int]) -> Array:
    """Return the Jacobian (6, n) of the constraint that the two ends of a loop-closing joint stay together."""
    X_WA, X_WB = poses[cut.parent] @ cut.X_PA, poses[cut.child] @ cut.X_CB
    ends = []
    for link in (cut.parent, cut.child):
        J = jacobians[link]
        ends.append(xp.concatenate([J[:3] - cross_columns(X_WB[:3, 3] - poses[link, :3, 3], J[3:], xp), J[3:]]))
    q = coordinates(cut, inverse(X_WA, xp) @ X_WB, usual(mode, cut), xp, **newton) if cut.coordinates else np.zeros(0)
    relative: Array = constraint_projector(cut, q, X_WB, xp) @ (ends[1] - ends[0])
    return relative

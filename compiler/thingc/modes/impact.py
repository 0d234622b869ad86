"""Compute how the velocity of a robot changes when a mode switch suddenly holds moving links, as in a perfectly inelastic impact."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from thingc.base.one_line_repr import OneLineStruct
from thingc.modes.cut_joints import constraint_projector, coordinates, usual
from thingc.modes.frames import Array, cross, cross_columns, inverse, solve_positive
from thingc.modes.kinematics import kinematics, sum_over_links
from thingc.modes.state import RobotState, State
from thingc.modes.tree import Cut, Hold, Inertias, Mode

RANK = 1e-10
"""Singular values that are smaller than this fraction of the largest singular value are treated as 0."""


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
    N = xp.concatenate([
        xp.concatenate([moves, np.zeros((6, coupling.shape[1]))], axis=1),
        xp.concatenate([np.zeros((len(coupling), moves.shape[1])), coupling], axis=1),
    ])
    # The mass matrix of the robot is not needed: the products with N need only the columns of allowed motions.
    motions = jacobians @ N if kin.is_coupled or moves.shape[1] else jacobians[:, :, 6:]
    added = kin.added_inertia(inertias, xp)
    before = kin.momenta(frames, (jacobians @ u)[:, :, None], inertias, xp)
    momenta = kin.momenta(frames, motions, inertias, xp)
    reduced = sum_over_links(motions, momenta) + N.T @ added @ N
    w = solve_positive(reduced, sum_over_links(motions, before)[:, 0] + N.T @ (added @ u), xp)
    constraints = [_hold_jacobian(hold, poses[hold.link], jacobians[hold.link]) for hold in mode.holds]
    constraints += [_ends_meet(mode, poses, cut, jacobians, xp, newton) for cut in mode.cuts]
    if constraints:
        # In the coordinates L^T w, with the Cholesky factor L of the reduced mass matrix, the projection is orthogonal.
        L = xp.linalg.cholesky(reduced)
        A = xp.linalg.solve(L, (xp.concatenate(constraints) @ N).T).T
        w = w - xp.linalg.solve(L.T, xp.linalg.lstsq(A, A @ (L.T @ w), rcond=RANK)[0])
    after = N @ w
    change = sum_over_links(jacobians, (momenta @ w)[:, :, None] - before)[:, 0] + added @ (after - u)
    impulse, holds = _impulses(mode, change, moves, _mimics(mode, q, xp), constraints, xp)
    v = xp.concatenate([after[6:], state.v])[kin.gathered]
    return State(state.base, after[:6], state.q, v), impulse, [
        _at_hold(hold, poses[hold.link], hold_impulse, xp) for hold, hold_impulse in zip(mode.holds, holds, strict=True)
    ]


def _impulses(mode: Mode, change: Array, moves: Array, mimics: Array, constraints: list[Array], xp: Any) -> tuple[Array, list[Array]]:
    """Compute the impulses on the root link and on the other held links from the change of momentum of the robot."""
    if not constraints:
        return change[:6], []
    stays = np.eye(6) - (moves @ xp.linalg.solve(moves.T @ moves, moves.T) if moves.shape[1] else np.zeros((6, 6)))
    C = xp.concatenate([xp.concatenate([stays, np.zeros((6, len(change) - 6))], axis=1), *constraints, mimics])
    impulses = xp.linalg.lstsq(C.T, change, rcond=RANK)[0]
    holds, row = [], 6
    for hold in mode.holds:
        holds.append(impulses[row :][: 3 if hold.turns else 6])
        row += len(holds[-1])
    return stays @ impulses[:6], holds


def _at_hold(hold: Hold, X: Array, hold_impulse: Array, xp: Any) -> Array:
    """Return the impulse (6,) on a held link with the pose X (4, 4): the linear impulse, then the angular impulse about the link's origin.

    The linear impulse is in world axes, and the angular impulse is in link axes.
    """
    turning = cross(X[:3, :3] @ hold.X_LM[:3, 3], hold_impulse) if hold.turns else hold_impulse[3:]
    impulse: Array = xp.concatenate([hold_impulse[:3], X[:3, :3].T @ turning])
    return impulse


def _hold_jacobian(hold: Hold, X: Array, J: Array) -> Array:
    """Return the Jacobian of the velocity that a hold constrains to zero, for a held link with the pose X (4, 4).

    `J` is the Jacobian (6, n) of the link. If the hold allows rotation, return the Jacobian (3, n) of the mount's origin, otherwise return
    `J`.
    """
    return J[:3] - cross_columns(X[:3, :3] @ hold.X_LM[:3, 3], J[3:]) if hold.turns else J


def at_point(hold: Hold, X: Array, twist: Array) -> Array:
    """Return the velocity [m/s] of the origin of a held mount in world axes, followed by three zeros, as an array (6,).

    `X` (4, 4) is the pose of the link. `twist` (6,) is the velocity of the origin of the link frame in world axes, followed by the angular
    velocity of the link in its own axes.
    """
    linear = twist[:3] + cross(X[:3, :3] @ twist[3:], X[:3, :3] @ hold.X_LM[:3, 3])
    return np.concatenate([linear, np.zeros(3)])


def _mimics(mode: Mode, q: Array, xp: Any) -> Array:
    """Return the matrix (r, n) of the constraints of all r mimic joints, whose product with the joint velocities is zero.

    Each row of this matrix computes the velocity of a mimic joint minus the velocity that its leading joint prescribes.
    """
    column = {joint.name: number for number, joint in enumerate(mode.joints)}
    unit = np.eye(6 + len(column))[6:]
    rows = [
        unit[column[joint.name]] - joint.mimic.rate(q[column[joint.mimic.joint]]) * unit[column[joint.mimic.joint]]
        for joint in mode.joints if joint.mimic is not None and joint.mimic.joint in column
    ]
    constraints: Array = xp.asarray(rows).reshape(-1, 6 + len(column))
    return constraints


def _ends_meet(mode: Mode, poses: Array, cut: Cut, jacobians: Array, xp: Any, newton: dict[str, int]) -> Array:
    """Return the Jacobian (6, n) of the constraint that the two ends of a loop-closing joint stay together."""
    X_WA, X_WB = poses[cut.parent] @ cut.X_PA, poses[cut.child] @ cut.X_CB
    ends = []
    for link in (cut.parent, cut.child):
        J = jacobians[link]
        ends.append(xp.concatenate([J[:3] - cross_columns(X_WB[:3, 3] - poses[link, :3, 3], J[3:]), J[3:]]))
    q = coordinates(cut, inverse(X_WA, xp) @ X_WB, usual(mode, cut), xp, **newton) if cut.coordinates else np.zeros(0)
    relative: Array = constraint_projector(cut, q, X_WB, xp) @ (ends[1] - ends[0])
    return relative

"""Compute the velocity of a robot after a perfectly inelastic impact, in which the held links of a mode stop instantly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from thingc.base.one_line_repr import OneLineRepr
from thingc.modes.cut_joints import constrained, coordinates, usual
from thingc.modes.frames import Array, cross, cross_matrix, inverse
from thingc.modes.kinematics import kinematics
from thingc.modes.state import RobotState, State
from thingc.modes.tree import Cut, Hold, Inertias, Mode

RANK = 1e-10
"""Singular values below this fraction of the largest are treated as 0."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Impact(OneLineRepr):
    """The effect of a mode switch on a held link.

    Attributes:
        removed: The removed twist (6,) [m/s, rad/s]. If the hold allows rotation about the mount, this array contains the velocity of the
            mount's origin, followed by zeros.
        impulse: The impulse (6,) of the impact, or 0 without impact: linear [N s] in world axes, and angular [N m s] about the origin of
            the link frame in the axes of the link.
    """

    removed: Array
    impulse: Array


def caught(mode: Mode, state: RobotState, inertias: Inertias | None = None) -> tuple[RobotState, Array, Mapping[str, Array]]:
    """Return the state after a perfectly inelastic impact with all held links of `mode`, and the impulses.

    The second and third return value are the impulse (6,) on the root link, and the impulses on the other holds by the path of the mount.
    """
    after, impulse, holds = stop(mode, mode.arrays(state), mode.inertias if inertias is None else inertias, np)
    return mode.robot_state(after), impulse, dict(zip((hold.path for hold in mode.holds), holds, strict=True))


def stop(mode: Mode, state: State, inertias: Inertias, xp: Any, **newton: int) -> tuple[State, Array, list[Array]]:
    """Return the state after a perfectly inelastic impact, the impulse (6,) on the root link, and the impulses (6,) on the other holds.

    Let C u = 0 be the constraints of the mode on the velocity u = (base twist, v). The root link (unless the base is free) and the held
    links are at rest, the velocity of each mimic joint is determined by its leader, and loops stay closed. The impulses p of the
    constraints change u by `M (u' - u) = C^T p` with C u' = 0. With a basis N of the allowed motions, u' = N w and `N^T M N w = N^T M u`,
    which is the orthogonal projection of u in the metric M. The result is the nearest allowed motion, and the kinetic energy of the
    difference is lost (Carnot's theorem). If constraints are redundant, p is the solution of least norm.
    """
    kin = kinematics(mode)
    q = state.q[kin.rows]
    frames = kin.frames(state.base, q, xp)
    poses, jacobians = frames[kin.of_link], kin.jacobians(frames, xp)
    M = kin.mass_matrix(frames, jacobians, inertias, xp)
    u = xp.concatenate([state.twist, state.v[kin.rows]])
    coupling = kin.coupling(q, xp)
    moves = np.eye(6)[:, : 6 if mode.base == "free" else 0] if mode.part is None else mode.part.motions(state.base, xp)
    N = xp.concatenate([
        xp.concatenate([moves, np.zeros((6, coupling.shape[1]))], axis=1),
        xp.concatenate([np.zeros((len(coupling), moves.shape[1])), coupling], axis=1),
    ])
    reduced = N.T @ M @ N
    w = xp.linalg.solve(reduced, N.T @ (M @ u))
    more = [_held(hold, poses[hold.link], jacobians[hold.link]) for hold in mode.holds]
    more += [_ends_meet(mode, poses, cut, jacobians, xp, newton) for cut in mode.cuts]
    if more:
        # In the coordinates L^T w, with the Cholesky factor L of the reduced mass matrix, the projection is orthogonal.
        L = xp.linalg.cholesky(reduced)
        A = xp.linalg.solve(L, (xp.concatenate(more) @ N).T).T
        w = w - xp.linalg.solve(L.T, xp.linalg.lstsq(A, A @ (L.T @ w), rcond=RANK)[0])
    after = N @ w
    impulse, holds = _impulses(mode, M @ (after - u), moves, _mimics(mode, q, xp), more, xp)
    v = xp.concatenate([after[6:], state.v])[kin.gathered]
    return State(state.base, after[:6], state.q, v), impulse, [
        _at_hold(hold, poses[hold.link], own, xp) for hold, own in zip(mode.holds, holds, strict=True)
    ]


def _impulses(mode: Mode, change: Array, moves: Array, mimics: Array, more: list[Array], xp: Any) -> tuple[Array, list[Array]]:
    """Return the impulses on the root link and at the other holds for a change of momentum."""
    if not more:
        return change[:6], []
    stays = np.eye(6) - (moves @ xp.linalg.solve(moves.T @ moves, moves.T) if moves.shape[1] else np.zeros((6, 6)))
    C = xp.concatenate([xp.concatenate([stays, np.zeros((6, len(change) - 6))], axis=1), *more, mimics])
    impulses = xp.linalg.lstsq(C.T, change, rcond=RANK)[0]
    holds, row = [], 6
    for hold in mode.holds:
        holds.append(impulses[row :][: 3 if hold.turns else 6])
        row += len(holds[-1])
    return stays @ impulses[:6], holds


def _at_hold(hold: Hold, X: Array, own: Array, xp: Any) -> Array:
    """Return the impulse (6,) of a hold for a link at X (4, 4): linear, and angular about the link's origin in the axes of the link."""
    turning = cross(X[:3, :3] @ hold.X_LM[:3, 3], own) if hold.turns else own[3:]
    impulse: Array = xp.concatenate([own[:3], X[:3, :3].T @ turning])
    return impulse


def _held(hold: Hold, X: Array, J: Array) -> Array:
    """Return the velocity constraints of a hold for a link at X (4, 4).

    J is the Jacobian (6, n) of the link. If the hold allows rotation, J is the Jacobian (3, n) of the mount's origin.
    """
    return J[:3] - cross_matrix(X[:3, :3] @ hold.X_LM[:3, 3]) @ J[3:] if hold.turns else J


def at_point(hold: Hold, X: Array, twist: Array) -> Array:
    """Return the velocity [m/s] of the origin of a held mount in world axes, followed by zeros (6,), for a link at X (4, 4).

    `twist` (6,) is the twist of the link: the velocity of its frame's origin in world axes, and the angular velocity in its own axes.
    """
    linear = twist[:3] + cross(X[:3, :3] @ twist[3:], X[:3, :3] @ hold.X_LM[:3, 3])
    return np.concatenate([linear, np.zeros(3)])


def _mimics(mode: Mode, q: Array, xp: Any) -> Array:
    """Return the constraints (r, n) of all mimic joints: v of the joint, minus the multiple of the leader's v, is zero."""
    column = {joint.name: number for number, joint in enumerate(mode.joints)}
    unit = np.eye(6 + len(column))[6:]
    rows = [
        unit[column[joint.name]] - joint.mimic.rate(q[column[joint.mimic.joint]]) * unit[column[joint.mimic.joint]]
        for joint in mode.joints if joint.mimic is not None and joint.mimic.joint in column
    ]
    constraints: Array = xp.asarray(rows).reshape(-1, 6 + len(column))
    return constraints


def _ends_meet(mode: Mode, poses: Array, cut: Cut, jacobians: Array, xp: Any, newton: dict[str, int]) -> Array:
    """Return the relative velocity (6, n) of the ends of a cut joint in its constrained directions."""
    X_WA, X_WB = poses[cut.parent] @ cut.X_PA, poses[cut.child] @ cut.X_CB
    ends = []
    for link in (cut.parent, cut.child):
        J = jacobians[link]
        ends.append(xp.concatenate([J[:3] - cross_matrix(X_WB[:3, 3] - poses[link, :3, 3]) @ J[3:], J[3:]]))
    q = coordinates(cut, inverse(X_WA, xp) @ X_WB, usual(mode, cut), xp, **newton) if cut.coordinates else np.zeros(0)
    relative: Array = constrained(cut, q, X_WB, xp) @ (ends[1] - ends[0])
    return relative

"""Perfectly inelastic impact: compute the velocity of a robot after the held links of a mode stop instantly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from thingc.base.one_line_repr import OneLineRepr
from thingc.modes.cut_joints import coordinates, freedoms, usual
from thingc.modes.frames import Array, cross_matrix, inverse
from thingc.modes.state import RobotState
from thingc.modes.tree import Cut, Hold, Inertias, Mode


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Impact(OneLineRepr):
    """The effect of a switch on a held link.

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

    Let C u = 0 be the constraints of the mode on the velocity u = (base twist, v). The root link (unless the base is free) and the held
    links are at rest, the velocity of each mimic joint is determined by its leader, and loops stay closed. The impulses p of the
    constraints change u by `M (u' - u) = C^T p` with C u' = 0. With a basis N of the allowed motions, u' = N w and `N^T M N w = N^T M u`,
    which is the orthogonal projection of u in the metric M. The result is the nearest allowed motion, and the kinetic energy of the
    difference is lost (Carnot's theorem). If constraints are redundant, p is the solution of least norm.
    """
    M = mode.mass_matrix(state, inertias)
    u = mode.velocity(state)
    N, C = _allowed(mode, state)
    after = N @ np.linalg.solve(N.T @ M @ N, N.T @ (M @ u)) if N.shape[1] else np.zeros_like(u)
    impulses = np.asarray(np.linalg.lstsq(C.T, M @ (after - u), rcond=None)[0], dtype=np.float64)
    held, row = _base(mode, state)[1], 0
    row += len(held)
    placed = mode.poses(state)
    holds = {}
    for hold in mode.holds:
        X = placed[mode.links[hold.link].name]
        size = 3 if hold.turns else 6
        own = impulses[row :][:size]
        turning = np.cross(X[:3, :3] @ hold.X_LM[:3, 3], own) if hold.turns else own[3:]
        holds[hold.path] = np.concatenate([own[:3], X[:3, :3].T @ turning])
        row += size
    stopped = replace(state, base_twist=after[:6], v={joint.name: value for joint, value in zip(mode.joints, after[6:], strict=True)})
    impulse: Array = held.T @ impulses[: len(held)]
    return stopped, impulse, holds


def _allowed(mode: Mode, state: RobotState) -> tuple[Array, Array]:
    """Return a basis (n, k) of the velocities that the mode allows, and its constraints (r, n): root link, holds, mimics and loops."""
    n = 6 + len(mode.joints)
    moves, stays = _base(mode, state)
    base = np.hstack([stays, np.zeros((len(stays), n - 6))])
    jacobians = mode.jacobians(state)
    placed = list(mode.poses(state).values())
    holds = [_held(hold, placed[hold.link], jacobians[hold.link]) for hold in mode.holds]
    loops = [_ends_meet(mode, state, cut, jacobians) for cut in mode.cuts]
    coupling = mode.coupling(state.q)
    free = moves.shape[1]
    N = np.zeros((n, free + coupling.shape[1]))
    N[:6, :free], N[6:, free:] = moves, coupling
    if holds or loops:
        N = N @ _null_space(np.vstack([*holds, *loops]) @ N)
    return N, np.vstack([base, *holds, _mimics(mode, state), *loops])


def _base(mode: Mode, state: RobotState) -> tuple[Array, Array]:
    """Return a basis (6, k) of the allowed twists of the root link, and the constraints (6 - k, 6) on its twist."""
    if mode.base == "free":
        return np.eye(6), np.zeros((0, 6))
    if mode.part is None:
        return np.zeros((6, 0)), np.eye(6)
    moves = mode.part.motions(state.base_pose)
    return moves, _null_space(moves.T).T


def _held(hold: Hold, X: Array, J: Array) -> Array:
    """Return the velocity constraints of a hold for a link at X (4, 4).

    J is the Jacobian (6, n) of the link. If the hold allows rotation, J is the Jacobian (3, n) of the mount's origin.
    """
    return J[:3] - cross_matrix(X[:3, :3] @ hold.X_LM[:3, 3]) @ J[3:] if hold.turns else J


def at_point(hold: Hold, X: Array, twist: Array) -> Array:
    """Return the velocity [m/s] of the origin of a held mount in world axes, followed by zeros (6,), for a link at X (4, 4).

    `twist` (6,) is the twist of the link: the velocity of its frame's origin in world axes, and the angular velocity in its own axes.
    """
    linear = twist[:3] + np.cross(X[:3, :3] @ twist[3:], X[:3, :3] @ hold.X_LM[:3, 3])
    return np.concatenate([linear, np.zeros(3)])


def _mimics(mode: Mode, state: RobotState) -> Array:
    """Return the constraints (r, n) of all mimic joints: v of the joint, minus the multiple of the leader's v, is zero."""
    column = {joint.name: 6 + number for number, joint in enumerate(mode.joints)}
    followers = [joint for joint in mode.joints if joint.mimic is not None and joint.mimic.joint in column]
    rows = np.zeros((len(followers), 6 + len(column)))
    for row, joint in zip(rows, followers, strict=True):
        if joint.mimic is not None:
            row[column[joint.name]], row[column[joint.mimic.joint]] = 1.0, -joint.mimic.rate(state.q[joint.mimic.joint])
    return rows


def _ends_meet(mode: Mode, state: RobotState, cut: Cut, jacobians: tuple[Array, ...]) -> Array:
    """Return the relative velocity (6 - d, n) of the ends of a cut joint in its constrained directions."""
    placed = list(mode.poses(state).values())
    X_WA, X_WB = placed[cut.parent] @ cut.X_PA, placed[cut.child] @ cut.X_CB
    ends = []
    for link in (cut.parent, cut.child):
        J = jacobians[link].copy()
        J[:3] -= cross_matrix(X_WB[:3, 3] - placed[link][:3, 3]) @ J[3:]
        ends.append(J)
    relative: Array = ends[1] - ends[0]
    if not cut.coordinates:
        return relative
    q = coordinates(cut, inverse(X_WA) @ X_WB, usual(mode, cut))
    return _null_space(freedoms(cut, q, X_WB)).T @ relative


def _null_space(A: Array) -> Array:
    """Return an orthonormal basis (columns) of the null space of A (r, k). Singular values below 1e-10 of the largest are treated as 0."""
    _, values, Vt = np.linalg.svd(A)
    rank = int(np.sum(values > 1e-10 * values.max(initial=0.0)))
    basis: Array = Vt[rank:].T
    return basis

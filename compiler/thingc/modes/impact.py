"""A perfectly inelastic impact: the velocity of a robot after the held links of a mode stop instantly."""

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

    `removed` (6,) is the twist [m/s, rad/s] that was removed; for a hold that lets the link turn about the mount, the velocity of the
    mount's origin, and 0. `impulse` (6,) is the impulse of an inelastic impact (0 without one): linear [N s] in world axes, angular [N m s]
    about the link frame's origin in its own axes.
    """

    removed: Array
    impulse: Array


def caught(mode: Mode, state: RobotState, inertias: Inertias | None = None) -> tuple[RobotState, Array, Mapping[str, Array]]:
    """Return the state after a perfectly inelastic impact with all held links of `mode`, and the impulses.

    These are the impulse (6,) on the root link, and those on its holds by path.

    Let C u = 0 be the constraints of the mode on the velocity u = (base twist, v): root link (unless free) and held links stand still,
    mimic joints follow their leaders, loops stay closed. Their impulses p change u by `M (u' - u) = C^T p` with C u' = 0. With a basis N of
    the allowed motions, u' = N w and `N^T M N w = N^T M u`: the projection of u that is orthogonal in the metric M. It is the nearest
    allowed motion, and loses the kinetic energy of the difference (Carnot's theorem). If constraints are redundant, p is the solution of
    least norm.
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
    """Return (n, k), a basis of the velocities that the mode allows, and (r, n), the constraints: root link, holds, mimics, loops."""
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
    """Return (6, k), a basis of the twists that the root link can have, and (6 - k, 6), the constraints on its twist."""
    if mode.base == "free":
        return np.eye(6), np.zeros((0, 6))
    if mode.part is None:
        return np.zeros((6, 0)), np.eye(6)
    moves = mode.part.motions(state.base_pose)
    return moves, _null_space(moves.T).T


def _held(hold: Hold, X: Array, J: Array) -> Array:
    """Return the velocity constraints of a hold for a link at X (4, 4) with the Jacobian J (6, n).

    J is that of the link, or (3, n) of the origin of a mount that may turn.
    """
    return J[:3] - cross_matrix(X[:3, :3] @ hold.X_LM[:3, 3]) @ J[3:] if hold.turns else J


def at_point(hold: Hold, X: Array, twist: Array) -> Array:
    """Return (6,): the velocity [m/s] of the origin of a held mount in world axes, and zeros, for a link at X (4, 4).

    `twist` (6,) is the link's: velocity of its frame's origin in world axes, angular velocity in its own axes.
    """
    linear = twist[:3] + np.cross(X[:3, :3] @ twist[3:], X[:3, :3] @ hold.X_LM[:3, 3])
    return np.concatenate([linear, np.zeros(3)])


def _mimics(mode: Mode, state: RobotState) -> Array:
    """Return (r, n): the constraints of all joints that follow a joint of the tree: v minus the multiple of the leader's v."""
    column = {joint.name: 6 + number for number, joint in enumerate(mode.joints)}
    followers = [joint for joint in mode.joints if joint.mimic is not None and joint.mimic.joint in column]
    rows = np.zeros((len(followers), 6 + len(column)))
    for row, joint in zip(rows, followers, strict=True):
        if joint.mimic is not None:
            row[column[joint.name]], row[column[joint.mimic.joint]] = 1.0, -joint.mimic.rate(state.q[joint.mimic.joint])
    return rows


def _ends_meet(mode: Mode, state: RobotState, cut: Cut, jacobians: tuple[Array, ...]) -> Array:
    """Return (6 - d, n): the relative velocity of the ends of a cut joint, in the constrained directions of the joint."""
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
    """Return an orthonormal basis (columns) of the null space of A (r, k); singular values below 1e-10 of the largest count as 0."""
    _, values, Vt = np.linalg.svd(A)
    rank = int(np.sum(values > 1e-10 * values.max(initial=0.0)))
    basis: Array = Vt[rank:].T
    return basis

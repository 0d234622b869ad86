"""A perfectly inelastic catch: the velocity of a robot after the links that a mode holds have been stopped at once."""

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
    """What became of a link that is held: `removed` (6,) is the twist [m/s, rad/s] that it could not keep (where it may turn about
    its mount the velocity of the mount's origin, and no turn), `impulse` (6,) what an inelastic catch took: linear [N s] in world
    axes, angular [N m s] about its frame's origin in its own axes (0 without one)."""

    removed: Array
    impulse: Array


def caught(mode: Mode, state: RobotState, inertias: Inertias | None = None) -> tuple[RobotState, Array, Mapping[str, Array]]:
    """The state after a catch of everything that `mode` holds, the impulse (6,) on the root link, and those on its holds by path.

    Let C u = 0 say of the velocity u = (base twist, v) what the mode allows: a root link that is not free stands, so do the links
    of holds; joints that mimic keep to their leaders, and loops stay closed. The impulses p of these constraints change u by
    `M (u' - u) = C^T p` with C u' = 0. With N a basis of the motions that C allows, u' = N w and `N^T M N w = N^T M u`: the
    projection of u on them orthogonal in the metric M. Of all allowed motions it is the nearest, and it loses the kinetic energy
    of the difference (Carnot's theorem). Where holds and loops say more than is needed, p is the smallest that does it.
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
    stopped = replace(
        state, base_twist=after[:6], v={joint.name: value for joint, value in zip(mode.joints, after[6:], strict=True)}
    )
    impulse: Array = held.T @ impulses[: len(held)]
    return stopped, impulse, holds


def _allowed(mode: Mode, state: RobotState) -> tuple[Array, Array]:
    """(n, k): a basis of the velocities that the mode allows; (r, n): the constraints, root link and holds first."""
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
    """(6, k) a basis of the twists that the root link may have, and (6 - k, 6) what of a twist has to be 0."""
    if mode.base == "free":
        return np.eye(6), np.zeros((0, 6))
    if mode.part is None:
        return np.zeros((6, 0)), np.eye(6)
    moves = mode.part.motions(state.base_pose)
    return moves, _null_space(moves.T).T


def _held(hold: Hold, X: Array, J: Array) -> Array:
    """What must not move of a link at X (4, 4) with the Jacobian J (6, n): the link, or (3, n) the origin of a mount that may turn."""
    return J[:3] - cross_matrix(X[:3, :3] @ hold.X_LM[:3, 3]) @ J[3:] if hold.turns else J


def at_point(hold: Hold, X: Array, twist: Array) -> Array:
    """(6,): the velocity [m/s] of the origin of a held mount, in world axes, and zeros, of a link at X (4, 4) that moves with a twist
    (6,) of its frame's origin in world axes and about its own."""
    linear = twist[:3] + np.cross(X[:3, :3] @ twist[3:], X[:3, :3] @ hold.X_LM[:3, 3])
    return np.concatenate([linear, np.zeros(3)])


def _mimics(mode: Mode, state: RobotState) -> Array:
    """(r, n): v less the multiple of its leader's, for every joint that follows one of the tree."""
    column = {joint.name: 6 + number for number, joint in enumerate(mode.joints)}
    followers = [joint for joint in mode.joints if joint.mimic is not None and joint.mimic.joint in column]
    rows = np.zeros((len(followers), 6 + len(column)))
    for row, joint in zip(rows, followers, strict=True):
        if joint.mimic is not None:
            row[column[joint.name]], row[column[joint.mimic.joint]] = 1.0, -joint.mimic.rate(state.q[joint.mimic.joint])
    return rows


def _ends_meet(mode: Mode, state: RobotState, cut: Cut, jacobians: tuple[Array, ...]) -> Array:
    """(6 - d, n): the velocity of one end of a cut joint relative to the other, along what it does not leave open."""
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
    """An orthonormal basis (columns) of what A (r, k) maps to nothing; singular values below 1e-10 of the largest count as 0."""
    _, values, Vt = np.linalg.svd(A)
    rank = int(np.sum(values > 1e-10 * values.max(initial=0.0)))
    basis: Array = Vt[rank:].T
    return basis

"""Convert the state of a robot from one mode to another. The argument `xp` selects the array module, `numpy` or `jax.numpy`."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from thingc.modes.cut_joints import coordinates, usual, velocities
from thingc.modes.frames import Array, cross, inverse, pose
from thingc.modes.kinematics import kinematics
from thingc.modes.state import State
from thingc.modes.tree import Cut, Mode


def change_root(state: State[Any], old: Mode, new: Mode, xp: Any, **newton: int) -> State[Any]:
    """Convert a state from the mode `old` to the mode `new` without changing the motion of any link.

    The returned state contains the pose and the twist of the root link of `new`. For joints that `old` cuts, the coordinates are computed
    from the motion of the two links that the joint connects. `newton` contains further keyword arguments for the function `coordinates`.
    """
    kin = kinematics(old)
    poses, twists = kin.link_motion(state, xp)
    q, v = state.q, state.v
    cuts = [cut for cut in old.cuts if cut.coordinates]
    if cuts:
        cut_values = [_across(old, cut, poses, twists, xp, newton) for cut in cuts]
        rows, (cut_q, cut_v) = _gather_indices(old), zip(*cut_values, strict=True)
        q, v = xp.concatenate([q, *cut_q])[rows], xp.concatenate([v, *cut_v])[rows]
    root = kin.number[new.root_link]
    return State(poses[root], twists[root], q, v)


@lru_cache(maxsize=256)
def _gather_indices(mode: Mode) -> Array:
    """For each joint coordinate, return its index in an array that contains all coordinates and then the coordinates of the cut joints."""
    names = [*mode.coordinates, *(name for cut in mode.cuts for name in cut.coordinates)]
    last = {name: row for row, name in enumerate(names)}
    return np.array([last[name] for name in mode.coordinates], dtype=int)


def _across(mode: Mode, cut: Cut, poses: Array, twists: Array, xp: Any, newton: dict[str, int]) -> tuple[Array, Array]:
    """Compute the coordinates and velocities of a loop-closing joint from the motion of the two links that it connects.

    Each angle differs from its value in the first pose of the mode by at most half a turn.
    """
    X_WA, X_WB = poses[cut.parent] @ cut.X_PA, poses[cut.child] @ cut.X_CB
    q = coordinates(cut, inverse(X_WA, xp) @ X_WB, usual(mode, cut), xp, **newton)
    ends = []
    for link in (cut.parent, cut.child):
        spin = poses[link, :3, :3] @ twists[link, 3:]
        ends.append(xp.concatenate([twists[link, :3] + cross(spin, X_WB[:3, 3] - poses[link, :3, 3], xp), spin]))
    return q, velocities(cut, q, X_WB, ends[1] - ends[0], xp)


def put_base(state: State[Any], mode: Mode, place: Array | None, xp: Any) -> tuple[State[Any], list[tuple[int, Array, Array]]]:
    """Return a copy of the state in which the root link is at a pose that the mode allows.

    `place` is the pose of a fixed base, or None for its pose at the time of the build. Also return a list of links that must already be
    near a required pose. Each list item contains the index of the link, its pose, and the pose that the mode requires.
    """
    if mode.base in ("free", "held"):
        return state, []
    required = mode.part.nearest(state.base, xp) if mode.part is not None else mode.X_world_root if place is None else place
    placed = [(0, state.base, required)]
    if mode.base == "fixed" and mode.holds:
        kin = kinematics(mode)
        poses = kin.poses(kin.frames(state.base, state.q[kin.rows], xp))
        for hold in mode.holds:
            X = poses[hold.link]
            X_WM = pose(X[:3, :3] @ hold.X_LM[:3, :3], hold.X_WM[:3, 3], xp) if hold.turns else hold.X_WM
            placed.append((hold.link, X, X_WM @ inverse(hold.X_LM)))
    return state._replace(base=required), placed


def keep_free_twist(mode: Mode, base: Array, twist: Array, xp: Any) -> Array:
    """Return the twist (6,) of the root link without the components that the base of the mode constrains."""
    if mode.base == "free":
        return twist
    if mode.part is None:
        return xp.zeros(6)  # type: ignore[no-any-return]
    return mode.part.twist(base, mode.part.qvel(base, twist, xp), xp)

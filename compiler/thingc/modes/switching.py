"""Switch between modes in arrays, with numpy or JAX (`xp`)."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from thingc.modes.cut_joints import coordinates, usual, velocities
from thingc.modes.frames import Array, cross, inverse, pose
from thingc.modes.kinematics import kinematics
from thingc.modes.state import State
from thingc.modes.tree import Cut, Mode


def change_root(state: State, old: Mode, new: Mode, xp: Any, **newton: int) -> State:
    """Return the same motion relative to the root link of `new`.

    Coordinates of joints that are cut in `old` are computed from the motion of their ends. `newton` are arguments of `coordinates`.
    """
    kin = kinematics(old)
    frames = kin.frames(state.base, state.q[kin.rows], xp)
    twists = kin.twists(frames, xp.concatenate([state.twist, state.v[kin.rows]]), xp)
    poses = frames[kin.of_link]
    q, v = state.q, state.v
    cuts = [cut for cut in old.cuts if cut.coordinates]
    if cuts:
        found = [_across(old, cut, poses, twists, xp, newton) for cut in cuts]
        q, v = (xp.concatenate([own, *values])[_gathered(old)] for own, values in zip((q, v), zip(*found, strict=True), strict=True))
    root = kin.number[new.root_link]
    return State(poses[root], twists[root], q, v)


@lru_cache(maxsize=256)
def _gathered(mode: Mode) -> Array:
    """Return the index of each coordinate in the values of all coordinates, followed by those of the joints that are cut."""
    names = [*mode.coordinates, *(name for cut in mode.cuts for name in cut.coordinates)]
    last = {name: row for row, name in enumerate(names)}
    return np.array([last[name] for name in mode.coordinates], dtype=int)


def _across(mode: Mode, cut: Cut, poses: Array, twists: Array, xp: Any, newton: dict[str, int]) -> tuple[Array, Array]:
    """Compute (q, v) of a cut joint from the motion of its ends. Angles differ from the mode's first pose by at most half a turn."""
    X_WA, X_WB = poses[cut.parent] @ cut.X_PA, poses[cut.child] @ cut.X_CB
    q = coordinates(cut, inverse(X_WA, xp) @ X_WB, usual(mode, cut), xp, **newton)
    ends = []
    for link in (cut.parent, cut.child):
        spin = poses[link, :3, :3] @ twists[link, 3:]
        ends.append(xp.concatenate([twists[link, :3] + cross(spin, X_WB[:3, 3] - poses[link, :3, 3]), spin]))
    return q, velocities(cut, q, X_WB, ends[1] - ends[0], xp)


def put_base(state: State, mode: Mode, place: Array | None, xp: Any) -> tuple[State, list[tuple[int, Array, Array]]]:
    """Return the state with the base at a pose that `mode` allows, which is `place` for a fixed base (None: as in the build).

    Also return the links that must have been near such poses: the link, its pose, and the pose that the mode requires.
    """
    if mode.base in ("free", "held"):
        return state, []
    there = mode.part.nearest(state.base, xp) if mode.part is not None else mode.X_world_root if place is None else place
    placed = [(0, state.base, there)]
    if mode.base == "fixed" and mode.holds:
        kin = kinematics(mode)
        poses = kin.frames(state.base, state.q[kin.rows], xp)[kin.of_link]
        for hold in mode.holds:
            X = poses[hold.link]
            X_WM = pose(X[:3, :3] @ hold.X_LM[:3, :3], hold.X_WM[:3, 3], xp) if hold.turns else hold.X_WM
            placed.append((hold.link, X, X_WM @ inverse(hold.X_LM)))
    return state._replace(base=there), placed


def kept(mode: Mode, base: Array, twist: Array, xp: Any) -> Array:
    """Return the part (6,) of the root link's twist that the base of `mode` allows."""
    if mode.base == "free":
        return twist
    if mode.part is None:
        nothing: Array = xp.zeros(6)
        return nothing
    return mode.part.twist(base, mode.part.qvel(base, twist, xp), xp)

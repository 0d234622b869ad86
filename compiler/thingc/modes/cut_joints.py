"""Joints that a mode's tree leaves out: their coordinates, from how their ends lie and move."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from thingc.modes.frames import Array, adjoint, exponential, inverse, logarithm, rotation_vector
from thingc.modes.tree import Cut, Mode

STEPS = 50
"""Of Newton's method; a joint of one coordinate needs one."""


def coordinates(cut: Cut, X_AB: Array, usual: Sequence[float]) -> Array:
    """q (n,) of a cut joint whose ends A and B lie like this (4, 4), nearest to its `usual` values: turns within half a turn of them."""
    if cut.kind == "ball":
        return rotation_vector(X_AB[:3, :3])
    q = np.array(usual, dtype=float)
    for k, twist in enumerate(cut.twists):
        pitch = float(twist[:3] @ twist[3:])
        if pitch != 0.0:  # how far a screw has gone tells its turns apart
            turns = float(twist[:3] @ X_AB[:3, 3]) / pitch
            q[k] += math.tau * round((turns - q[k]) / math.tau)
    for _ in range(STEPS):
        moved, seen = _moved(cut, q)
        step = np.linalg.lstsq(seen.T, logarithm(inverse(moved) @ X_AB), rcond=None)[0]
        q += step
        if not np.any(np.abs(step) > 1e-14):
            break
    return q


def usual(mode: Mode, cut: Cut) -> list[float]:
    """The values of its coordinates in the mode's first pose."""
    first: Mapping[str, float] = next(iter(mode.named.values()), {})
    return [first.get(name, 0.0) for name in cut.coordinates]


def freedoms(cut: Cut, q: Array, X_WB: Array) -> Array:
    """(n, 6): how end B, at X_WB (4, 4), may move against A at q (n,): velocity of its origin over angular velocity, in world axes, per
    unit of each coordinate."""
    if cut.kind == "ball":  # its v is the child's rate in its own axes
        return np.hstack([np.zeros((3, 3)), X_WB[:3, :3].T])
    _, seen = _moved(cut, q)
    R = X_WB[:3, :3]
    return np.hstack([seen[:, 3:] @ R.T, seen[:, :3] @ R.T])


def _moved(cut: Cut, q: Array) -> tuple[Array, Array]:
    """Where the coordinates take A (4, 4), and their twists (n, 6) as seen from there."""
    X, seen = np.eye(4), np.zeros((len(q), 6))
    for k in range(len(q) - 1, -1, -1):
        seen[k] = adjoint(inverse(X)) @ cut.twists[k]
        X = exponential(cut.twists[k], q[k]) @ X
    return X, seen

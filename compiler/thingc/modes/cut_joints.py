"""Coordinates of joints outside the tree of a mode, computed from the poses and twists of the two ends."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from thingc.modes.frames import Array, adjoint, exponential, inverse, logarithm, rotation_vector
from thingc.modes.tree import Cut, Mode

STEPS = 50
"""Maximum number of iterations of Newton's method. A joint with one coordinate needs one iteration."""


def coordinates(cut: Cut, X_AB: Array, usual: Sequence[float]) -> Array:
    """Return q (n,) of a cut joint with the relative pose `X_AB` (4, 4) of its ends.

    Each returned angle differs from the corresponding value in `usual` by at most half a turn.
    """
    if cut.kind == "ball":
        return rotation_vector(X_AB[:3, :3])
    q = np.array(usual, dtype=float)
    for k, twist in enumerate(cut.twists):
        pitch = float(twist[:3] @ twist[3:])
        if pitch != 0.0:  # the translation of a screw determines the number of turns
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
    """Return the values of the joint's coordinates in the first pose of the mode."""
    first: Mapping[str, float] = next(iter(mode.named.values()), {})
    return [first.get(name, 0.0) for name in cut.coordinates]


def freedoms(cut: Cut, q: Array, X_WB: Array) -> Array:
    """Return the velocity (6, n) of end B relative to A per unit of each coordinate, for end B at X_WB (4, 4) and coordinates q (n,).

    The first three rows are the velocity of B's origin, and the last three the angular velocity, all in world axes.
    """
    if cut.kind == "ball":  # v is the angular velocity of the child in its own axes
        return np.hstack([np.zeros((3, 3)), X_WB[:3, :3].T])
    _, seen = _moved(cut, q)
    R = X_WB[:3, :3]
    return np.hstack([seen[:, 3:] @ R.T, seen[:, :3] @ R.T])


def _moved(cut: Cut, q: Array) -> tuple[Array, Array]:
    """Return the pose (4, 4) of A after the motion by the coordinates, and the twists (n, 6) of the coordinates in this frame."""
    X, seen = np.eye(4), np.zeros((len(q), 6))
    for k in range(len(q) - 1, -1, -1):
        seen[k] = adjoint(inverse(X)) @ cut.twists[k]
        X = exponential(cut.twists[k], q[k]) @ X
    return X, seen

"""Compute the coordinates of joints outside the tree of a mode from the poses and twists of their two ends."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from thingc.modes.frames import Array, exponential, generators, inverse, logarithm, moved_twist, rotation_vector
from thingc.modes.tree import Cut, Mode

STEPS = 50
"""Maximum number of iterations of Newton's method. A joint with one coordinate needs one iteration if its loop is closed."""


def coordinates(cut: Cut, X_AB: Array, usual: Array, xp: Any = np, steps: int = STEPS) -> Array:
    """Return q (n,) of a cut joint with the relative pose `X_AB` (4, 4) of its ends.

    Each returned angle differs from the corresponding value in `usual` by at most half a turn. numpy stops when the iteration has
    converged; JAX always makes `steps` iterations.
    """
    if cut.kind == "ball":
        return rotation_vector(X_AB[:3, :3], xp)
    q: Array = xp.asarray(usual)
    for k, twist in enumerate(cut.twists):
        pitch = float(twist[:3] @ twist[3:])
        if pitch != 0.0:  # the translation of a screw determines the number of turns
            turns = twist[:3] @ X_AB[:3, 3] / pitch
            q = q + math.tau * xp.round((turns - q[k]) / math.tau) * np.eye(len(usual))[k]
    for _ in range(steps):
        moved, seen = _moved(cut, q, xp)
        step = _nearest(seen.T, logarithm(inverse(moved, xp) @ X_AB, xp), xp)
        q = q + step
        if xp is np and not np.any(np.abs(step) > 1e-14):
            break
    return q


def usual(mode: Mode, cut: Cut) -> Array:
    """Return the coordinates of a cut joint in the first pose of the mode."""
    first: Mapping[str, float] = next(iter(mode.named.values()), {})
    return np.array([first.get(name, 0.0) for name in cut.coordinates])


def velocities(cut: Cut, q: Array, X_WB: Array, relative: Array, xp: Any = np) -> Array:
    """Return v (n,) of a cut joint whose end B moves relative to A with the velocity `relative` (6,) (see `freedoms`)."""
    return _nearest(freedoms(cut, q, X_WB, xp), relative, xp)


def freedoms(cut: Cut, q: Array, X_WB: Array, xp: Any = np) -> Array:
    """Return the velocity (6, n) of end B relative to A per unit of each coordinate, for end B at X_WB (4, 4) and coordinates q (n,).

    The first three rows are the velocity of B's origin, and the last three the angular velocity, all in world axes.
    """
    R = X_WB[:3, :3]
    if cut.kind == "ball":  # v is the angular velocity of the child in its own axes
        own: Array = xp.concatenate([np.zeros((3, 3)), R])
        return own
    _, seen = _moved(cut, q, xp)
    both: Array = xp.concatenate([R @ seen[:, 3:].T, R @ seen[:, :3].T])
    return both


def constrained(cut: Cut, q: Array, X_WB: Array, xp: Any = np) -> Array:
    """Return the orthogonal projection (6, 6) of a relative velocity (see `freedoms`) on the directions that the joint constrains."""
    if not cut.coordinates:
        return np.eye(6)
    F = freedoms(cut, q, X_WB, xp)
    projection: Array = np.eye(6) - F @ xp.linalg.solve(F.T @ F, F.T)
    return projection


def _nearest(A: Array, b: Array, xp: Any) -> Array:
    """Return x (n,) with the least |A x - b|. The columns of A (6, n) are independent."""
    x: Array = xp.linalg.solve(A.T @ A, A.T @ b)
    return x


@lru_cache(maxsize=256)
def _generators(cut: Cut) -> Array:
    return np.array([generators(twist) for twist in cut.twists])


def _moved(cut: Cut, q: Array, xp: Any) -> tuple[Array, Array]:
    """Return the pose (4, 4) of A after the motion by the coordinates, and the twists (n, 6) of the coordinates in this frame."""
    X, seen = np.eye(4), []
    for k in range(len(cut.twists) - 1, -1, -1):
        seen.append(moved_twist(inverse(X, xp), cut.twists[k], xp))
        X = exponential(_generators(cut)[k], q[k], xp) @ X
    return X, xp.asarray(seen[::-1])

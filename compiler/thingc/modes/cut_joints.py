"""Compute the coordinates and velocities of joints that close loops, from the poses and twists of the two links that such a joint connects.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from thingc.modes.frames import Array, exponential, generators, inverse, logarithm, moved_twist, projection, rotation_vector
from thingc.modes.tree import Cut, Mode

STEPS = 50
"""Maximum number of iterations of Newton's method. A joint with one coordinate needs one iteration if its loop is closed."""


def coordinates(cut: Cut, X_AB: Array, usual: Array, xp: Any = np, steps: int = STEPS) -> Array:
    """Compute the coordinates (n,) of a loop-closing joint from the pose `X_AB` (4, 4) of its end B relative to its end A.

    A pose determines an angle only up to full turns. Each returned angle differs from the corresponding value in `usual` by at most half a
    turn. With numpy, the function iterates until Newton's method has converged. With JAX, the function always makes `steps` iterations.
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
        moved, twists = _joint_motion(cut, q, xp)
        step = _nearest(twists.T, logarithm(inverse(moved, xp) @ X_AB, xp), xp)
        q = q + step
        if xp is np and not np.any(np.abs(step) > 1e-14):
            break
    return q


def usual(mode: Mode, cut: Cut) -> Array:
    """Return the coordinates of a loop-closing joint in the first pose that the mode defines."""
    first: Mapping[str, float] = next(iter(mode.named.values()), {})
    return np.array([first.get(name, 0.0) for name in cut.coordinates])


def velocities(cut: Cut, q: Array, X_WB: Array, relative: Array, xp: Any = np) -> Array:
    """Compute the joint velocities (n,) of a loop-closing joint from the velocity `relative` (6,) of its end B relative to its end A.

    The components of `relative` have the same axes and order as the rows of the Jacobian that `freedoms` returns.
    """
    return _nearest(freedoms(cut, q, X_WB, xp), relative, xp)


def freedoms(cut: Cut, q: Array, X_WB: Array, xp: Any = np) -> Array:
    """Return the Jacobian (6, n) of a loop-closing joint: the velocity of end B relative to end A per unit of each joint velocity.

    The first three rows are the velocity of the origin of B, and the last three rows are the angular velocity, all in world axes. `q` (n,)
    contains the coordinates of the joint, and `X_WB` (4, 4) is the pose of frame B in the world.
    """
    R = X_WB[:3, :3]
    if cut.kind == "ball":  # v is the angular velocity of the child in its own axes
        return xp.concatenate([np.zeros((3, 3)), R])  # type: ignore[no-any-return]
    _, twists = _joint_motion(cut, q, xp)
    rows: Array = xp.concatenate([R @ twists[:, 3:].T, R @ twists[:, :3].T])
    return rows


def constraint_projector(cut: Cut, q: Array, X_WB: Array, xp: Any = np) -> Array:
    """Return the matrix (6, 6) that projects the relative velocity of a joint's two ends onto the directions that the joint constrains.

    The matrix is an orthogonal projection. The components of the relative velocity have the same order as the rows of the Jacobian that
    `freedoms` returns.
    """
    return np.eye(6) - projection(freedoms(cut, q, X_WB, xp), xp)


def _nearest(A: Array, b: Array, xp: Any) -> Array:
    """Return the vector x (n,) that minimizes |A x - b|. The columns of the matrix A (6, n) must be linearly independent."""
    x: Array = xp.linalg.solve(A.T @ A, A.T @ b)
    return x


@lru_cache(maxsize=256)
def _generators(cut: Cut) -> Array:
    return np.array([generators(twist) for twist in cut.twists])


def _joint_motion(cut: Cut, q: Array, xp: Any) -> tuple[Array, Array]:
    """Return the pose (4, 4) of end A after the motion of the joint, and the twists (n, 6) of the coordinates in the frame of end A."""
    X, twists = np.eye(4), []
    for k in range(len(cut.twists) - 1, -1, -1):
        twists.append(moved_twist(inverse(X, xp), cut.twists[k], xp))
        X = exponential(_generators(cut)[k], q[k], xp) @ X
    return X, xp.asarray(twists[::-1]).reshape(-1, 6)

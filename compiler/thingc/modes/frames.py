"""Poses as homogeneous 4 x 4 matrices (`X_AB` is the pose of frame B in frame A [m]), and MuJoCo's quaternions (w, x, y, z)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def pose(rotation: ArrayLike, position: ArrayLike) -> Array:
    """Return the 4 x 4 matrix of a rotation (3, 3) and a position (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, position
    return matrix


def inverse(X: Array) -> Array:
    """Return the inverse `X_BA` of the pose `X_AB` (4, 4)."""
    back = X[:3, :3].T
    return pose(back, -back @ X[:3, 3])


def rotation_of(quaternion: ArrayLike) -> Array:
    """Return the rotation matrix (3, 3) of a quaternion after normalizing the quaternion, as MuJoCo does for `qpos`."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array([
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ])


def quaternion_of(rotation: Array) -> Array:
    """Return the unit quaternion (4,) of a rotation matrix, with its largest component positive.

    Source: Shepperd, "Quaternion from rotation matrix", 1978. It computes the largest component first, so it is accurate at any angle.
    """
    r = rotation
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    products = np.array([
        [1.0 + trace, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], 1.0 - trace + 2.0 * r[0, 0], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
        [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1.0 - trace + 2.0 * r[1, 1], r[1, 2] + r[2, 1]],
        [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1.0 - trace + 2.0 * r[2, 2]],
    ])  # 4 q q^T
    row: Array = products[int(np.argmax(np.diagonal(products)))]
    unit: Array = row / np.linalg.norm(row)
    return unit


def turned(axis: Array, angle: float) -> Array:
    """Return the rotation (3, 3) by `angle` [rad] about a unit axis a, by Rodrigues' formula `1 + sin [a]x + (1 - cos) [a]x^2`."""
    k = cross_matrix(axis)
    rotation: Array = np.eye(3) + np.sin(angle) * k + 2.0 * np.sin(angle / 2.0) ** 2 * (k @ k)
    return rotation


def exponential(twist: Array, q: float) -> Array:
    """Return the pose (4, 4) at q of a motion with the twist `twist` (6,) per unit of q, which is the identity at q = 0.

    The angular part comes first and must be a unit vector or 0. If it is not 0, the linear part must be parallel to it.
    """
    if not twist[:3].any():
        return pose(np.eye(3), twist[3:] * q)
    return pose(turned(twist[:3], q), twist[3:] * q)


def rotation_vector(rotation: Array) -> Array:
    """Return the rotation vector (3,) of a rotation (3, 3): the unit axis times the angle [rad] from 0 to pi."""
    w = quaternion_of(rotation)
    w = -w if w[0] < 0.0 else w
    size = float(np.linalg.norm(w[1:]))
    turn: Array = np.zeros(3) if size == 0.0 else w[1:] * (2.0 * np.arctan2(size, w[0]) / size)
    return turn


def logarithm(X: Array) -> Array:
    """Return the rotation vector [rad] and the translation [m] of a pose near the identity as one vector (6,)."""
    return np.concatenate([rotation_vector(X[:3, :3]), X[:3, 3]])


def adjoint(X: Array) -> Array:
    """Return the matrix (6, 6) that converts twists (angular, then linear) from frame B to A; `X` is X_AB (4, 4)."""
    R = X[:3, :3]
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = matrix[3:, 3:] = R
    matrix[3:, :3] = cross_matrix(X[:3, 3]) @ R
    return matrix


def cross_matrix(v: Array) -> Array:
    """Return the matrix `[v]x` (3, 3), whose product with w is v x w."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def angle_between(one: Array, other: Array) -> float:
    """Return the angle [rad] between two rotations (3, 3). It is accurate for small angles."""
    difference = one.T @ other
    sine = np.linalg.norm([difference[2, 1] - difference[1, 2], difference[0, 2] - difference[2, 0], difference[1, 0] - difference[0, 1]])
    return float(np.arctan2(sine, np.trace(difference) - 1.0))

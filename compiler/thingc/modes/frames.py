"""Functions for poses as homogeneous 4 x 4 matrices, and for quaternions (w, x, y, z) as in MuJoCo.

`X_AB` is the pose of frame B in frame A [m]. The argument `xp` of a function is the module that computes with arrays: `numpy`, or
`jax.numpy` in `thingc.modes.jax`.
"""

from __future__ import annotations

from functools import reduce
from operator import add
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

BOTTOM = np.array([[0.0, 0.0, 0.0, 1.0]])
"""The last row of the homogeneous matrix of any pose."""
RANK = 1e-10
"""Equations with coefficients that are smaller than this fraction of the largest coefficients depend on the other equations."""
SMALL = 24
"""Largest number of independent equations that are solved without LAPACK in JAX."""
CROSS = np.zeros((3, 9))
"""The cross product matrices of the unit vectors along x, y and z, each flattened to one row."""
CROSS[[0, 1, 2], [7, 2, 3]], CROSS[[0, 1, 2], [5, 6, 1]] = 1.0, -1.0


def pose(rotation: ArrayLike, position: ArrayLike, xp: Any = np) -> Array:
    """Return the homogeneous matrix (4, 4) of a pose with a rotation matrix (3, 3) and a position (3,)."""
    top = xp.concatenate([xp.asarray(rotation), xp.asarray(position).reshape(3, 1)], axis=1)
    matrix: Array = xp.concatenate([top, BOTTOM])
    return matrix


def inverse(X: Array, xp: Any = np) -> Array:
    """Return the inverse of a pose. The inverse of `X_AB` (4, 4) is `X_BA`."""
    back = X[:3, :3].T
    return pose(back, -back @ X[:3, 3], xp)


def rotation_of(quaternion: ArrayLike, xp: Any = np) -> Array:
    """Convert a quaternion to a rotation matrix (3, 3). The quaternion is normalized first, as MuJoCo does for `qpos`.

    An array of quaternions (n, 4) is converted to an array of matrices (n, 3, 3).
    """
    quaternions = xp.asarray(quaternion)
    w, x, y, z = (quaternions / xp.linalg.norm(quaternions, axis=-1, keepdims=True)).T
    matrix: Array = xp.asarray([
        [w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
        [2.0 * (x * y - w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z + w * x)],
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z],
    ]).T
    return matrix


def quaternion_of(rotation: Array, xp: Any = np) -> Array:
    """Convert a rotation matrix (3, 3) to a unit quaternion (4,) whose largest component is positive.

    Source: Shepperd, "Quaternion from rotation matrix", 1978. The method computes the largest component first, so it is accurate at any
    angle.
    """
    r = rotation
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    products = xp.asarray([
        [1.0 + trace, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], 1.0 - trace + 2.0 * r[0, 0], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
        [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1.0 - trace + 2.0 * r[1, 1], r[1, 2] + r[2, 1]],
        [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1.0 - trace + 2.0 * r[2, 2]],
    ])  # 4 q q^T
    row = products[xp.argmax(xp.diagonal(products))]
    unit: Array = row / xp.sqrt(row @ row)
    return unit


def rotation(vector: Array, xp: Any = np) -> Array:
    """Convert a rotation vector (3,) [rad] to a rotation matrix (3, 3) by Rodrigues' formula `1 + sin [a]x + (1 - cos) [a]x^2`."""
    square = vector @ vector
    angle = xp.sqrt(xp.where(square == 0.0, 1e-60, square))  # keeps derivatives at 0 finite
    k = cross_matrix(vector)
    matrix: Array = np.eye(3) + xp.sin(angle) / angle * k + 2.0 * (xp.sin(angle / 2.0) / angle) ** 2 * (k @ k)
    return matrix


def generators(twist: Array) -> Array:
    """Return the constant matrices (3, 4, 4) from which `exponential` computes the pose of a motion with the given twist.

    `twist` (6,) is the motion per unit of q, with the angular part first. The angular part of `twist` must be a unit vector or 0. If the
    angular part is a unit vector, the linear part must be parallel to the angular part.
    """
    turn, slide = np.zeros((4, 4)), np.zeros((4, 4))
    turn[:3, :3], slide[:3, 3] = cross_matrix(twist[:3]), twist[3:]
    return np.array([turn, 2.0 * turn @ turn, slide])


def exponential(matrices: Array, q: Any, xp: Any = np) -> Array:
    """Return the pose (4, 4) of a moved frame at the joint coordinate q. At q = 0, the pose is the identity.

    `matrices` is the result of `generators` for the twist of the motion.
    """
    motion: Array = np.eye(4) + xp.sin(q) * matrices[0] + xp.sin(q / 2.0) ** 2 * matrices[1] + q * matrices[2]
    return motion


def rotation_vector(rotation: Array, xp: Any = np) -> Array:
    """Convert a rotation matrix (3, 3) to a rotation vector (3,): the unit axis times the angle [rad] from 0 to pi."""
    w = quaternion_of(rotation, xp)
    w = xp.where(w[0] < 0.0, -w, w)
    square = w[1:] @ w[1:]
    size = xp.sqrt(xp.where(square == 0.0, 1.0, square))
    turn: Array = w[1:] * xp.where(square == 0.0, 2.0, 2.0 * xp.arctan2(size, w[0]) / size)
    return turn


def logarithm(X: Array, xp: Any = np) -> Array:
    """Return the rotation vector [rad] and the translation [m] of a pose as one vector (6,). The pose must be near the identity."""
    return xp.concatenate([rotation_vector(X[:3, :3], xp), X[:3, 3]])  # type: ignore[no-any-return]


def moved_twist(X: Array, twist: Array, xp: Any = np) -> Array:
    """Transform a twist from frame B to frame A. `X` (4, 4) is the pose of frame B in frame A. The angular part of a twist comes first."""
    angular = X[:3, :3] @ twist[:3]
    both: Array = xp.concatenate([angular, X[:3, :3] @ twist[3:] + cross(X[:3, 3], angular, xp)])
    return both


def cross_matrix(v: Array) -> Array:
    """Return the cross product matrix `[v]x` (..., 3, 3) of a vector v (..., 3). The product of this matrix and a vector w is v x w."""
    matrix: Array = (v @ CROSS).reshape(*v.shape, 3)
    return matrix


def cross_columns(v: Array, columns: Array, xp: Any = np) -> Array:
    """Return the cross products (..., 3, k) of a vector v (..., 3) and the columns of a matrix (..., 3, k).

    In JAX, the products are not computed with `cross_matrix`, because XLA combines these operations with others, but not products of many
    matrices.
    """
    if xp is np:
        return cross_matrix(v) @ columns
    x, y, z = (v[..., k, None] for k in range(3))
    a, b, c = (columns[..., k, :] for k in range(3))
    return xp.stack([y * c - z * b, z * a - x * c, x * b - y * a], axis=-2)  # type: ignore[no-any-return]


def cross(v: Array, w: Array, xp: Any = np) -> Array:
    """Return the cross product v x w of two vectors (..., 3)."""
    return cross_columns(v, w[..., None], xp)[..., 0]


def product(A: Array, B: Array, xp: Any) -> Array:
    """Return the product of two small matrices (..., m, k) and (..., k, n).

    In JAX, the product is a sum of outer products, because XLA combines these operations with others, but not products of many matrices.
    """
    result: Array = A @ B if xp is np else reduce(add, (A[..., k, None] * B[..., k, None, :] for k in range(B.shape[-2])))
    return result


def half_solve(A: Array, B: Array, xp: Any) -> tuple[Array, Array]:
    """Return the upper triangular matrix U (n, n) for which U^T U = A, and the solution Y (n, k) of U^T Y = B.

    The matrix A must be symmetric and positive definite. In JAX, small systems are solved by elimination, because `jax.numpy.linalg` calls
    LAPACK separately for each matrix.
    """
    if xp is np or len(A) > SMALL:
        L = xp.linalg.cholesky(A)
        return L.T, xp.linalg.solve(L, B)
    rows, remaining = [], xp.concatenate([A, B], axis=1)
    for number in range(len(A)):
        row = remaining[0] / xp.sqrt(remaining[0, 0])
        rows.append(xp.concatenate([np.zeros(number), row]))
        remaining = remaining[1:, 1:] - row[1 : len(remaining), None] * row[1:]
    found = xp.asarray(rows).reshape(len(A), len(A) + B.shape[1])
    return found[:, : len(A)], found[:, len(A) :]


def back_substitute(U: Array, y: Array, xp: Any) -> Array:
    """Return the solution x (n,) of U x = y for an upper triangular matrix U (n, n). In JAX, LAPACK is used as in `half_solve`."""
    if xp is np or len(U) > SMALL:
        return xp.linalg.solve(U, y)  # type: ignore[no-any-return]
    x: Array = xp.zeros(0)
    for k in reversed(range(len(U))):
        x = xp.concatenate([(y[k] - (U[k, k + 1 :] * x).sum())[None] / U[k, k], x])
    return x


def projection(A: Array, xp: Any) -> Array:
    """Return the matrix (m, m) of the orthogonal projection onto the n columns of A (m, n), which must be linearly independent."""
    basis = half_solve(A.T @ A, A.T, xp)[1]
    return basis.T @ basis


def smallest_solution(A: Array, b: Array, xp: Any) -> Array:
    """Return the solution x (n,) of A x = b that has the smallest norm. The matrix A (m, n) can have any rank.

    The equations must be consistent, except for rounding errors. In JAX, small systems are solved without LAPACK, as in `half_solve`. Each
    step of this method selects the equation with the largest remaining coefficients, scales it to the norm 1, and makes all other equations
    orthogonal to it (modified Gram-Schmidt method). Equations that depend on the selected equations then have no coefficients.
    """
    if xp is np or min(A.shape) > SMALL:
        return xp.linalg.lstsq(A, b, rcond=RANK)[0]  # type: ignore[no-any-return]
    selected: list[Array] = []
    remaining = xp.concatenate([A.T, b[None]])
    least = max(RANK, 100.0 * float(xp.finfo(A.dtype).eps)) ** 2 * xp.max((A**2).sum(axis=1))
    for _ in range(min(A.shape)):
        is_largest = np.arange(len(A)) == xp.argmax(reduce(add, remaining[:-1] ** 2))
        largest = product(remaining, is_largest[:, None], xp)[:, 0]  # faster than an index that differs between worlds
        square = reduce(add, largest[:-1] ** 2)
        scale = xp.sqrt(xp.where(square > least, square, 1.0))
        selected.append(xp.where(square > least, largest / scale, 0.0))
        remaining = remaining - selected[-1][:, None] * product(selected[-1][None, :-1], remaining[:-1], xp)
    x: Array = xp.zeros(A.shape[1])
    for row in reversed(selected):  # this order makes the errors of all equations small, although the rows are only nearly orthogonal
        x = x + (row[-1] - (row[:-1] * x).sum()) * row[:-1]
    return x


def difference(X: Array, other: Array, xp: Any = np) -> tuple[Any, Any]:
    """Return the distance [m] between the origins of two poses, and the angle [rad] of the rotation between them.

    The computed angle is also accurate for small rotations.
    """
    moved, D = X[:3, 3] - other[:3, 3], X[:3, :3].T @ other[:3, :3]
    axis = xp.asarray([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    return xp.sqrt(moved @ moved), xp.arctan2(xp.sqrt(axis @ axis), xp.trace(D) - 1.0)

"""Solve small dense least-squares problems in pure Python."""

from __future__ import annotations

from collections.abc import Sequence
from operator import mul

from thingc.base.numeric import sqrt, sum_of


def solve(columns: Sequence[Sequence[float]], error: Sequence[float], damping: float) -> list[float] | None:
    """Return the vector x that minimizes |error + J x|^2 + lambda |x|^2, or None if the matrix is numerically singular.

    `columns` contains the n columns of J, with m rows each. The factor lambda is `damping` times the mean square of the entries of J along
    the smaller side, so that the result does not depend on units. As lambda goes to 0, x goes to -pinv(J) error. The function solves the
    normal equations of the smaller side, which are n x n or m x m. The m x m equations follow from inv(J'J + l) J' = J' inv(JJ' + l).
    """
    n, m = len(columns), len(error)
    rows = [[column[k] for column in columns] for k in range(m)]
    tall = n <= m
    vectors = columns if tall else rows
    size = len(vectors)
    half = [[sum_of(map(mul, u, v)) for v in vectors[: k + 1]] for k, u in enumerate(vectors)]
    gram = [[half[i][j] if j <= i else half[j][i] for j in range(size)] for i in range(size)]
    trace = sum_of(gram[k][k] for k in range(size))
    if trace == 0.0:
        return [0.0] * n
    for k in range(size):
        gram[k][k] += damping * trace / size
    if tall:
        right = [-sum_of(map(mul, column, error)) for column in columns]
        return _cholesky_solve(gram, right)
    y = _cholesky_solve(gram, [-value for value in error])
    return None if y is None else [sum_of(map(mul, column, y)) for column in columns]


def _cholesky_solve(matrix: Sequence[Sequence[float]], right: Sequence[float]) -> list[float] | None:
    """Solve A x = b for a symmetric positive-definite A = L L'. Return None if A is not numerically positive-definite."""
    size = len(right)
    lower = [[0.0] * size for _ in range(size)]
    for i in range(size):
        for j in range(i + 1):
            remainder = matrix[i][j] - sum_of(map(mul, lower[i][:j], lower[j]))
            if i == j:
                if not remainder > 0.0:
                    return None
                lower[i][i] = sqrt(remainder)
            else:
                lower[i][j] = remainder / lower[j][j]
    x = [0.0] * size
    for i in range(size):
        x[i] = (right[i] - sum_of(lower[i][k] * x[k] for k in range(i))) / lower[i][i]
    for i in reversed(range(size)):
        x[i] = (x[i] - sum_of(lower[k][i] * x[k] for k in range(i + 1, size))) / lower[i][i]
    return x

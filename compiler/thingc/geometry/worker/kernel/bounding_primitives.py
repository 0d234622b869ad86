"""Fit primitives around a part: the smallest box, cylinder, capsule and sphere around its mesh, along a few candidate axes."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from thingc.base.pose import Matrix, Pose
from thingc.base.primitives import Primitive

if TYPE_CHECKING:
    from numpy.typing import NDArray

BETTER = 0.99
"""A primitive along other axes replaces the smallest primitive so far only if its volume is smaller by this factor. The axes of the part
are tried first.
"""


def fit_all(points: NDArray[np.float64], principal: Matrix | None = None) -> dict[str, Primitive]:
    """Return the smallest primitive of each shape that encloses the points (n, 3) [m]. The vertices of the convex hull are sufficient as
    points.

    The candidate axes are the axes of the part, and the eigenvectors of the inertia matrix `principal`.
    """
    frames = [np.eye(3)]
    if principal is not None:
        frames.append(_axes(np.array(principal)))
    ball_centre, ball_radius = smallest_ball(points)
    right_handed = ([0, 1, 2], [1, 2, 0], [2, 0, 1])  # orders of the axes
    round_fits = [_round(points, frame[:, order]) for frame in frames for order in right_handed]
    return {
        "box": _smallest([_box(points, frame) for frame in frames]),
        "cylinder": _smallest([cylinder for cylinder, _ in round_fits]),
        "capsule": _smallest([capsule for _, capsule in round_fits]),
        "sphere": Primitive(shape="sphere", size=(ball_radius,), pose=_pose(np.eye(3), ball_centre)),
    }


def smallest_ball(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the centre and radius of the smallest disc `(n, 2)` or ball `(n, 3)` that contains all points.

    The algorithm starts with one point. In each step, it adds the farthest outside point, until all points are inside. The algorithm is the
    pivoting heuristic of Gaertner, "Fast and robust smallest enclosing balls", 1999. In each step, the ball of few points is found by
    trying every set of support points.
    """
    middle = points.mean(axis=0)
    support = points[[int(np.argmax(((points - middle) ** 2).sum(axis=1)))]]
    centre, radius = support[0], 0.0
    for _ in range(1000):
        distances = np.sqrt(((points - centre) ** 2).sum(axis=1))
        farthest = int(np.argmax(distances))
        if distances[farthest] <= radius * (1.0 + 1e-12) + 1e-15:
            break
        centre, radius, support = _ball_of_few(np.vstack([support, points[farthest]]))
    return centre, float(max(radius, np.sqrt(((points - centre) ** 2).sum(axis=1)).max()))


def _ball_of_few(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """Compute the smallest ball that contains a few points. Return the centre of the ball, its radius, and the points on its surface.

    The last point must be outside every ball that contains only the other points.
    """
    best: tuple[NDArray[np.float64], float, NDArray[np.float64]] | None = None
    dimension = points.shape[1]
    *others, last = range(len(points))
    for count in range(2, min(len(points), dimension + 1) + 1):
        for chosen in itertools.combinations(others, count - 1):
            support = points[[*chosen, last]]
            edges = support[1:] - support[0]
            if count > 2 and np.linalg.matrix_rank(edges) < count - 1:
                continue
            centre = support[0] + _circumcentre(edges)
            radius = float(np.sqrt(((support - centre) ** 2).sum(axis=1)).max())
            reach = float(np.sqrt(((points - centre) ** 2).sum(axis=1)).max())
            if reach <= radius * (1.0 + 1e-10) + 1e-15 and (best is None or radius < best[1]):
                best = (centre, reach, support)
    if best is None:
        raise ArithmeticError("no enclosing sphere was found for the points")
    return best


def _circumcentre(edges: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the point that has the same distance from the origin and from the ends of all vectors `edges` (k, n).

    This point is a linear combination of the vectors.
    """
    squares = (edges * edges).sum(axis=1)
    try:
        return np.asarray(edges.T @ np.linalg.solve(2.0 * edges @ edges.T, squares))
    except np.linalg.LinAlgError:  # for points almost in a plane, the component normal to it vanishes in the products
        return np.asarray(np.linalg.lstsq(2.0 * edges, squares)[0])


def _smallest(fits: list[Primitive]) -> Primitive:
    """Return the primitive with the smallest volume. The first primitive is preferred, unless another one is clearly smaller."""
    best = fits[0]
    for fit in fits[1:]:
        if fit.volume < BETTER * best.volume:
            best = fit
    return best


def _box(points: NDArray[np.float64], frame: NDArray[np.float64]) -> Primitive:
    """Return the smallest box that encloses the points and is aligned with the columns of `frame`."""
    local = points @ frame
    low, high = local.min(axis=0), local.max(axis=0)
    size = tuple(float(half) for half in (high - low) / 2.0)
    return Primitive(shape="box", size=size, pose=_pose(frame, frame @ ((low + high) / 2.0)))


def _round(points: NDArray[np.float64], frame: NDArray[np.float64]) -> tuple[Primitive, Primitive]:
    """Return the smallest cylinder and the smallest capsule that enclose the points, with their axes along the third column of `frame`."""
    local = points @ frame
    centre, radius = smallest_ball(local[:, :2])
    z = local[:, 2]
    low, high = float(z.min()), float(z.max())
    cylinder = Primitive(
        shape="cylinder", size=(radius, (high - low) / 2.0),
        pose=_pose(frame, frame @ np.array([*centre, (low + high) / 2.0])),
    )
    # height of the cap above a point, at the distance of the point from the axis
    cap_heights = np.sqrt(np.maximum(radius**2 - ((local[:, :2] - centre) ** 2).sum(axis=1), 0.0))
    top, bottom = float((z - cap_heights).max()), float((z + cap_heights).min())
    half = max((top - bottom) / 2.0, 1e-6 * radius)
    capsule = Primitive(shape="capsule", size=(radius, half), pose=_pose(frame, frame @ np.array([*centre, (top + bottom) / 2.0])))
    return cylinder, capsule


def _axes(inertia: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the principal axes of an inertia matrix, as the columns of a right-handed matrix.

    The largest entry of each axis is positive if possible.
    """
    _, axes = np.linalg.eigh(inertia)
    for column in range(3):
        if axes[np.argmax(np.abs(axes[:, column])), column] < 0.0:
            axes[:, column] *= -1.0
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    return np.asarray(axes)


def _pose(frame: NDArray[np.float64], origin: NDArray[np.float64]) -> Pose:
    rows = (frame + 0.0).tolist()
    x, y, z = (float(value) if abs(value) > 1e-12 else 0.0 for value in origin)
    return Pose(rotation=(tuple(rows[0]), tuple(rows[1]), tuple(rows[2])), translation=(x, y, z))

"""The space that a shape fills while a joint moves it."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, cos, radians, sin, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from build123d import Face, Location, Solid, Vector, Wire
from build123d.topology import Compound, Shape

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thingc.geometry.things.thing import Geometry

Range = tuple[float, float] | None

FACET = 0.6
"""Largest angle [rad] between the facets of a curved surface."""


def sweep(shapes: Geometry, frame: Location, turn: Range, slide: Range, tolerance: float) -> Solid | Compound:
    """Return prisms that contain the solids of shapes while they turn [deg] about the z axis of a frame, or slide [mm] along this axis.

    The base of a prism is the outline of a solid as seen along the axis, moved through the range, and its height is that of the solid. The
    base extends beyond the moving outline by at most half of the `tolerance` [mm]. In addition, the facets of curved surfaces, and the
    removal of short edges, each move the outline by at most a quarter of the tolerance.
    """
    from manifold3d import CrossSection, FillRule, OpType

    given = [ends for ends in (turn, slide) if ends is not None]
    if len(given) != 1 or not given[0][0] < given[0][1]:
        raise ValueError(f"sweep() requires an increasing range `turn` or `slide`, found turn={turn!r} and slide={slide!r}")
    prisms: list[Solid] = []
    for solid in (one for shape in ([shapes] if isinstance(shapes, Shape) else shapes or ()) for one in shape.solids()):
        places, triangles = solid.moved(frame.inverse()).tessellate(tolerance / 4.0, FACET)
        corners = np.array([tuple(place) for place in places])
        a, b, c = (corners[[triangle[k] for triangle in triangles], :2] for k in range(3))
        left = (b - a)[:, 0] * (c - a)[:, 1] > (b - a)[:, 1] * (c - a)[:, 0]
        outline = CrossSection(list(np.stack([a, b, c], axis=1)[left]), FillRule.NonZero)  # the sides that face along the axis
        low, high = corners[:, 2].min(), corners[:, 2].max()
        if slide is not None:
            low, high = low + slide[0], high + slide[1]
        elif turn is not None:
            steps = [CrossSection.hull_points(points) for points in _paths(outline.to_polygons(), turn, tolerance / 2.0)]
            outline = CrossSection.batch_boolean([outline.rotate(turn[0]), *steps], OpType.Add)
        for base in outline.simplify(tolerance / 4.0).decompose():
            rings = sorted(base.to_polygons(), key=lambda ring: -float(np.ptp(ring, axis=0).prod()))
            wires = [Wire.make_polygon([(x, y, low) for x, y in ring.tolist()], close=True) for ring in rings]
            prisms.append(Solid.extrude(Face(wires[0], wires[1:]), Vector(0.0, 0.0, high - low)).moved(frame))
    if not prisms:
        raise ValueError("sweep() requires shapes with solids")
    return prisms[0] if len(prisms) == 1 else Compound(prisms)


def _paths(rings: list[Any], turn: tuple[float, float], error: float) -> Iterator[NDArray[np.float64]]:
    """Yield the points whose convex hulls contain the paths of all edges of polygons `(n, 2)` that turn by angles [deg] about the origin.

    In a step, each end of an edge moves on an arc inside of a triangle: the ends of the arc, and the intersection of its tangents. Each
    point of the hull of these triangles is a weighted mean of points of the moving edge at angles of the step. From the same mean of the
    points at the mean of the angles, which is on the moving edge, its distance is at most e h + r h^2, which is `error`. Here, h is half of
    the angle of a step, r is the distance of the farthest point from the origin, and e is half of the length of the edge.
    """
    reach = max(float(np.linalg.norm(ring, axis=1).max()) for ring in rings)
    longest = 2.0 * sqrt(reach * error)
    low, high = map(radians, turn)
    half_edge = longest / 2.0
    count = ceil((high - low) * reach / (sqrt(half_edge**2 + 4.0 * reach * error) - half_edge))
    half = (high - low) / count / 2.0
    for ring in rings:
        for first, last in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            parts = np.linspace(first, last, ceil(float(np.linalg.norm(last - first)) / longest) + 1)
            for k in range(count):
                angles = ((low + 2 * k * half, 1.0), (low + (2 * k + 1) * half, 1.0 / cos(half)), (low + (2 * k + 2) * half, 1.0))
                moved = np.stack([parts @ [[scale * cos(q), scale * sin(q)], [-scale * sin(q), scale * cos(q)]] for q, scale in angles])
                yield from (moved[:, j : j + 2].reshape(-1, 2) for j in range(len(parts) - 1))

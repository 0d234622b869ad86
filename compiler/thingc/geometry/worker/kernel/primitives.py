"""Recognise solids that are exactly a box, a cylinder, a capsule or a sphere, by the surfaces of their B-rep.

Only the surfaces of the faces are compared. The number of faces does not matter, because the kernel may split a face, such as the side of a
cylinder. Three perpendicular pairs of planes enclose exactly one bounded region, which is a box. Similarly, a cylinder with two planes
across its axis encloses exactly one bounded region, and so does a sphere. A cylinder and two spheres with the same radius on its axis
enclose regions that together form a capsule. Therefore, if a solid has the same volume and area as the primitive, it is equal to the
primitive.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.GeomAbs import GeomAbs_Cylinder, GeomAbs_Plane, GeomAbs_Sphere
from OCP.gp import gp_Ax1, gp_Pnt
from OCP.TopAbs import TopAbs_FACE
from OCP.TopoDS import TopoDS, TopoDS_Shape

from thingc.base.numeric import dist, hypot, sum_of
from thingc.base.pose import IDENTITY, Matrix, Pose, Vector, add_scaled, cross, dot, rotate, scale_vector, transpose
from thingc.base.primitives import Primitive, PrimitiveShape
from thingc.geometry.worker.kernel import convert
from thingc.geometry.worker.kernel.integrals import extent, integrals, subshapes

if TYPE_CHECKING:
    from collections.abc import Iterable

SAME = 1e-7
"""Tolerance for directions [rad], and relative tolerance for lengths (relative to the size of the solid)."""
AGREEMENT = 1e-9
"""Relative tolerance for comparing volume and area of a solid with those of a primitive."""
ROUNDING = 1e-12
"""Components of directions up to this size are set to zero, because rotated solids have rounding errors of this size."""
DECIMALS = 12
"""Number of decimals to which lengths [mm] are rounded, because 2.5 could be 2.499999999999999."""

_Line = tuple[Vector, Vector]
"""A point [mm] and a unit direction. Point and direction define a plane with its normal, or an axis."""


def primitive_of(solid: TopoDS_Shape) -> Primitive | None:
    """Return the primitive [m] that exactly equals a solid [mm]. Return None if there is no such primitive.

    The pose of the primitive does not depend on the order of faces in the CAD kernel. A box gets the smallest possible rotation, which
    is zero for a box along the axes of the part. The axis of a cylinder or a capsule has a positive z component. If its z component is
    zero, its y component is positive. If both components are zero, its x component is positive. The rotation of the primitive is the
    smallest rotation to this axis.
    """
    planes: list[_Line] = []
    cylinders: list[tuple[_Line, float]] = []
    spheres: list[tuple[Vector, float]] = []
    for face in subshapes(solid, TopAbs_FACE):
        surface = BRepAdaptor_Surface(TopoDS.Face(face), False)
        kind = surface.GetType()
        if kind == GeomAbs_Plane:
            planes.append(_line(surface.Plane().Axis()))
        elif kind == GeomAbs_Cylinder:
            cylinders.append((_line(surface.Cylinder().Axis()), surface.Cylinder().Radius()))
        elif kind == GeomAbs_Sphere:
            spheres.append((surface.Sphere().Location().Coord(), surface.Sphere().Radius()))
        else:
            return None
    if not planes and not spheres:
        return None
    size = extent(solid)
    match bool(planes), bool(cylinders), bool(spheres):
        case True, False, False:
            primitive = _box(planes, size)
        case True, True, False:
            primitive = _cylinder(cylinders, planes, size)
        case False, True, True:
            primitive = _capsule(cylinders, spheres, size)
        case False, False, True:
            primitive = _sphere(spheres, size)
        case _:
            primitive = None
    return primitive if primitive is not None and _fills(primitive, solid) else None


def _fills(primitive: Primitive, solid: TopoDS_Shape) -> bool:
    """Return whether a solid has the volume and the area of a primitive. The faces of the solid can point inwards or outwards."""
    matter, surface = integrals(solid, gp_Pnt(*(coordinate * convert.MM for coordinate in primitive.pose.translation)))
    volume, area = convert.volume(matter.Mass()), convert.area(surface.Mass())
    return (
        min(primitive.size) > 0.0
        and abs(volume - primitive.volume) <= AGREEMENT * primitive.volume
        and abs(area - primitive.area) <= AGREEMENT * primitive.area
    )


def _box(planes: list[_Line], size: float) -> Primitive | None:
    pairs: list[tuple[Vector, list[Vector]]] = []
    for point, normal in planes:
        pair = next((points for other, points in pairs if _parallel(normal, other)), None)
        if pair is None:
            pairs.append((normal, [point]))
        else:
            pair.append(point)
    if len(pairs) != 3 or any(abs(dot(a, b)) > SAME for (a, _), (b, _) in itertools.combinations(pairs, 2)):
        return None
    a = pairs[0][0]
    b = _unit(add_scaled(pairs[1][0], a, -dot(pairs[1][0], a)))
    axes = (a, b, _unit(cross(a, b)))
    middles: list[float] = []
    halves: list[float] = []
    for axis, (_, points) in zip(axes, pairs, strict=True):
        ends = _two_ends((dot(point, axis) for point in points), size)
        if ends is None:
            return None
        middles.append((ends[0] + ends[1]) / 2.0)
        halves.append((ends[1] - ends[0]) / 2.0)
    rotation, order = _least_turned(axes)
    x, y, z = middles
    centre = rotate(transpose(axes), (x, y, z))
    return _make_primitive("box", tuple(halves[k] for k in order), rotation, centre)


def _cylinder(cylinders: list[tuple[_Line, float]], planes: list[_Line], size: float) -> Primitive | None:
    side = _common_axis(cylinders, size)
    if side is None or not all(_parallel(normal, side[0][1]) for _, normal in planes):
        return None
    return _round("cylinder", *side, (point for point, _ in planes), size)


def _capsule(cylinders: list[tuple[_Line, float]], spheres: list[tuple[Vector, float]], size: float) -> Primitive | None:
    side = _common_axis(cylinders, size)
    if side is None:
        return None
    (point, axis), radius = side
    if any(abs(other - radius) > SAME * size or _distance_from_line(centre, point, axis) > SAME * size for centre, other in spheres):
        return None
    return _round("capsule", *side, (centre for centre, _ in spheres), size)


def _round(shape: PrimitiveShape, line: _Line, radius: float, ends: Iterable[Vector], size: float) -> Primitive | None:
    """Create a cylinder or a capsule around a line. `ends` contains points of its planes, or the centres of its spheres."""
    point, axis = line
    interval = _two_ends((dot(add_scaled(end, point, -1.0), axis) for end in ends), size)
    if interval is None:
        return None
    low, high = interval
    return _make_primitive(shape, (radius, (high - low) / 2.0), _shortest_turn(axis), add_scaled(point, axis, (low + high) / 2.0))


def _sphere(spheres: list[tuple[Vector, float]], size: float) -> Primitive | None:
    centre, radius = spheres[0]
    if any(abs(other - radius) > SAME * size or dist(where, centre) > SAME * size for where, other in spheres):
        return None
    return _make_primitive("sphere", (radius,), IDENTITY, centre)


def _common_axis(cylinders: list[tuple[_Line, float]], size: float) -> tuple[_Line, float] | None:
    """Return the common axis of all cylinders, which points up, and their common radius. Return None if the cylinders do not have the same
    axis and radius.
    """
    (point, axis), radius = cylinders[0]
    for (other, direction), length in cylinders:
        if abs(length - radius) > SAME * size or not _parallel(direction, axis) or _distance_from_line(other, point, axis) > SAME * size:
            return None
    up = next((c for c in reversed(axis) if c != 0.0), 1.0) > 0.0
    return (point, axis if up else scale_vector(axis, -1.0)), radius


def _two_ends(places: Iterable[float], size: float) -> tuple[float, float] | None:
    """Merge equal positions on a line. If two positions remain, return the lower and the upper position.

    Otherwise, return None.
    """
    ordered = sorted(places)
    low, high = ordered[0], ordered[-1]
    between = [place for place in ordered if place - low > SAME * size and high - place > SAME * size]
    return None if between or high - low <= SAME * size else (low, high)


def _make_primitive(shape: PrimitiveShape, size: tuple[float, ...], rotation: Matrix, centre: Vector) -> Primitive:
    """Create a primitive in metres. The arguments are in mm."""
    x, y, z = (round(coordinate, DECIMALS) for coordinate in centre)
    return Primitive(
        shape=shape, size=tuple(convert.length(round(length, DECIMALS)) for length in size),
        pose=Pose(rotation=rotation, translation=convert.vector((x, y, z))),
    )


def _least_turned(axes: Matrix) -> tuple[Matrix, tuple[int, ...]]:
    """Return the smallest rotation whose columns are the given axes in any order and with any sign.

    Also return the index of the given axis in each column. The rows of `axes` are the given axes. The result is the rotation with the
    largest trace.
    """
    rotations: list[tuple[Matrix, tuple[int, ...]]] = []
    for order in itertools.permutations(range(3)):
        for one, other in itertools.product((1.0, -1.0), repeat=2):
            x, y = scale_vector(axes[order[0]], one), scale_vector(axes[order[1]], other)
            rotations.append((transpose((x, y, _unit(cross(x, y)))), order))
    # among rotations with equal traces, choose by the largest entries, so that rounding does not decide
    return max(rotations, key=lambda one: (
        round(sum_of(one[0][k][k] for k in range(3)), 9), [round(entry, 9) for row in one[0] for entry in row]
    ))


def _shortest_turn(axis: Vector) -> Matrix:
    """Return the smallest rotation from the z axis to the unit vector `axis`. The z component of `axis` must not be negative."""
    x, y, z = axis
    k = 1.0 / (1.0 + z)
    return ((1.0 - x * x * k, -x * y * k + 0.0, x), (-x * y * k + 0.0, 1.0 - y * y * k, y), (-x + 0.0, -y + 0.0, z))


def _parallel(a: Vector, b: Vector) -> bool:
    return hypot(*cross(a, b)) <= SAME


def _distance_from_line(point: Vector, origin: Vector, axis: Vector) -> float:
    """Return the distance of a point from the line through `origin` along `axis`."""
    return hypot(*cross(add_scaled(point, origin, -1.0), axis))


def _unit(a: Vector) -> Vector:
    """Return the unit vector in the direction of a vector. Components that are only rounding errors of a rotation are set to zero, so that
    coordinate axes are exact.
    """
    length = hypot(*a)
    x, y, z = (0.0 if abs(component) <= ROUNDING * length else component for component in a)
    return scale_vector((x, y, z), 1.0 / hypot(x, y, z))


def _line(axis: gp_Ax1) -> _Line:
    return axis.Location().Coord(), _unit(axis.Direction().Coord())

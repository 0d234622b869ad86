"""Geometric features of finished solids, and functions that check whether a face or an edge is such a feature.

The functions only use the solid: its faces, its surfaces, and its extents in the CAD kernel. All lengths are in mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, sqrt
from typing import Any, Literal

from build123d import Edge, Face
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.GeomAbs import GeomAbs_Circle, GeomAbs_Cone, GeomAbs_Cylinder, GeomAbs_Plane
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_REVERSED

TOLERANCE = 1e-6
"""Maximum distance of a feature from its intended position [mm]. For directions, the maximum length of the difference between unit
vectors.
"""

Vector = tuple[float, float, float]
Kind = Literal["plane", "hole", "shaft", "apex"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """A face of a solid, described by its geometry.

    A `plane` is a plane face that contains the point `on` and has the outward normal `axis`. A `hole` is a cylindrical face with the given
    `diameter` and with material outside, and a `shaft` has material inside. The axis of the cylindrical face is the line through `on` along
    `axis`, in either direction, and the face exists beside the point `on`. An `apex` is a conical face whose apex is at `on`. `rim` is the
    centre of the circle at the mouth of a hole. `rim` is None if the mouth is not a full circle. If the feature covers several faces,
    `other` contains a point on each additional face.
    """

    kind: Kind
    on: Vector
    axis: Vector
    diameter: float = 0.0
    rim: Vector | None = None
    other: tuple[Vector, ...] = ()


def is_feature(face: Face, feature: Feature) -> bool:
    """Return whether a face has the geometry of a feature."""
    surface = BRepAdaptor_Surface(face.wrapped)
    reversed_ = face.wrapped.Orientation() == TopAbs_REVERSED
    kind = surface.GetType()
    points = (feature.on, *feature.other)
    if feature.kind == "plane":
        if kind != GeomAbs_Plane:
            return False
        plane = surface.Plane()
        normal = _vector(plane.XAxis().Direction().Crossed(plane.YAxis().Direction()))
        if reversed_:
            normal = (-normal[0], -normal[1], -normal[2])
        if distance(normal, feature.axis) > TOLERANCE:
            return False
        origin = _vector(plane.Location())
        level = dot(minus(feature.on, origin), normal)
        return abs(level) <= TOLERANCE and any(_reaches(face, point) for point in points)
    if feature.kind == "apex":
        return kind == GeomAbs_Cone and distance(_vector(surface.Cone().Apex()), feature.on) <= TOLERANCE
    if kind != GeomAbs_Cylinder:
        return False
    cylinder = surface.Cylinder()
    hole = cylinder.Direct() == reversed_
    if hole != (feature.kind == "hole") or abs(2 * cylinder.Radius() - feature.diameter) > TOLERANCE:
        return False
    along, origin = _vector(cylinder.Axis().Direction()), _vector(cylinder.Location())
    if not _parallel(along, feature.axis):
        return False
    for point in points:
        to = minus(point, origin)
        height = dot(to, along)
        beside = minus(to, (height * along[0], height * along[1], height * along[2]))
        within = surface.FirstVParameter() - TOLERANCE <= height <= surface.LastVParameter() + TOLERANCE
        if within and hypot(*beside) <= TOLERANCE:
            return True
    return False


def is_rim(edge: Edge, feature: Feature) -> bool:
    """Return whether an edge is the circle at the mouth of a hole feature."""
    if feature.rim is None or BRep_Tool.Degenerated_s(edge.wrapped):
        return False
    curve = BRepAdaptor_Curve(edge.wrapped)
    if curve.GetType() != GeomAbs_Circle:
        return False
    circle = curve.Circle()
    return (
        abs(2 * circle.Radius() - feature.diameter) <= TOLERANCE
        and distance(_vector(circle.Location()), feature.rim) <= TOLERANCE
        and _parallel(_vector(circle.Axis().Direction()), feature.axis)
    )


def minus(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def distance(a: Vector, b: Vector) -> float:
    return sqrt(dot(minus(a, b), minus(a, b)))


def _parallel(a: Vector, b: Vector) -> bool:
    return min(distance(a, b), distance(a, (-b[0], -b[1], -b[2]))) <= TOLERANCE


def _reaches(face: Face, point: Vector) -> bool:
    """Return whether a point in the plane of a face is inside the face or on its border."""
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex()
    return BRepExtrema_DistShapeShape(face.wrapped, vertex).Value() <= TOLERANCE


def _vector(xyz: Any) -> Vector:
    return (xyz.X(), xyz.Y(), xyz.Z())

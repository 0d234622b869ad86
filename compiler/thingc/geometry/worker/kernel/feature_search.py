"""Find the cylinders and planar faces of a B-rep [mm] in the worker process. The module uses only OCP. The results are in metres."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.GeomAbs import GeomAbs_Cylinder, GeomAbs_Line, GeomAbs_Plane
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED, TopAbs_WIRE
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import dist
from thingc.base.pose import Vector
from thingc.geometry.features import HOLE, CentreLine, Cylinder, Features, PlanarFace
from thingc.geometry.worker.kernel import convert
from thingc.geometry.worker.kernel.integrals import subshapes

if TYPE_CHECKING:
    from collections.abc import Iterable

EQUAL = 1e-5
"""Largest difference [mm] of radii and of positions of axes, for which faces belong to the same cylinder."""
SAMPLES = 32
"""Number of points on a curved edge of a planar face."""


def features_of(shape: TopoDS_Shape, *, outlines: bool = True) -> Features:
    """Return the cylinders and planar faces of the solids in a shape. Without `outlines`, the planar faces have no `loops`."""
    planes: list[PlanarFace] = []
    faces: list[_CylinderFace] = []
    for face in map(TopoDS.Face, subshapes(shape, TopAbs_FACE)):
        surface = BRepAdaptor_Surface(face)
        if surface.GetType() == GeomAbs_Plane:
            planes.append(_plane(face, surface, outlines))
        elif surface.GetType() == GeomAbs_Cylinder:
            faces.append(_cylinder(face, surface))
    intersector = IntCurvesFace_ShapeIntersector()
    if faces:
        intersector.Load(shape, 1e-6)
    cylinders = [_in_metres(one, intersector) for one in _join_cylinders(faces)]
    return Features(
        cylinders=tuple(sorted(cylinders, key=lambda one: (one.line.axis, one.line.point, one.lower, one.radius))),
        planes=tuple(sorted(planes, key=lambda one: (one.normal, one.centre, one.area))),
    )


def area_and_centre(face: TopoDS_Face) -> tuple[float, Vector]:
    """Return the area and the centre of a face."""
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties)
    return properties.Mass(), properties.CentreOfMass().Coord()


def _plane(face: TopoDS_Face, surface: Any, outlines: bool) -> PlanarFace:
    position = surface.Plane().Position()
    outwards = position.Direct() != (face.Orientation() == TopAbs_REVERSED)
    x, y, z = (round(value if outwards else -value, 12) + 0.0 for value in position.Direction().Coord())
    area, centre = area_and_centre(face)
    loops = tuple(tuple(map(convert.vector, _polygon(wire, face))) for wire in subshapes(face, TopAbs_WIRE)) if outlines else ()
    return PlanarFace(normal=(x, y, z), centre=convert.vector(centre), area=convert.area(area), loops=loops)


def _polygon(wire: TopoDS_Shape, face: TopoDS_Face) -> list[Vector]:
    """Return points on the edges of a wire, in order. Straight edges have one point, and other edges have `SAMPLES` points."""
    points: list[Vector] = []
    explorer = BRepTools_WireExplorer(TopoDS.Wire(wire), face)
    while explorer.More():
        edge = explorer.Current()
        curve = BRepAdaptor_Curve(edge)
        first, last = curve.FirstParameter(), curve.LastParameter()
        if edge.Orientation() == TopAbs_REVERSED:
            first, last = last, first
        count = 1 if curve.GetType() == GeomAbs_Line else SAMPLES
        points += [curve.Value(first + (last - first) * k / count).Coord() for k in range(count)]
        explorer.Next()
    return points


class _CylinderFace(FrozenStruct):
    """A cylindrical face, or several faces of one cylinder: its axis, its range along the axis [mm], and its area [mm^2]."""

    line: CentreLine
    radius: float
    hollow: bool
    lower: float
    upper: float
    area: float


def _cylinder(face: TopoDS_Face, surface: Any) -> _CylinderFace:
    cylinder = surface.Cylinder()
    position = cylinder.Position()
    origin, axis = position.Location().Coord(), position.Direction().Coord()
    line = CentreLine.through(origin, axis)
    lower, upper = line.interval(origin, axis, (surface.FirstVParameter(), surface.LastVParameter()))
    hollow = position.Direct() == (face.Orientation() == TopAbs_REVERSED)
    return _CylinderFace(line=line, radius=cylinder.Radius(), hollow=hollow, lower=lower, upper=upper, area=area_and_centre(face)[0])


def _join_cylinders(faces: Iterable[_CylinderFace]) -> list[_CylinderFace]:
    """Join the faces of each cylinder whose ranges along the axis overlap or touch."""
    joined: list[_CylinderFace] = []
    for face in sorted(faces, key=lambda one: one.lower):
        number = next((number for number, one in enumerate(joined) if _continues(one, face)), None)
        if number is None:
            joined.append(face)
        else:
            one = joined[number]
            joined[number] = replace(one, upper=max(one.upper, face.upper), area=one.area + face.area)
    return joined


def _continues(one: _CylinderFace, other: _CylinderFace) -> bool:
    same_axis = dist(one.line.axis, other.line.axis) < 1e-7 and dist(one.line.point, other.line.point) < EQUAL
    return same_axis and one.hollow == other.hollow and abs(one.radius - other.radius) < EQUAL and other.lower <= one.upper + EQUAL


def _in_metres(face: _CylinderFace, intersector: Any) -> Cylinder:
    """Create a cylinder. A hole is open if its axis does not meet the part in the hole, or within a radius of its ends."""
    point, axis, radius = face.line.point, face.line.axis, face.radius
    sweep = min(2.0 * math.pi, face.area / (radius * (face.upper - face.lower)))
    through = face.hollow and sweep >= HOLE
    if through:
        intersector.Perform(gp_Lin(gp_Pnt(*point), gp_Dir(*axis)), face.lower - radius, face.upper + radius)
        through = intersector.NbPnt() == 0
    return Cylinder(
        line=CentreLine(point=convert.vector(point), axis=axis), radius=convert.length(radius), lower=convert.length(face.lower),
        upper=convert.length(face.upper), sweep=sweep, hollow=face.hollow, through=through,
    )

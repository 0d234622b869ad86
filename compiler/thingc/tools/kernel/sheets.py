"""Find the outlines of parts that can be cut from a sheet, in the worker process. Lengths of shapes are in mm, and results are in metres.

A part is flat if all of its faces are parallel or perpendicular to the sheet, and if all faces that point down are in one plane.
"""

from __future__ import annotations

import math
from typing import Any

from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepGProp import BRepGProp_Face
from OCP.Geom import Geom_TrimmedCurve
from OCP.GeomAbs import GeomAbs_Circle, GeomAbs_Line
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from thingc.base.pose import Vector, dot
from thingc.geometry.worker.kernel import convert
from thingc.geometry.worker.kernel.feature_search import area_and_centre
from thingc.geometry.worker.kernel.integrals import subshapes
from thingc.tools.workshop.curves import Arc, Curve, Sheet, Spline, StraightEdge

PARALLEL = 1e-9
"""Largest component of a unit vector for which it counts as perpendicular to a direction."""
LEVEL = 1e-6
"""Largest difference [mm] of the heights of faces in one plane."""
SAMPLES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Parameters of a face at which its normals are computed, as fractions of their ranges."""


def sheet_of(shape: TopoDS_Shape) -> Sheet:
    """Return the outlines of a flat part, or the reason why a part is not flat."""
    solids = list(subshapes(shape, TopAbs_SOLID))
    if len(solids) != 1:
        return Sheet(reason=f"it has {len(solids)} solids")
    unified = ShapeUpgrade_UnifySameDomain(solids[0], True, True, False)
    unified.Build()
    faces = [TopoDS.Face(face) for face in subshapes(unified.Shape(), TopAbs_FACE)]
    normals = {face: _normals(face) for face in faces}
    flat = [face for face in faces if all(dot(normals[face][0], other) > 1.0 - PARALLEL for other in normals[face])]
    if not flat:
        return Sheet(reason="it has no planar faces")
    up = normals[max(flat, key=lambda face: (round(area_and_centre(face)[0], 6), normals[face][0]))][0]
    levels: dict[float, list[tuple[float, TopoDS_Face]]] = {1.0: [], -1.0: []}
    for face in faces:
        rises = [dot(up, normal) for normal in normals[face]]
        if face in flat and abs(rises[0]) > 1.0 - PARALLEL:
            levels[math.copysign(1.0, rises[0])].append((dot(up, area_and_centre(face)[1]), face))
        elif max(map(abs, rises)) > PARALLEL:
            return Sheet(reason="it has a face that is neither parallel nor perpendicular to its largest face")
    return _outline(up, levels)


def _outline(up: Vector, levels: dict[float, list[tuple[float, TopoDS_Face]]]) -> Sheet:
    """Return the outlines of a part whose faces point along `up`, against it, or sideways. `levels` contains the heights of faces."""
    upper, lower = sorted(levels[1.0], key=lambda one: one[0]), sorted(levels[-1.0], key=lambda one: one[0])
    if lower[-1][0] - lower[0][0] > LEVEL or (upper[-1][0] - upper[0][0] <= LEVEL and up < (0.0, 0.0, 0.0)):
        x, y, z = up  # the other side is the upper side
        up, upper, lower = (-x, -y, -z), [(-at, face) for at, face in reversed(lower)], [(-at, face) for at, face in reversed(upper)]
    if lower[-1][0] - lower[0][0] > LEVEL:
        return Sheet(reason="it has pockets on both sides")
    thickness = upper[-1][0] - lower[0][0]
    lower_area = sum(area_and_centre(face)[0] for _, face in lower)
    if sum(area_and_centre(face)[0] for at, face in upper if upper[-1][0] - at <= LEVEL) < lower_area / 2.0:
        return Sheet(reason="it has the full thickness in less than half of its area")
    if thickness > math.sqrt(lower_area) / 2.0:
        return Sheet(reason=f"it is too thick for its area ({thickness:.6g} mm for {lower_area:.6g} mm^2)")
    onto = gp_Trsf()
    onto.SetTransformation(gp_Ax3(gp_Pnt(), gp_Dir(*up), gp_Dir(*_across(up))))
    cut = _edges((face for _, face in lower), TopLoc_Location(onto))
    engraved = _edges((face for at, face in upper if upper[-1][0] - at > LEVEL), TopLoc_Location(onto))
    return Sheet(
        thickness=convert.length(thickness), cut=tuple(cut.values()), engraved=tuple(engraved[key] for key in engraved if key not in cut),
    )


def _normals(face: TopoDS_Face) -> list[Vector]:
    """Return outward unit normals of a face on a grid of its parameters, without those at poles."""
    properties = BRepGProp_Face(face)
    first_u, last_u, first_v, last_v = properties.Bounds()
    found: list[Vector] = []
    for u in SAMPLES:
        for v in SAMPLES:
            point, normal = gp_Pnt(), gp_Vec()
            properties.Normal(first_u + u * (last_u - first_u), first_v + v * (last_v - first_v), point, normal)
            if normal.Magnitude() > 0.0:
                found.append(normal.Normalized().Coord())
    return found


def _across(up: Vector) -> Vector:
    """Return the x direction of the drawing: the x axis of the part, or the y axis if `up` is along x."""
    return (1.0, 0.0, 0.0) if abs(up[0]) < 0.9 else (0.0, 1.0, 0.0)


def _edges(faces: Any, place: TopLoc_Location) -> dict[tuple[Any, ...], Curve]:
    """Return the edges of faces as curves, without repetitions. Edges with equal keys are equal when rounded to 1 nm."""
    found: dict[tuple[Any, ...], Curve] = {}
    for face in faces:
        for edge in subshapes(face, TopAbs_EDGE):
            curve = curve_of(TopoDS.Edge(edge.Moved(place)))
            match curve:
                case StraightEdge(start=start, end=end):
                    numbers: tuple[float, ...] = (*min(start, end), *max(start, end))
                case Arc(centre=centre, radius=radius, start=first, end=last):
                    numbers = (*centre, radius, *(() if curve.full else (first, last)))
                case Spline(points=points):
                    numbers = tuple(value for point in min(points, points[::-1]) for value in point)
            found.setdefault((type(curve).__name__, *(round(value, 9) + 0.0 for value in numbers)), curve)
    return found


def curve_of(edge: TopoDS_Edge) -> Curve:
    """Return the projection of an edge to the plane z = 0, to which the edge is parallel."""
    adaptor = BRepAdaptor_Curve(edge)
    first, last = adaptor.FirstParameter(), adaptor.LastParameter()
    if adaptor.GetType() == GeomAbs_Line:
        return StraightEdge(start=_point(adaptor.Value(first)), end=_point(adaptor.Value(last)))
    if adaptor.GetType() == GeomAbs_Circle:
        circle = adaptor.Circle()
        centre, sweep = _point(circle.Location()), last - first
        begin = adaptor.Value(first if circle.Axis().Direction().Z() > 0.0 else last)
        angle = math.atan2(begin.Y() - circle.Location().Y(), begin.X() - circle.Location().X())
        angle = 0.0 if sweep > 2.0 * math.pi - PARALLEL else angle
        return Arc(centre=centre, radius=convert.length(circle.Radius()), start=angle, end=angle + sweep)
    spline = GeomConvert.CurveToBSplineCurve_s(Geom_TrimmedCurve(BRep_Tool.Curve_s(edge, 0.0, 1.0), first, last))
    if spline.IsPeriodic():
        spline.SetNotPeriodic()
    knots = [spline.Knot(k) for k in range(1, spline.NbKnots() + 1) for _ in range(spline.Multiplicity(k))]
    count = range(1, spline.NbPoles() + 1)
    return Spline(
        degree=spline.Degree(), points=tuple(_point(spline.Pole(k)) for k in count), weights=tuple(spline.Weight(k) for k in count),
        knots=tuple(knots),
    )


def _point(point: Any) -> tuple[float, float]:
    return convert.length(point.X()) + 0.0, convert.length(point.Y()) + 0.0

"""Find the cylinders and planar faces of a B-rep [mm] in the worker process. The module uses only OCP. The results are in metres."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from msgspec import to_builtins
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.GeomAbs import GeomAbs_Cylinder, GeomAbs_Line, GeomAbs_Plane
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED, TopAbs_WIRE
from OCP.TopoDS import TopoDS

from thingc.base.numeric import dist
from thingc.base.pose import Vector, added, dot
from thingc.geometry.features import Cylinder, Features, PlanarFace
from thingc.geometry.worker.kernel import convert
from thingc.geometry.worker.kernel.integrals import explored
from thingc.geometry.worker.kernel.step_assembly import load_shape

if TYPE_CHECKING:
    from collections.abc import Iterable

    from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

    from thingc.geometry.store.local import Store

EQUAL = 1e-5
"""Largest difference [mm] of radii and of positions of axes, for which faces belong to the same cylinder."""
SAMPLES = 32
"""Number of points on a curved edge of a planar face."""


def features_of(shape: TopoDS_Shape) -> Features:
    """Return the cylinders and planar faces of the solids in a shape."""
    planes: list[PlanarFace] = []
    faces: list[tuple[Vector, Vector, float, bool, float, float, float]] = []
    for face in map(TopoDS.Face, explored(shape, TopAbs_FACE)):
        surface = BRepAdaptor_Surface(face)
        if surface.GetType() == GeomAbs_Plane:
            planes.append(_plane(face, surface))
        elif surface.GetType() == GeomAbs_Cylinder:
            faces.append(_cylinder(face, surface))
    intersector = IntCurvesFace_ShapeIntersector()
    if faces:
        intersector.Load(shape, 1e-6)
    cylinders = [_in_metres(*one, intersector) for one in _joined(faces)]
    return Features(
        cylinders=tuple(sorted(cylinders, key=lambda one: (one.axis, one.point, one.lower, one.radius))),
        planes=tuple(sorted(planes, key=lambda one: (one.normal, one.centre, one.area))),
    )


def features_in_store(breps: Iterable[str], store: Store) -> dict[str, Any]:
    """Return the features of B-reps in the store as JSON values, by the digests of the B-reps."""
    return {brep: to_builtins(features_of(load_shape(store, brep))) for brep in breps}


def area_and_centre(face: TopoDS_Face) -> tuple[float, Vector]:
    """Return the area and the centre of a face."""
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties)
    return properties.Mass(), properties.CentreOfMass().Coord()


def _plane(face: TopoDS_Face, surface: Any) -> PlanarFace:
    position = surface.Plane().Position()
    outwards = position.Direct() != (face.Orientation() == TopAbs_REVERSED)
    x, y, z = (_rounded(value if outwards else -value) for value in position.Direction().Coord())
    area, centre = area_and_centre(face)
    loops = tuple(tuple(map(convert.vector, _polygon(wire, face))) for wire in map(TopoDS.Wire, explored(face, TopAbs_WIRE)))
    return PlanarFace(normal=(x, y, z), centre=convert.vector(centre), area=convert.area(area), loops=loops)


def _polygon(wire: Any, face: TopoDS_Face) -> list[Vector]:
    """Return points on the edges of a wire, in order. Straight edges have one point, and other edges have `SAMPLES` points."""
    points: list[Vector] = []
    explorer = BRepTools_WireExplorer(wire, face)
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


def _cylinder(face: TopoDS_Face, surface: Any) -> tuple[Vector, Vector, float, bool, float, float, float]:
    """Return the closest point of the axis, its direction, the radius, whether the face is hollow, the range along the axis, and the area.

    The direction is chosen so that equal axes have equal directions.
    """
    cylinder = surface.Cylinder()
    position = cylinder.Position()
    hollow = position.Direct() == (face.Orientation() == TopAbs_REVERSED)
    origin, axis = position.Location().Coord(), tuple(map(_rounded, position.Direction().Coord()))
    lower, upper = surface.FirstVParameter(), surface.LastVParameter()
    if next(value for value in reversed(axis) if value) < 0.0:
        axis, lower, upper = tuple(-value + 0.0 for value in axis), -upper, -lower
    x, y, z = axis
    along = dot(origin, (x, y, z))
    return added(origin, (x, y, z), -along), (x, y, z), cylinder.Radius(), hollow, lower + along, upper + along, area_and_centre(face)[0]


def _rounded(value: float) -> float:
    return round(value, 12) + 0.0


def _joined(
    faces: list[tuple[Vector, Vector, float, bool, float, float, float]],
) -> list[tuple[Vector, Vector, float, bool, float, float, float]]:
    """Join the faces of each cylinder whose ranges along the axis overlap or touch."""
    joined: list[tuple[Vector, Vector, float, bool, float, float, float]] = []
    for point, axis, radius, hollow, lower, upper, area in sorted(faces, key=lambda one: one[4]):
        for number, (at, along, size, inside, low, high, covered) in enumerate(joined):
            same = hollow == inside and abs(radius - size) < EQUAL and dist(axis, along) < 1e-7 and dist(point, at) < EQUAL
            if same and lower <= high + EQUAL:
                joined[number] = (at, along, size, inside, low, max(high, upper), covered + area)
                break
        else:
            joined.append((point, axis, radius, hollow, lower, upper, area))
    return joined


def _in_metres(
    point: Vector, axis: Vector, radius: float, hollow: bool, lower: float, upper: float, area: float, intersector: Any,
) -> Cylinder:
    """Create a cylinder. A full hole is open if its axis does not meet the part in the hole, or within a radius of its ends."""
    sweep = min(2.0 * math.pi, area / (radius * (upper - lower)))
    through = hollow and sweep > 2.0 * math.pi - 0.01
    if through:
        intersector.Perform(gp_Lin(gp_Pnt(*point), gp_Dir(*axis)), lower - radius, upper + radius)
        through = intersector.NbPnt() == 0
    return Cylinder(
        point=convert.vector(point), axis=axis, radius=convert.length(radius), lower=convert.length(lower), upper=convert.length(upper),
        sweep=sweep, hollow=hollow, through=through,
    )

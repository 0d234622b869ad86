"""Triangles of shapes: against analytic volumes, and against the kernel's own mesh of the whole shape."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from build123d import (
    Axis,
    Box,
    Compound,
    Cone,
    Cylinder,
    Edge,
    Face,
    Location,
    Plane,
    Pos,
    RegularPolygon,
    Rot,
    Shape,
    Solid,
    Sphere,
    Text,
    Torus,
    Wire,
    chamfer,
    extrude,
    fillet,
)
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.gp import gp_Ax2, gp_Dir, gp_Pln, gp_Pnt, gp_Trsf
from OCP.TopAbs import TopAbs_FACE
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

from thingc.geometry.worker.kernel import tessellation
from thingc.geometry.worker.kernel.integrals import solids_of, subshapes
from thingc.geometry.worker.kernel.meshing import Triangles
from thingc.geometry.worker.kernel.tessellation import tessellate

LINEAR, ANGULAR = 0.1, math.radians(15.0)


def imprinted(outer: Shape[Any], inner: Shape[Any]) -> Shape[Any]:
    """Fuse both shapes and keep their common faces as separate faces."""
    fused = BRepAlgoAPI_Fuse(outer.solid().wrapped, inner.solid().wrapped)
    fused.Build()
    return Compound(fused.Shape())


def placed_mirrored(shape: Shape[Any]) -> Shape[Any]:
    """Return the shape with a mirrored location, so that its faces are turned inside out. `mirror` would create new faces."""
    over = gp_Trsf()
    over.SetMirror(gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, 0, 0)))
    return Solid(shape.solid().wrapped.Located(TopLoc_Location(over), False))


SHAPES: dict[str, Callable[[], Shape[Any]]] = {
    "a plate with holes": lambda: Box(40, 30, 3).cut(
        *(Pos(6 * x - 15, 6 * y - 9, 0) * Cylinder(1 + 0.2 * x, 9) for x in range(6) for y in range(4))
    ),
    "letters": lambda: Box(60, 12, 2).cut(Pos(0, 0, 0.5) * extrude(Text("Robot 80", 9), 2)),
    "rounded": lambda: fillet(Box(20, 30, 10).edges(), 3),
    "bevelled": lambda: chamfer(Cylinder(8, 10).edges(), 1),
    "turned": lambda: Rot(20, 35, 50) * Pos(3, 2, 1) * Box(8, 9, 10).cut(Pos(0, 0, 2) * Sphere(4)),
    "mirrored": lambda: Solid(Box(8, 9, 10).cut(Pos(2, 3, 0) * Cone(1, 2, 12)).solid().mirror(Plane.YZ).wrapped),
    "placed mirrored": lambda: placed_mirrored(Box(8, 9, 10).cut(Pos(2, 3, 0) * Cone(1, 2, 12))),
    "a face with an island": lambda: Box(20, 20, 4).cut(Pos(0, 0, 1) * (Cylinder(7, 4) - Cylinder(4, 9))),
    "a circle within a plane": lambda: imprinted(Box(20, 20, 4), Pos(0, 0, 1) * Cylinder(5, 2)),
    "a hole by the rim": lambda: Cylinder(20, 3).cut(Rot(0, 0, 5) * Pos(14.99, 0, 0) * Cylinder(5, 9)),
    "a hole that touches an edge": lambda: Box(20, 20, 3).cut(Pos(5, 0, 0) * Cylinder(5, 9)),
    "round all over": lambda: Torus(10, 3),
}


def of_the_kernel(shape: Any) -> tuple[int, float, float]:
    """Return the number of triangles that the kernel makes of all faces, their area [mm^2] and the enclosed volume [mm^3]."""
    BRepTools.Clean_s(shape)
    BRepMesh_IncrementalMesh(shape, LINEAR, False, ANGULAR * (1.0 + 1e-6), False)
    count, area, volume = 0, 0.0, 0.0
    for subshape in subshapes(shape, TopAbs_FACE):
        face, location = TopoDS.Face(subshape), TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face, location)
        moved = location.Transformation()
        places = np.array([mesh.Node(k).Transformed(moved).Coord() for k in range(1, mesh.NbNodes() + 1)])
        a, b, c = (places[[mesh.Triangle(k).Get()[corner] - 1 for k in range(1, mesh.NbTriangles() + 1)]] for corner in range(3))
        across = np.cross(b - a, c - a)
        turned = (face.Orientation().name == "TopAbs_REVERSED") != moved.IsNegative()
        count += int((np.linalg.norm(across, axis=1) > 0.0).sum())  # around a pole it has some that are flat
        area += float(np.linalg.norm(across, axis=1).sum() / 2.0)
        volume += float(np.einsum("ij,ij->", a, across) / 6.0) * (-1.0 if turned else 1.0)
    return count, area, volume


def area_of_each(mesh: Triangles) -> NDArray[np.float64]:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0)


def area_of(mesh: Triangles) -> float:
    return float(area_of_each(mesh).sum())


@pytest.mark.parametrize("name", SHAPES)
def test_surface_matches_the_kernel_mesh(name: str) -> None:
    """Points on planes are those of their neighbours, so area and volume equal those of the kernel, whatever the direction of the
    triangles."""
    for solid in solids_of(SHAPES[name]().wrapped):
        count, area, volume = of_the_kernel(solid)
        mesh = tessellate(solid, LINEAR, ANGULAR)
        assert mesh.closed and len(mesh.faces) == count
        assert area_of(mesh) == pytest.approx(area, rel=1e-6) and mesh.volume == pytest.approx(volume, rel=1e-6)
        assert area_of_each(mesh).min() > 0.0


def test_planar_solids_are_exact_without_the_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    """A prism: its volume is the area of a hexagon (3/2 sqrt(3) r^2) times its height. The kernel makes no triangles."""

    def refused(*_: Any) -> None:
        raise AssertionError("the kernel was asked for triangles")

    monkeypatch.setattr(tessellation, "BRepMesh_IncrementalMesh", refused)
    prism = Location((1, 2, 3), (10, 20, 30)) * extrude(RegularPolygon(5, 6), 7)
    mesh = tessellate(prism.wrapped, LINEAR, ANGULAR)
    assert mesh.closed and (len(mesh.vertices), len(mesh.faces)) == (12, 20)
    assert mesh.volume == pytest.approx(1.5 * math.sqrt(3.0) * 25.0 * 7.0, rel=1e-12)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the number of faces that the kernel tessellates, per call."""
    counts: list[int] = []

    def noted(shape: Any, *arguments: Any) -> Any:
        counts.append(len([*subshapes(shape, TopAbs_FACE)]))
        return BRepMesh_IncrementalMesh(shape, *arguments)

    monkeypatch.setattr(tessellation, "BRepMesh_IncrementalMesh", noted)
    return counts


@pytest.mark.parametrize("turned", [Rot(0, 0, 0), Rot(11, 22, 33)])
def test_rows_of_holes_are_not_left_to_the_kernel(turned: Location, asked: list[int]) -> None:
    """Corners of different holes are collinear, and manifold3d handles this case. The kernel takes six times as long for these hundred
    holes. Each hole is a polygon of n corners with area n / 2 sin(2 pi / n) r^2."""
    holes = [Wire.make_circle(0.35, Plane((x, y, 0))) for x in range(10) for y in range(10)]
    plate = turned * extrude(Face(Wire.make_rect(10, 10, Plane((4.5, 4.5, 0))), holes), 2)
    mesh = tessellate(plate.wrapped, LINEAR, ANGULAR)
    assert mesh.closed and asked == [100]
    corners = (len(mesh.vertices) - 8) / 200
    assert corners >= 24
    assert mesh.volume == pytest.approx(200.0 - 100.0 * corners * math.sin(2.0 * math.pi / corners) * 0.35**2, rel=1e-9)
    assert area_of_each(mesh).min() > 1e-6


def test_crossing_borders_are_left_to_the_kernel(asked: list[int]) -> None:
    """If a hole is nearer to the rim than the chords are to their arcs, the kernel uses finer triangles, and the whole shape is its
    mesh."""
    disc = SHAPES["a hole by the rim"]().solid().wrapped
    mesh = tessellate(disc, LINEAR, ANGULAR)
    assert mesh.closed and asked == [2, 4]  # the walls, and then everything
    assert mesh.volume == pytest.approx(math.pi * (400.0 - 25.0) * 3.0, rel=0.02)


def test_face_without_a_solid_is_tessellated() -> None:
    """`visual()` may return a sheet: a square with a round hole, whose edge has no other face."""
    sheet = (Plane.XY * Box(10, 10, 1).cut(Cylinder(2, 3))).faces().sort_by(Axis.Z)[-1]
    mesh = tessellate(sheet.wrapped, 0.01, ANGULAR)
    assert area_of(mesh) == pytest.approx(100.0 - 4.0 * math.pi, rel=2e-3)
    assert (np.cross(*(mesh.vertices[mesh.faces[:, k]] - mesh.vertices[mesh.faces[:, 0]] for k in (1, 2)))[:, 2] > 0.0).all()


def test_unbounded_plane_has_no_triangles() -> None:
    """The plane is infinite; the kernel does not tessellate it either."""
    assert len(tessellate(BRepBuilderAPI_MakeFace(gp_Pln()).Face(), LINEAR, ANGULAR).faces) == 0


def test_rounding_does_not_change_the_facet_count() -> None:
    """An arc of 180 deg has 12 facets of 15 deg, for every radius."""
    counts = set()
    for radius in np.linspace(5.0, 8.0, 24):
        over = Edge.make_three_point_arc((-radius, 0, 3), (0, 0, 3 + radius), (radius, 0, 3))
        under = Wire.make_polygon([(radius, 0, 3), (radius, 0, 0), (-radius, 0, 0), (-radius, 0, 3)], close=False)
        arch = Solid.extrude(Face(Wire([over, *under.edges()])), (0, 10, 0))
        counts.add(len(tessellate(arch.wrapped, LINEAR, ANGULAR).faces))
    assert len(counts) == 1

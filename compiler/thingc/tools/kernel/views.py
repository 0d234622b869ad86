"""Project the edges of a part to the views of a drawing, without hidden lines, in the worker process. The module uses only OCP."""

from __future__ import annotations

from typing import Any

from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepLib import BRepLib
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GeomAbs import GeomAbs_Cone, GeomAbs_Cylinder, GeomAbs_Plane, GeomAbs_Sphere
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.HLRAlgo import HLRAlgo_Projector
from OCP.HLRBRep import HLRBRep_Algo, HLRBRep_HLRToShape, HLRBRep_PolyAlgo, HLRBRep_PolyHLRToShape
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS, TopoDS_Shape

from thingc.geometry.worker.kernel.integrals import subshapes
from thingc.tools.kernel.sheets import curve_of
from thingc.tools.workshop.curves import VIEWS, Curve, View, Views

EXACT = frozenset({GeomAbs_Plane, GeomAbs_Cylinder, GeomAbs_Cone, GeomAbs_Sphere})
"""Surfaces that are projected exactly."""
DEFLECTION, ANGLE = 0.002, 0.15
"""Largest deviation of triangles, relative to the size of an edge, and the largest angle between them [rad]."""


def views_of(shape: TopoDS_Shape) -> Views:
    """Return all views of a shape.

    The exact algorithm of the kernel takes minutes for free-form surfaces. Parts with such surfaces are projected as triangles.
    """
    surfaces = (BRepAdaptor_Surface(TopoDS.Face(face)).GetType() for face in subshapes(shape, TopAbs_FACE))
    exact = all(surface in EXACT for surface in surfaces)
    if not exact:
        BRepMesh_IncrementalMesh(shape, DEFLECTION, True, ANGLE)
    views: dict[str, View] = {}
    for name, (toward, right) in VIEWS.items():
        projector = HLRAlgo_Projector(gp_Ax2(gp_Pnt(), gp_Dir(*toward), gp_Dir(*right)))
        edges = _project(shape, projector) if exact else _projected_triangles(shape, projector)
        views[name] = View(
            visible=_curves(edges.VCompound(), edges.OutLineVCompound()),
            hidden=() if name == "isometric" else _curves(edges.HCompound(), edges.OutLineHCompound()),
        )
    return Views(by_name=views)


def _project(shape: TopoDS_Shape, projector: Any) -> Any:
    algorithm = HLRBRep_Algo()
    algorithm.Add(shape, 0)
    algorithm.Projector(projector)
    algorithm.Update()
    algorithm.Hide()
    return HLRBRep_HLRToShape(algorithm)


def _projected_triangles(shape: TopoDS_Shape, projector: Any) -> Any:
    algorithm = HLRBRep_PolyAlgo()
    algorithm.Load(shape)
    algorithm.Projector(projector)
    algorithm.Update()
    edges = HLRBRep_PolyHLRToShape()
    edges.Update(algorithm)
    return edges


def _curves(*compounds: Any) -> tuple[Curve, ...]:
    found: list[Curve] = []
    for compound in compounds:
        if compound is not None and not compound.IsNull():
            BRepLib.BuildCurves3d_s(compound)
            found += [curve_of(TopoDS.Edge(edge)) for edge in subshapes(compound, TopAbs_EDGE)]
    return tuple(sorted(found, key=repr))  # the kernel returns edges in the order of their addresses in memory

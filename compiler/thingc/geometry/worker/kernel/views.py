"""Project the edges of a part to the views of a drawing, without hidden lines, in the worker process. The module uses only OCP."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from OCP.BRepLib import BRepLib
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.HLRAlgo import HLRAlgo_Projector
from OCP.HLRBRep import HLRBRep_Algo, HLRBRep_HLRToShape
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS

from thingc.geometry.features import VIEWS, Curve, View, Views
from thingc.geometry.worker.kernel.integrals import explored
from thingc.geometry.worker.kernel.sheets import curve_of

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape


def views_of(shape: TopoDS_Shape) -> Views:
    """Return all views of a shape."""
    views: dict[str, View] = {}
    for name, (toward, right) in VIEWS.items():
        algorithm = HLRBRep_Algo()
        algorithm.Add(shape, 0)
        algorithm.Projector(HLRAlgo_Projector(gp_Ax2(gp_Pnt(), gp_Dir(*toward), gp_Dir(*right))))
        algorithm.Update()
        algorithm.Hide()
        edges = HLRBRep_HLRToShape(algorithm)
        views[name] = View(
            visible=_curves(edges.VCompound(), edges.OutLineVCompound()),
            hidden=() if name == "isometric" else _curves(edges.HCompound(), edges.OutLineHCompound()),
        )
    return Views(by_name=views)


def _curves(*compounds: Any) -> tuple[Curve, ...]:
    found: list[Curve] = []
    for compound in compounds:
        if compound is not None and not compound.IsNull():
            BRepLib.BuildCurves3d_s(compound)
            found += [curve_of(TopoDS.Edge(edge)) for edge in explored(compound, TopAbs_EDGE)]
    return tuple(found)

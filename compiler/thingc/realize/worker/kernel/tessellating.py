"""From B-rep to triangles: one watertight mesh per shape.

Vertices are joined along the kernel's own edges, not by distance: the two faces at an edge are cut at the same parameters
but may lie a tolerance apart.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

from thingc.realize.worker.kernel.measure import explored
from thingc.realize.worker.kernel.meshing import Triangles, without_slivers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from OCP.TopoDS import TopoDS_Shape


def tessellate(shape: TopoDS_Shape, linear: float, angular: float) -> Triangles:
    """Triangles of a shape [mm], at most `linear` [mm] off its surface and `angular` [rad] between neighbours. Whatever it was
    meshed with before does not matter, and is forgotten."""
    BRepTools.Clean_s(shape)  # the kernel keeps finer triangles that it finds
    BRepMesh_IncrementalMesh(shape, linear, False, angular, False)
    vertices: list[tuple[float, float, float]] = []
    triangles = [np.zeros((0, 3), dtype=np.int64)]
    ones: list[int] = []
    others: list[int] = []
    edges = _ShapeIndex()
    along: dict[int, list[int]] = {}
    for subshape in explored(shape, TopAbs_FACE):
        face = TopoDS.Face(subshape)
        location = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face, location)
        if mesh is None:
            continue
        offset = len(vertices) - 1  # the kernel counts from 1
        moved = None if location.IsIdentity() else location.Transformation()
        nodes = map(mesh.Node, range(1, mesh.NbNodes() + 1))
        vertices += [node.Coord() if moved is None else node.Transformed(moved).Coord() for node in nodes]
        turned = (face.Orientation() == TopAbs_REVERSED) != (moved is not None and moved.IsNegative())
        corners = np.array([triangle.Get() for triangle in map(mesh.Triangle, range(1, mesh.NbTriangles() + 1))], dtype=np.int64)
        triangles.append(corners.reshape(-1, 3)[:, (0, 2, 1) if turned else (0, 1, 2)] + offset)
        for found_edge in explored(face, TopAbs_EDGE):
            edge = TopoDS.Edge(found_edge)
            polygon = BRep_Tool.PolygonOnTriangulation_s(edge, mesh, location)
            if polygon is None:
                continue
            chain = [number + offset for number in map(polygon.Node, range(1, polygon.NbNodes() + 1))]
            known = [chain[0]] * len(chain) if BRep_Tool.Degenerated_s(edge) else along.setdefault(edges.index(edge), chain)
            if len(known) == len(chain):
                ones += known
                others += chain
    joins = joined(len(vertices), ones, others)
    return without_slivers(np.array(vertices, dtype=np.float64).reshape(-1, 3), joins[np.concatenate(triangles)])


def joined(count: int, ones: Sequence[int], others: Sequence[int]) -> NDArray[np.int64]:
    """For each of `count` vertices (count,) the lowest of those that it is one with, where `ones[i]` is one with `others[i]`."""
    a, b = np.array(ones, dtype=np.int64), np.array(others, dtype=np.int64)
    stands = np.arange(count)
    while True:  # each turn doubles, at least, how far the lowest number has come
        lowest = np.minimum(stands[a], stands[b])
        fewer = stands.copy()
        np.minimum.at(fewer, stands[a], lowest)
        np.minimum.at(fewer, stands[b], lowest)
        np.minimum.at(fewer, a, lowest)
        np.minimum.at(fewer, b, lowest)
        fewer = fewer[fewer]
        if np.array_equal(fewer, stands):
            return stands
        stands = fewer


class _ShapeIndex:
    """Numbers for shapes: the same one for the same shape at the same place, whichever way it is turned."""

    def __init__(self) -> None:
        self.buckets: dict[int, list[tuple[TopoDS_Shape, int]]] = {}
        self.count = 0

    def index(self, shape: TopoDS_Shape) -> int:
        bucket = self.buckets.setdefault(hash(shape), [])
        for held, number in bucket:
            if held.IsSame(shape):
                return number
        self.count += 1
        bucket.append((shape, self.count))
        return self.count

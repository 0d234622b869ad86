"""Tessellate each shape of a B-rep into one watertight mesh.

Vertices are merged along the edges of the CAD kernel, and not by distance. At a common edge, the points of two faces have the same
parameters, but their positions may differ by a tolerance.

The kernel meshes curved faces. manifold3d fills plane faces with triangles between the points of their boundaries. The surface is the same,
and manifold3d is several times as fast as the kernel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from manifold3d import triangulate
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.GeomAbs import GeomAbs_Line, GeomAbs_Plane
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from thingc.base.frozen_struct import FrozenStruct
from thingc.geometry.worker.kernel.integrals import make_compound, subshapes
from thingc.geometry.worker.kernel.meshing import Triangles, without_slivers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


_THIN = 1e-12
"""The corners of a triangle count as collinear if twice its area, relative to the square of its longest side, is at most this value."""
_ROUND_ANGLES = 1e-6
"""Relative increase of the angular tolerance. Without this increase, rounding errors would decide whether an arc of 180 deg has 18 or 19
facets of 10 deg.
"""


def tessellate(shape: TopoDS_Shape, linear: float, angular: float) -> Triangles:
    """Tessellate a shape [mm] into one watertight mesh.

    The distance of triangles from the surface is at most `linear` [mm]. The angle between neighbouring triangles is at most `angular`
    [rad].

    An earlier mesh of the shape is removed and does not affect the result.
    """
    numbers = ShapeMap()
    faces = [_face(TopoDS.Face(face), numbers) for face in subshapes(shape, TopAbs_FACE)]
    curved_edges = {number for face in faces if not face.plane for number in face.numbers}
    filled = [
        face.plane and all(number in curved_edges or _straight(edge) for edge, number in zip(face.edges, face.numbers, strict=True))
        for face in faces
    ]
    by_kernel = [False] * len(faces)
    mesh = _mesh_shape(shape, faces, filled, linear, angular) or _mesh_shape(shape, faces, by_kernel, linear, angular)
    assert mesh is not None
    return mesh


class _Face(FrozenStruct, kw_only=False):
    """A face of a shape that is tessellated.

    `edges` contains the edges of the face, each with a number. A shared edge has the same number in both faces. `plane` is True if the
    surface of the face is a plane.
    """

    face: TopoDS_Face
    edges: tuple[TopoDS_Edge, ...]
    numbers: tuple[int, ...]
    plane: bool


def _face(face: TopoDS_Face, numbers: ShapeMap) -> _Face:
    edges = tuple(map(TopoDS.Edge, subshapes(face, TopAbs_EDGE)))
    plane = BRepAdaptor_Surface(face, False).GetType() == GeomAbs_Plane
    return _Face(face, edges, tuple(map(numbers.Add, edges)), plane)


def _straight(edge: TopoDS_Edge) -> bool:
    return not BRep_Tool.Degenerated_s(edge) and BRepAdaptor_Curve(edge).GetType() == GeomAbs_Line


def _mesh_shape(shape: TopoDS_Shape, faces: Sequence[_Face], filled: Sequence[bool], linear: float, angular: float) -> Triangles | None:
    """Tessellate a shape and return its triangles. manifold3d fills the faces in `filled`, and the kernel meshes the other faces.

    Return None if a face in `filled` cannot be filled.
    """
    BRepTools.Clean_s(shape)  # otherwise, the kernel would keep an existing finer mesh
    points = _Points()
    others = [face for face, one in zip(faces, filled, strict=True) if not one]
    if others:
        BRepMesh_IncrementalMesh(make_compound(face.face for face in others), linear, False, angular * (1.0 + _ROUND_ANGLES), False)
    triangles = [np.zeros((0, 3), dtype=np.int64), *(points.of_kernel(face) for face in others)]
    planes = [face for face, one in zip(faces, filled, strict=True) if one]
    bounds = [points.rings(face) for face in planes]
    joins = merge_vertices(len(points.places), points.ones, points.others)
    places = np.array(points.places, dtype=np.float64).reshape(-1, 3)
    triangles = [joins[some] for some in triangles]
    for face, rings in zip(planes, bounds, strict=True):
        inside = _filling(face.face, [joins[ring] for ring in rings], places) if rings else None
        if inside is None:
            return None
        triangles.append(inside)
    return without_slivers(places, np.concatenate(triangles))


class _Points:
    """The points of a mesh that is being constructed.

    `places` contains the positions of the points [mm]. The points with the numbers `ones[i]` and `others[i]` are the same vertex of the
    mesh.
    """

    def __init__(self) -> None:
        self.places: list[tuple[float, float, float]] = []
        self.ones: list[int] = []
        self.others: list[int] = []
        self._along: dict[int, list[int]] = {}
        """The points of each edge by its number, in the order of its parameter."""
        self._vertices = ShapeMap()
        self._corners: dict[int, int] = {}

    def of_kernel(self, face: _Face) -> NDArray[np.int64]:
        """Add the points of a face that the CAD kernel has meshed. Return the triangles of this face as point numbers (n, 3)."""
        location = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face.face, location)
        if mesh is None:
            return np.zeros((0, 3), dtype=np.int64)
        offset = len(self.places) - 1  # indices of the kernel start at 1
        moved = None if location.IsIdentity() else location.Transformation()
        nodes = map(mesh.Node, range(1, mesh.NbNodes() + 1))
        self.places += [node.Coord() if moved is None else node.Transformed(moved).Coord() for node in nodes]
        for edge, number in zip(face.edges, face.numbers, strict=True):
            polygon = BRep_Tool.PolygonOnTriangulation_s(edge, mesh, location)
            if polygon is None:
                continue
            chain = [node + offset for node in map(polygon.Node, range(1, polygon.NbNodes() + 1))]
            known = [chain[0]] * len(chain) if BRep_Tool.Degenerated_s(edge) else self._along.setdefault(number, chain)
            if len(known) == len(chain):
                self.ones += known
                self.others += chain
        reversed_face = (face.face.Orientation() == TopAbs_REVERSED) != (moved is not None and moved.IsNegative())
        corners = np.array([triangle.Get() for triangle in map(mesh.Triangle, range(1, mesh.NbTriangles() + 1))], dtype=np.int64)
        return np.asarray(corners.reshape(-1, 3)[:, (0, 2, 1) if reversed_face else (0, 1, 2)] + offset)

    def rings(self, face: _Face) -> list[list[int]] | None:
        """Return the boundaries of a plane face and of its holes, as lists of point numbers.

        Seen from outside, the face is to the left of each boundary. Return None if the order of the edges is ambiguous.
        """
        chains: dict[int, tuple[list[int], int]] = {}
        for edge, number in zip(face.edges, face.numbers, strict=True):
            ends = [self._corner(edge, first) for first in (True, False)]
            chain = self._along.get(number)
            if chain is None:
                chain = ends
            else:
                self.ones += ends
                self.others += (chain[0], chain[-1])
            orientation = edge.Orientation()
            if orientation == TopAbs_REVERSED:
                chain, ends = chain[::-1], ends[::-1]
            if ends[0] in chains or orientation not in (TopAbs_FORWARD, TopAbs_REVERSED):
                return None
            chains[ends[0]] = chain[:-1], ends[1]
        rings: list[list[int]] = []
        while chains:
            begin, (ring, end) = chains.popitem()
            while end != begin:
                if end not in chains:
                    return None
                chain, end = chains.pop(end)
                ring = ring + chain
            rings.append(ring)
        mirrored = face.face.Location().Transformation().IsNegative()  # mirrored edges have the same order, but the opposite direction
        return [ring[::-1] for ring in rings] if mirrored else rings

    def _corner(self, edge: TopoDS_Edge, first: bool) -> int:
        """Return the number of the point at an end of an edge: the start if `first` is True, otherwise the end."""
        vertex = TopExp.FirstVertex_s(edge) if first else TopExp.LastVertex_s(edge)
        number = self._vertices.Add(vertex)
        if number not in self._corners:
            self._corners[number] = len(self.places)
            self.places.append(BRep_Tool.Pnt_s(vertex).Coord())
        return self._corners[number]


def _filling(face: TopoDS_Face, rings: Sequence[NDArray[np.int64]], places: NDArray[np.float64]) -> NDArray[np.int64] | None:
    """Fill a plane face with triangles (n, 3) between the points of its boundaries.

    Return None if the boundaries cross, or if all points are collinear.
    """
    plane = BRepAdaptor_Surface(face, False).Plane()
    across = np.array([axis.Direction().Coord() for axis in (plane.XAxis(), plane.YAxis())])
    points = np.concatenate(rings)
    flat = (places[points] - places[points[0]]) @ across.T
    ends = np.cumsum([len(ring) for ring in rings]).tolist()
    begins = [0, *ends[:-1]]
    following = np.arange(1, len(points) + 1)
    following[[end - 1 for end in ends]] = begins
    if _across(flat, flat[following]).sum() < 0.0:
        flat = flat[:, ::-1]
    borders = [np.ascontiguousarray(flat[begin:end]) for begin, end in zip(begins, ends, strict=True)]
    triangles = np.asarray(triangulate(borders, allow_convex=False), dtype=np.int64)  # True could give collinear corners
    upright = _flip_edges(triangles, flat) if len(triangles) > 0 else None
    return points[upright] if upright is not None else None


def _flip_edges(triangles: NDArray[np.int64], flat: NDArray[np.float64]) -> NDArray[np.int64] | None:
    """Replace triangles (n, 3) of plane points (m, 2) by triangles that cover the same area and have no collinear corners.

    Collinear corners occur, for example, at rows of holes.

    For each collinear triangle, the function flips the diagonal to the neighbour at its longest side. Return None if a triangle without
    area or with the wrong orientation remains.
    """
    areas, sides = _areas(triangles, flat)
    thin = np.flatnonzero(areas <= _THIN * sides.max(axis=1) ** 2).tolist()
    if not thin:
        return triangles
    corners = triangles.tolist()
    of_side = {(one[k - 1], one[k]): number for number, one in enumerate(corners) for k in range(3)}
    while thin:
        still_thin = []
        for number in thin:
            longest = int(sides[number].argmax())
            c, a, b = (corners[number][(longest + k) % 3] for k in range(3))
            other = of_side.get((a, c))
            if other is None or other in thin:  # the last of several collinear triangles is flipped first
                still_thin.append(number)
                continue
            (d,) = {*corners[other]} - {a, c}
            corners[number], corners[other] = [a, b, d], [b, c, d]
            of_side |= {(d, a): number, (b, d): number, (b, c): other, (d, b): other, (c, d): other}
        if len(still_thin) == len(thin):
            break
        thin = still_thin
    flipped = np.array(corners, dtype=np.int64)
    return flipped if _areas(flipped, flat)[0].min() > 0.0 else None


def _areas(triangles: NDArray[np.int64], flat: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute the areas and the side lengths of triangles in a plane.

    Return twice the area of each triangle (n,), and the lengths of its sides (n, 3). The area of a clockwise triangle is negative. Column k
    of the lengths is the side from corner k to the next corner.
    """
    corners = flat[triangles]
    along = corners[:, (1, 2, 0)] - corners
    return _across(along[:, 0], along[:, 1]), np.hypot(along[:, :, 0], along[:, :, 1])


def _across(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cross products `(n,)` of pairs of plane vectors `(n, 2)`.

    The product is positive if the second vector is to the left of the first vector.
    """
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def merge_vertices(count: int, ones: Sequence[int], others: Sequence[int]) -> NDArray[np.int64]:
    """Merge pairs of vertices of a mesh. Return an array (count,) that maps each vertex to the lowest index among the vertices that are
    merged with it.

    The vertices `ones[i]` and `others[i]` are merged.
    """
    a, b = np.array(ones, dtype=np.int64), np.array(others, dtype=np.int64)
    lowest_index = np.arange(count)
    while True:  # each iteration at least doubles the distance over which the lowest number has spread
        lowest = np.minimum(lowest_index[a], lowest_index[b])
        fewer = lowest_index.copy()
        np.minimum.at(fewer, lowest_index[a], lowest)
        np.minimum.at(fewer, lowest_index[b], lowest)
        np.minimum.at(fewer, a, lowest)
        np.minimum.at(fewer, b, lowest)
        fewer = fewer[fewer]
        if np.array_equal(fewer, lowest_index):
            return lowest_index
        lowest_index = fewer

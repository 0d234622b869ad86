"""From B-rep to triangles: one watertight mesh per shape, and the files that are made of it.

Vertices are joined along the kernel's own edges, not by distance: the two faces at an edge are cut at the same parameters
but may lie a tolerance apart.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

from thingc.frozen import dataclass
from thingc.realize.worker.kernel.measure import explored

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from OCP.TopoDS import TopoDS_Shape


@dataclass(frozen=True, slots=True)
class Triangles:
    """Vertices (n x 3, double) and triangles (m x 3 indices), counter-clockwise seen from outside."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]

    @property
    def closed(self) -> bool:
        """Whether every edge is run through as often one way as the other: a surface without border, turned one way."""
        if len(self.faces) == 0:
            return False
        a = self.faces.ravel()
        b = self.faces[:, (1, 2, 0)].ravel()
        count = len(self.vertices)
        return bool(np.array_equal(np.sort(a * count + b), np.sort(b * count + a)))

    @property
    def volume(self) -> float:
        """The volume enclosed, by the divergence theorem; negative when the triangles look inwards."""
        if len(self.faces) == 0:
            return 0.0
        middle = self.vertices.mean(axis=0)
        a, b, c = (self.vertices[self.faces[:, k]] - middle for k in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)

    @property
    def flat(self) -> bool:
        """Whether it encloses nothing to speak of: less than 1e-9 of the cube on its diagonal."""
        if len(self.vertices) == 0:
            return True
        diagonal = float(np.linalg.norm(self.vertices.max(axis=0) - self.vertices.min(axis=0)))
        return abs(self.volume) <= 1e-9 * diagonal**3

    def scaled(self, factor: float) -> Triangles:
        """In another unit."""
        return Triangles(self.vertices * factor, self.faces)

    def outward(self) -> Triangles:
        """Turned so that the volume is positive."""
        return self if self.volume >= 0.0 else Triangles(self.vertices, self.faces[:, ::-1])


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


def without_slivers(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Triangles:
    """Without triangles that name a vertex twice, and without vertices that no triangle names."""
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    faces = faces[whole]
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    return Triangles(vertices[used], (np.cumsum(used) - 1)[faces])


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


def together(meshes: list[Triangles]) -> Triangles:
    """Several meshes as one, side by side."""
    if len(meshes) == 1:
        return meshes[0]
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Triangles(
        np.concatenate([mesh.vertices for mesh in meshes]) if meshes else np.zeros((0, 3)),
        np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, offsets[:-1], strict=True)])
        if meshes
        else np.zeros((0, 3), dtype=np.int64),
    )


def counted_twice(meshes: Sequence[Triangles]) -> float:
    """By how much the volumes of these closed meshes come to more than that of their union (manifold3d)."""
    from manifold3d import Manifold, Mesh64, OpType

    solids = [
        Manifold(Mesh64(np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces, dtype=np.uint64))) for mesh in meshes
    ]
    return math.fsum(solid.volume() for solid in solids) - float(Manifold.batch_boolean(solids, OpType.Add).volume())


def hull(points: NDArray[np.float64]) -> Triangles | None:
    """The convex hull of points (manifold3d), or None where they lie in a plane."""
    from manifold3d import Manifold

    mesh = Manifold.hull_points(np.ascontiguousarray(points, dtype=np.float64)).to_mesh64()
    faces = np.asarray(mesh.tri_verts, dtype=np.int64)
    if len(faces) == 0:
        return None
    made = Triangles(np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3], faces)
    return None if made.flat else made.outward()


# --- files ------------------------------------------------------------------------------------------------------------


_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("count", "<u2")])


def in_single(mesh: Triangles) -> Triangles:
    """With vertices as 32-bit numbers leave them, which STL files hold and simulators keep: those that become equal are one."""
    single = mesh.vertices.astype(np.float32).astype(np.float64) + 0.0
    firsts, numbers = _once(single)
    return without_slivers(single, firsts[numbers][mesh.faces])


def _once(points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where each of the points (n x 3) that differ stands first, in the order of x, y, z; and for each point which of them it is (n,)."""
    order = np.lexsort(points.T[::-1])  # stable: of equal points the first one comes first
    begins = np.ones(len(order), dtype=bool)
    begins[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    numbers = np.empty(len(order), dtype=np.int64)
    numbers[order] = np.cumsum(begins) - 1
    return order[begins], numbers


def stl(mesh: Triangles) -> bytes:
    """A binary STL file; the header says nothing that changes."""
    corners = mesh.vertices[mesh.faces].astype("<f4")
    wide = corners.astype(np.float64)
    normals = np.cross(wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)
    records = np.zeros(len(mesh.faces), dtype=_STL)
    records["normal"] = normals + 0.0
    records["corners"] = corners
    return b"thingc".ljust(80, b"\0") + len(mesh.faces).to_bytes(4, "little") + records.tobytes()


def obj(mesh: Triangles) -> bytes:
    """A Wavefront OBJ file: vertices to 9 digits, triangles, no normals."""
    vertices = ("v %.9g %.9g %.9g\n" * len(mesh.vertices)) % tuple((mesh.vertices + 0.0).ravel().tolist())
    faces = ("f %d %d %d\n" * len(mesh.faces)) % tuple((mesh.faces + 1).ravel().tolist())
    return (vertices + faces).encode()


def read_stl(data: bytes) -> Triangles:
    """A binary STL file, equal vertices joined: the inverse of `stl`."""
    count = int.from_bytes(data[80:84], "little")
    records = np.frombuffer(data, dtype=_STL, count=count, offset=84)
    corners = records["corners"].astype(np.float64).reshape(-1, 3)
    firsts, numbers = _once(corners)
    return without_slivers(corners[firsts], numbers.reshape(-1, 3))

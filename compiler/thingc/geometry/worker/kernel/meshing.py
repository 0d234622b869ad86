"""Represent triangle meshes, and convert them to the bytes of mesh files."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.base.frozen_struct import FrozenStruct

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


class Triangles(FrozenStruct, kw_only=False):
    """A triangle mesh: vertices `(n, 3)`, and triangles `(m, 3)` as vertex indices, counter-clockwise as seen from outside."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]

    @property
    def closed(self) -> bool:
        """Return whether every edge occurs equally often in both directions. The surface then has no border and a consistent
        orientation.
        """
        if len(self.faces) == 0:
            return False
        a = self.faces.ravel()
        b = self.faces[:, (1, 2, 0)].ravel()
        count = len(self.vertices)
        return bool(np.array_equal(np.sort(a * count + b), np.sort(b * count + a)))

    @property
    def volume(self) -> float:
        """Return the enclosed volume, computed by the divergence theorem. The volume is negative if the triangles face inwards."""
        if len(self.faces) == 0:
            return 0.0
        middle = self.vertices.mean(axis=0)
        a, b, c = (self.vertices[self.faces[:, k]] - middle for k in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)

    @property
    def flat(self) -> bool:
        """Return whether the enclosed volume is negligible, which means less than 1e-9 of the cube of the diagonal."""
        if len(self.vertices) == 0:
            return True
        diagonal = float(np.linalg.norm(self.vertices.max(axis=0) - self.vertices.min(axis=0)))
        return abs(self.volume) <= 1e-9 * diagonal**3

    def scale(self, factor: float) -> Triangles:
        """Return a copy of the mesh with all coordinates multiplied by `factor`, to convert the mesh to another unit."""
        return Triangles(self.vertices * factor, self.faces)

    def outward(self) -> Triangles:
        """Return the mesh with its triangles oriented such that the enclosed volume is positive."""
        return self if self.volume >= 0.0 else Triangles(self.vertices, self.faces[:, ::-1])


def without_slivers(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Triangles:
    """Remove triangles in which the same vertex occurs twice, and remove unused vertices."""
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    faces = faces[distinct]
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    return Triangles(vertices[used], (np.cumsum(used) - 1)[faces])


def together(meshes: list[Triangles]) -> Triangles:
    """Combine several triangle meshes into one mesh. Vertices at the same position are not merged."""
    if len(meshes) == 1:
        return meshes[0]
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([np.zeros((0, 3)), *(mesh.vertices for mesh in meshes)])
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets[:-1], strict=True)]
    return Triangles(vertices, np.concatenate([np.zeros((0, 3), dtype=np.int64), *faces]))


def to_manifold(mesh: Triangles) -> Any:
    """Convert a mesh to a solid of manifold3d. The solid is empty if the mesh is not a closed surface in which each edge has two triangles.
    """
    from manifold3d import Manifold, Mesh64

    return Manifold(Mesh64(np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces, dtype=np.uint64)))


def from_manifold(solid: Any) -> Triangles:
    """Convert a solid of manifold3d to a mesh."""
    mesh = solid.to_mesh64()
    vertices = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3]
    return Triangles(vertices, np.asarray(mesh.tri_verts, dtype=np.int64).reshape(-1, 3))


def from_trimesh(mesh: Any) -> Triangles:
    """Convert a mesh of trimesh. Triangles in which the same vertex occurs twice, and unused vertices, are removed."""
    return without_slivers(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))


def counted_twice(meshes: Sequence[Triangles]) -> float:
    """Return the difference between the sum of the volumes of closed meshes and the volume of their union, which manifold3d computes."""
    from manifold3d import Manifold, OpType

    solids = list(map(to_manifold, meshes))
    return math.fsum(solid.volume() for solid in solids) - float(Manifold.batch_boolean(solids, OpType.Add).volume())


def hull(points: NDArray[np.float64]) -> Triangles | None:
    """Return the convex hull of points, computed by manifold3d. Return None if all points are in a plane."""
    from manifold3d import Manifold

    mesh = from_manifold(Manifold.hull_points(np.ascontiguousarray(points, dtype=np.float64)))
    return None if len(mesh.faces) == 0 or mesh.flat else mesh.outward()


# --- files ------------------------------------------------------------------------------------------------------------


_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("count", "<u2")])


def merge_vertices(mesh: Triangles, decimals: int | None = None) -> Triangles:
    """Merge the vertices of a mesh that are equal as 32-bit floats. STL files and simulators also use 32-bit floats.

    The coordinates of the result are 32-bit floats. If `decimals` is given, coordinates are instead rounded to this number of decimals.
    """
    single = mesh.vertices.astype(np.float32).astype(np.float64) + 0.0
    firsts, numbers = _group_equal(single)
    return without_slivers(single if decimals is None else mesh.vertices.round(decimals) + 0.0, firsts[numbers][mesh.faces])


def _group_equal(points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find equal points (n, 3), and number the distinct points.

    Return two arrays: the index of the first point in each group of equal points, sorted by x, y, z, and the number of the group of each
    point (n,).
    """
    order = np.lexsort(points.T[::-1])  # stable: the first of several equal points comes first
    begins = np.ones(len(order), dtype=bool)
    begins[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    numbers = np.empty(len(order), dtype=np.int64)
    numbers[order] = np.cumsum(begins) - 1
    return order[begins], numbers


def stl(mesh: Triangles) -> bytes:
    """Convert a mesh to the bytes of a binary STL file with a constant header."""
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
    """Convert a mesh to the bytes of a Wavefront OBJ file. Coordinates are written with 9 significant digits, and normals are omitted."""
    vertices = ("v %.9g %.9g %.9g\n" * len(mesh.vertices)) % tuple((mesh.vertices + 0.0).ravel().tolist())
    faces = ("f %d %d %d\n" * len(mesh.faces)) % tuple((mesh.faces + 1).ravel().tolist())
    return (vertices + faces).encode()


def double(mesh: Triangles) -> bytes:
    """Convert a mesh to bytes: the number of vertices, the vertices as 64-bit floats, and the triangles. `exact_arrays` of
    `geometry/store/meshes.py` is the inverse of this function.
    """
    return len(mesh.vertices).to_bytes(8, "little") + mesh.vertices.astype("<f8").tobytes() + mesh.faces.astype("<u4").tobytes()

"""Simplify meshes for simulators and measure the deviation, for parts whose document limits the number of triangles (`faces`).

trimesh collapses the edges that change the shape least (Garland and Heckbert, "Surface simplification using quadric error metrics", 1997;
the package fast_simplification), which is best for scans. However, trimesh tears flat regions, and stops at long thin triangles. Therefore,
manifold3d first merges flat regions, and moves surfaces by at most a tolerance. If trimesh fails, the mesh is simplified only by
manifold3d.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.geometry.worker.kernel.meshing import Triangles, from_manifold, from_trimesh, to_manifold, without_slivers
from thingc.geometry.worker.part_session import NoPart

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIZE = 100.0
"""Length of the longest side of the meshes that are passed to trimesh. Meshes are scaled to this size because in trimesh, the cost of a
collapse depends on the size of the mesh.
"""

FLAT = 1e-6
"""Distance, relative to the longest side, by which a surface may move while coplanar triangles are merged."""

SAMPLES = 100_000
"""Number of sample points on a surface, in addition to the centres of triangles. The sample points are used to find the triangles near a
point.
"""

FEW, MANY, AGAIN = 4, 64, 4000
"""Number of nearest triangles that are tested for every point, number that is tested for the farthest points, and number of farthest
points.
"""


def simplify(mesh: Triangles, faces: int) -> Triangles:
    """Simplify a closed mesh to at most `faces` triangles. If every edge of the mesh has two triangles, this is also true for the result.

    Raises `NoPart` if the mesh cannot be simplified to `faces` triangles.
    """
    if len(mesh.faces) <= faces:
        return mesh
    scale = SIZE / float(np.ptp(mesh.vertices, axis=0).max())
    mesh = mesh.scale(scale)
    solid = to_manifold(mesh)
    is_manifold = solid.num_tri() > 0  # otherwise, edges between touching bodies have four triangles, which manifold3d does not accept
    plain = _triangles(solid.simplify(FLAT * SIZE)) if is_manifold else mesh
    if len(plain.faces) <= faces:
        return plain.scale(1.0 / scale)
    fewer = _by_quadrics(plain, faces)
    if len(fewer.faces) > faces or not _sound(fewer, is_manifold):
        fewer = _by_tolerance(solid, faces) if is_manifold else mesh
    if len(fewer.faces) > faces or not _sound(fewer, is_manifold):
        raise NoPart("unbounded", f"{faces} triangles would leave gaps in the surface")
    return fewer.scale(1.0 / scale)


def deviation(one: Triangles, other: Triangles) -> float:
    """Compute the deviation between two meshes. The deviation is the largest distance from a vertex of one mesh to the surface of the other
    mesh.

    The distance is in the unit of the meshes.
    """
    return max(_farthest(one.vertices, other), _farthest(other.vertices, one))


def _by_quadrics(mesh: Triangles, faces: int) -> Triangles:
    import trimesh

    return from_trimesh(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).simplify_quadric_decimation(face_count=faces))


def _by_tolerance(solid: Any, faces: int) -> Triangles:
    """Simplify a mesh with the tolerance of manifold3d. The tolerance is doubled until the mesh has at most `faces` triangles."""
    tolerance = FLAT * SIZE
    fewer = solid
    while fewer.num_tri() > faces and tolerance < SIZE:
        tolerance *= 2.0
        fewer = solid.simplify(tolerance)
    return _triangles(fewer)


def _triangles(solid: Any) -> Triangles:
    mesh = from_manifold(solid)
    return without_slivers(mesh.vertices, mesh.faces)


def _sound(mesh: Triangles, is_manifold: bool) -> bool:
    """Return whether a mesh encloses a volume and has no border. If `is_manifold` is True, each edge must also have two triangles."""
    return mesh.closed and not mesh.flat and mesh.volume > 0.0 and (not is_manifold or to_manifold(mesh).num_tri() == len(mesh.faces))


def _farthest(points: NDArray[np.float64], surface: Triangles) -> float:
    """Return the largest distance of points from a surface. Each distance is measured to the nearest of a few triangles around the point.

    For the farthest points, the measurement is repeated with more triangles.
    """
    import trimesh
    from scipy.spatial import cKDTree

    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    samples, owners = trimesh.sample.sample_surface(mesh, SAMPLES, seed=0)
    corners = surface.vertices[surface.faces]
    tree = cKDTree(np.concatenate([samples, corners.mean(axis=1)]))
    triangles = np.concatenate([owners, np.arange(len(corners))])

    def point_distances(points: NDArray[np.float64], neighbours: int) -> NDArray[np.float64]:
        nearest = triangles[tree.query(points, k=neighbours)[1]].reshape(-1)
        repeated = np.repeat(points, neighbours, axis=0)
        closest = trimesh.triangles.closest_point(corners[nearest], repeated)  # type: ignore[no-untyped-call]
        return np.asarray(np.linalg.norm(closest - repeated, axis=1).reshape(-1, neighbours).min(axis=1))

    distances = point_distances(points, FEW)
    doubtful = np.argsort(distances, kind="stable")[-AGAIN:]
    distances[doubtful] = point_distances(points[doubtful], MANY)
    return float(distances.max())

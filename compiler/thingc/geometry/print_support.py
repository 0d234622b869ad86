"""Measure the support that a part needs in a print direction, and choose the direction with the least support. Lengths are in mm.

The lengths of gaps and walls are measured by rays from points on the facets of the mesh.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from manifold3d import Manifold, Mesh64
from numpy.typing import NDArray

from thingc.base.pose import Vector
from thingc.geometry.print_slices import UPRIGHT
from thingc.geometry.store.local import Store
from thingc.geometry.store.meshes import exact_arrays

STEEPEST = math.cos(math.radians(45.0)) + 1e-3
"""A surface needs support if its normal points down by more than this: if it is flatter than 45 degrees."""
ON_BED = 0.01
"""Surfaces up to this height rest on the bed [mm]."""
DIRECTIONS = 8
"""Number of directions that are compared: those in which the largest faces of the convex hull rest on the bed."""
SAMPLES = 4000
"""Number of points on the surface of a part. Each facet has at least one point, its centre, and large facets have several."""
_AWAY = 1e-3
"""Distance of the start of a ray from its facet [mm], so that the ray does not hit the facet."""

Array = NDArray[np.float64]


class PrintSolid:
    """A mesh with vertices `(n, 3)` and triangles `(m, 3)`. If the mesh is not closed, rays do not hit it."""

    def __init__(self, vertices: Array, faces: NDArray[np.int64]) -> None:
        self._vertices = vertices
        self._solid = Manifold(Mesh64(np.array(vertices, order="C"), np.array(faces, dtype=np.uint64, order="C")))
        self._corners, self._areas, self.normals = _facets(vertices, faces)

    def sample(self, chosen: NDArray[np.bool_] | slice = slice(None)) -> tuple[Array, NDArray[np.int64], Array]:
        """Return points `(k, 3)` on the chosen triangles, the triangle `(k,)` of each point, and the area `(k,)` that it represents.

        Each triangle is divided into n^2 equal triangles, whose centres are returned.
        """
        triangles = np.arange(len(self._areas))[chosen]
        sides = np.maximum(1, np.sqrt(self._areas[triangles] / self._areas.sum() * SAMPLES)).astype(int)
        counts = sides * sides
        owners, side = np.repeat(triangles, counts), np.repeat(sides, counts)
        numbers = np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
        shares = (np.stack([numbers // side, numbers % side]) + 1.0 / 3.0) / side
        u, v = np.where(shares.sum(axis=0) > 1.0, 1.0 - shares, shares)[:, :, None]
        a, b, c = self._corners[owners].transpose(1, 0, 2)
        return a + u * (b - a) + v * (c - a), owners, self._areas[owners] / np.repeat(counts, counts)

    def cast(self, points: Array, directions: Array, lengths: Array) -> tuple[Array, Array]:
        """Cast a ray from each point along a unit vector. Return the distance `(k,)` to the surface and its normal `(k, 3)`, or the length
        of the ray and zeros if the ray does not hit the surface.
        """
        starts, ends = points + _AWAY * directions, points + lengths[:, None] * directions
        rays = map(self._solid.ray_cast, starts.tolist(), ends.tolist())
        hits = np.array([(hit[0].distance, *hit[0].normal) if hit else (1.0, 0.0, 0.0, 0.0) for hit in rays]).reshape(-1, 4)
        return _AWAY + hits[:, 0] * (lengths - _AWAY), hits[:, 1:]

    def support(self, up: Vector) -> tuple[float, float]:
        """Return the area [mm^2] of the surfaces that need support in a print direction, and the volume [mm^3] below them.

        The volume extends to the next surface of the part, or to the bed.
        """
        upwards = np.array(up)
        bed, down = float((self._vertices @ upwards).min()), -self.normals @ upwards
        hanging = (down > STEEPEST) & ((self._corners @ upwards).max(axis=1) - bed > ON_BED)
        points, owners, areas = self.sample(hanging)
        gaps, _ = self.cast(points, np.tile(-upwards, (len(points), 1)), points @ upwards - bed)
        return float(areas.sum()), float(gaps @ (areas * down[owners]))

    def least_support(self) -> tuple[Vector, float]:
        """Return the direction with the least support, and the volume of this support [mm^3].

        If the volumes are equal when rounded to 1 mm^3, the larger face rests on the bed. If the faces are also equal, the orientation
        of the model takes precedence, then the smaller vector.
        """
        hull = Manifold.hull_points(self._vertices).to_mesh64()
        _, sizes, normals = _facets(hull.vert_properties[:, :3], hull.tri_verts.astype(np.int64))
        faces, numbers = np.unique(-normals.round(4) + 0.0, axis=0, return_inverse=True)
        areas = np.bincount(numbers.ravel(), sizes).round(3)
        units = faces / np.linalg.norm(faces, axis=1, keepdims=True) + 0.0
        largest = sorted(zip((-areas).tolist(), map(tuple, units.tolist()), strict=True))[:DIRECTIONS]
        candidates = [(round(volume := self.support(up)[1]), area, up != UPRIGHT, up, volume) for area, up in largest]
        return min(candidates)[3:]


def _facets(vertices: Array, faces: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Return the corners `(m, 3, 3)`, the areas `(m,)` and the unit normals `(m, 3)` of triangles."""
    corners = vertices[faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(doubled, axis=1)
    return corners, sizes / 2.0, doubled / np.where(sizes > 0.0, sizes, 1.0)[:, None]


@lru_cache(maxsize=256)
def automatic_direction(store: Store, sha256: str) -> Vector:
    """Return the direction of `up: auto`, a unit vector, for the mesh `slicing` of a part record."""
    return PrintSolid(*exact_arrays(store.read(sha256))).least_support()[0]

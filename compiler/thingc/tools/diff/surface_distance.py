"""Compute the distance between two surfaces from their visual meshes."""

from __future__ import annotations

import contextlib
from itertools import chain
from typing import TYPE_CHECKING

from thingc.geometry.store.local import BlobMissing, Store, StoreUnusable
from thingc.geometry.store.meshes import arrays

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

AT_ONCE = 200
"""Number of points whose distances are measured at once."""
MOST = 600_000_000
"""Maximum total number of pairs of a point and a triangle. For more pairs, the distance is not computed."""
MICROMETRES = 1e6
"""Conversion from metres. trimesh compares products of four lengths with an absolute tolerance, which is too large in metres."""


class SurfaceDistances:
    """Computes distances between the surfaces of meshes in a content-addressed store. The store also caches the distances."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._known: dict[tuple[str, str], float | None] = {}

    def farthest(self, old: str, new: str) -> float | None:
        """Return the largest distance [m] between a vertex of either mesh and the surface of the other mesh.

        The arguments are SHA-256 hashes of OBJ files. The result is a lower bound of the Hausdorff distance. Return None if a mesh is
        missing, or if the meshes have too many triangles.
        """
        pair = (min(old, new), max(old, new))
        if pair not in self._known:
            key = " ".join(pair)
            kept = self._store.get_json("diff-surfaces", key)
            self._known[pair] = float(kept) if isinstance(kept, (int, float)) else self._measure(*pair, key)
        return self._known[pair]

    def _measure(self, old: str, new: str, key: str) -> float | None:
        try:
            (points, faces), (others, between) = (arrays(self._store.read(sha256)) for sha256 in (old, new))
        except BlobMissing:
            return None
        if len(points) * len(between) + len(others) * len(faces) > MOST or not len(faces) or not len(between):
            return None
        distance = max(float(surface_distances(*pair).max()) for pair in ((points, others[between]), (others, points[faces])))
        with contextlib.suppress(StoreUnusable):
            self._store.put_json("diff-surfaces", key, distance)
        return distance


def surface_distances(points: Array, triangles: Array) -> Array:
    """Return the distance [m] of each point `(n, 3)` from the nearest triangle `(m, 3, 3)`.

    Only triangles that can be nearer than the nearest corner or centre of a triangle are compared. They are found by their centres, among
    triangles of similar size.
    """
    import numpy as np
    import trimesh
    from scipy.spatial import cKDTree

    points, triangles = MICROMETRES * points, MICROMETRES * triangles
    centres, low, high = triangles.mean(axis=1), triangles.min(axis=1), triangles.max(axis=1)
    sizes = np.ceil(np.log2(np.maximum(np.linalg.norm(triangles - centres[:, None], axis=2).max(axis=1), 1.0)))
    groups = [(2.0**size, np.flatnonzero(sizes == size)) for size in np.unique(sizes)]
    trees = [(radius, own, cKDTree(centres[own])) for radius, own in groups]
    found = np.asarray(cKDTree(np.concatenate([triangles.reshape(-1, 3), centres])).query(points)[0])
    for some in np.array_split(np.arange(len(points)), 1 + len(points) // AT_ONCE):
        for radius, own, tree in trees:
            near = tree.query_ball_point(points[some], found[some] + radius)
            asked, compared = np.repeat(some, list(map(len, near))), own[np.fromiter(chain.from_iterable(near), dtype=int)]
            beside = np.maximum(np.maximum(low[compared] - points[asked], points[asked] - high[compared]), 0.0)
            closer = np.linalg.norm(beside, axis=1) < found[asked]
            asked, compared = asked[closer], compared[closer]
            there = trimesh.triangles.closest_point(triangles[compared], points[asked])  # type: ignore[no-untyped-call]
            np.fmin.at(found, asked, np.linalg.norm(there - points[asked], axis=1))
    return found / MICROMETRES

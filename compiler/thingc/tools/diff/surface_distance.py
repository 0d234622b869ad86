"""Compute the distance between two surfaces from their visual meshes."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

from thingc.geometry.store.local import BlobMissing, Store, StoreUnusable
from thingc.geometry.store.meshes import arrays

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

AT_ONCE = 400_000
"""Maximum number of pairs of a point and a triangle that are processed in one NumPy operation."""
MOST = 60_000_000
"""Maximum total number of pairs of a point and a triangle. For more pairs, the distance is not computed."""


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
        distance = max(_from_surface(points, others[between]), _from_surface(others, points[faces]))
        with contextlib.suppress(StoreUnusable):
            self._store.put_json("diff-surfaces", key, distance)
        return distance


def _from_surface(points: Array, triangles: Array) -> float:
    """Return the largest distance [m] of a point in `points (n, 3)` from the surface `triangles (m, 3, 3)`."""
    import numpy as np

    step = max(1, AT_ONCE // len(triangles))
    return max(float(np.sqrt(_squared_distances(points[at : at + step], triangles).max())) for at in range(0, len(points), step))


def _squared_distances(points: Array, triangles: Array) -> Array:
    """Return the squared distance [m^2] of each point `(n, 3)` from the nearest triangle `(m, 3, 3)`.

    If a point projects into a triangle, its distance is the distance to the plane of the triangle, else the distance to the nearest edge.
    """
    import numpy as np

    corners = [triangles[:, k] for k in range(3)]
    nearest = np.full((len(points), len(triangles)), np.inf)
    inside = np.ones((len(points), len(triangles)), dtype=bool)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    length = np.linalg.norm(normal, axis=1)
    for k in range(3):
        along = corners[(k + 1) % 3] - corners[k]
        to = points[:, None, :] - corners[k][None]
        squared = np.maximum((along * along).sum(1), 1e-300)
        part = np.clip((to * along[None]).sum(2) / squared, 0.0, 1.0)
        off = to - part[:, :, None] * along[None]
        nearest = np.minimum(nearest, (off * off).sum(2))
        inside &= (np.cross(normal, along)[None] * to).sum(2) >= 0.0
    height = ((points[:, None, :] - corners[0][None]) * normal[None]).sum(2) / np.maximum(length, 1e-300)
    over = inside & (length > 1e-18)
    result: Array = np.where(over, height * height, nearest).min(axis=1)
    return result

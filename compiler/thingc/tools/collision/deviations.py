"""Measure the distances and the volumes between collision shapes and the parts that they approximate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.primitives import Primitive
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly, Occurrence

if TYPE_CHECKING:
    from numpy.typing import NDArray

SAMPLES = 4000
"""Number of random points on a surface, in addition to its vertices."""

FEW, MANY = 16, 500
"""Numbers of triangles near a point to which its distance is measured: for all points, and for the farthest points."""

AGAIN = 50
"""Number of points whose distance is measured again at once."""


class Deviation(FrozenStruct):
    """The deviation of the collision shapes of occurrences from their part or link.

    `outside` is the largest distance [m] of a point of the part from the shapes, `beyond` is the largest distance of a point of the shapes
    from the part, and `ratio` is the ratio of volumes. These values are None without a solid part, or for a plane.
    """

    paths: tuple[str, ...]
    kind: str
    shapes: int
    outside: float | None = None
    beyond: float | None = None
    ratio: float | None = None


def deviations(assembly: Assembly, store: Store) -> list[Deviation]:
    """Measure the collision shapes of each part and link. Occurrences with equal shapes are measured once."""
    groups: dict[object, list[Occurrence]] = {}
    for one in assembly.occurrences:
        if one.has_contacts or one.drawn:
            key = (one.definition.text, one.overrides.collision, one.overrides.pieces, tuple(surface.solid for surface in one.touching))
            groups.setdefault(key, []).append(one)
    return [_deviation(tuple(one.path for one in several), several[0], store) for several in groups.values()]


def _deviation(paths: tuple[str, ...], one: Occurrence, store: Store) -> Deviation:
    from manifold3d import Manifold, OpType

    from thingc.model.solids.shapes import solid_of

    kind = "shapes" if one.listed is not None else one.overrides.collision
    measured = Deviation(paths=paths, kind=kind, shapes=len(one.touching))
    part = solid_of(store, one.drawn if one.listed is not None else one.solids)
    solids = [(solid_of(store, [surface]), surface.solid) for surface in one.touching]
    if part is None or not solids or any(isinstance(solid, Primitive) and solid.shape == "plane" for _, solid in solids):
        return measured
    whole = [
        made.whole if isinstance(solid, Primitive) or kind == "mesh" else made.whole.hull() for made, solid in solids if made is not None
    ]
    shapes = Manifold.batch_boolean(whole, OpType.Add)
    return replace(
        measured, outside=farthest(part.whole, shapes), beyond=farthest(shapes, part.whole), ratio=shapes.volume() / part.whole.volume(),
    )


def farthest(solid: Any, other: Any) -> float:
    """Return the largest distance [m] of a point of a solid from another solid, measured at vertices and at sampled points."""
    import numpy as np
    import trimesh
    from scipy.spatial import cKDTree

    outside = solid - other
    if outside.is_empty():
        return 0.0
    points, _ = _sample_surface(outside)
    samples, triangles = _sample_surface(other)
    tree = cKDTree(samples)

    def point_distances(points: NDArray[Any], neighbours: int) -> NDArray[Any]:
        nearest = triangles[tree.query(points, k=min(neighbours, len(samples)))[1]]
        asked = np.repeat(points, nearest.shape[1], axis=0)
        there = trimesh.triangles.closest_point(nearest.reshape(-1, 3, 3), asked)  # type: ignore[no-untyped-call]
        return np.asarray(np.linalg.norm(there - asked, axis=1).reshape(-1, nearest.shape[1]).min(axis=1))

    upper, largest = point_distances(points, FEW), 0.0
    order = np.argsort(-upper, kind="stable")
    for start in range(0, len(order), AGAIN):  # the distance to few triangles can be too large
        some = order[start : start + AGAIN]
        if upper[some[0]] <= largest:
            break
        largest = max(largest, float(point_distances(points[some], MANY).max()))
    return largest


def _sample_surface(solid: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return points (n, 3) on the surface of a solid, and the triangle (n, 3, 3) that contains each point."""
    import numpy as np
    import trimesh

    mesh = solid.to_mesh64()
    corners = np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts, dtype=np.int64)]
    surface = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    samples, owners = trimesh.sample.sample_surface(surface, SAMPLES, seed=0)
    return np.concatenate([corners.reshape(-1, 3), samples]), np.concatenate([np.repeat(corners, 3, axis=0), corners[owners]])

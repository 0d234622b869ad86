"""Measure the distances and the volumes between collision shapes and the parts that they approximate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.grouping import group_by
from thingc.base.primitives import Primitive
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.tools.diff.surface_distance import surface_distances

if TYPE_CHECKING:
    from numpy.typing import NDArray

SAMPLES = 4000
"""Number of random points on a surface, in addition to its vertices."""


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
    groups = group_by((one for one in assembly.occurrences if one.has_contacts or one.drawn), lambda one: (
        one.definition.text, one.overrides.collision, one.overrides.pieces, tuple(surface.solid for surface in one.touching),
    ))
    return [_deviation(tuple(one.path for one in equal), equal[0], store) for equal in groups.values()]


def _deviation(paths: tuple[str, ...], one: Occurrence, store: Store) -> Deviation:
    from manifold3d import Manifold, OpType

    from thingc.model.solids.shapes import solid_of

    kind = "shapes" if one.listed is not None and one.touching else one.overrides.collision
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
    outside = solid - other
    if outside.is_empty():
        return 0.0
    import numpy as np
    import trimesh

    corners = _corners(outside)
    surface = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    samples, _ = trimesh.sample.sample_surface(surface, SAMPLES, seed=0)
    return float(surface_distances(np.concatenate([np.unique(corners.reshape(-1, 3), axis=0), samples]), _corners(other)).max())


def _corners(solid: Any) -> NDArray[Any]:
    """Return the corners (n, 3, 3) of the triangles of a solid."""
    import numpy as np

    mesh = solid.to_mesh64()
    return np.asarray(np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts, dtype=np.int64)])

"""The true shapes of parts as solids of manifold3d, and how they lie to each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from manifold3d import Manifold, Mesh64
from numpy.typing import NDArray

from thingc.pose import Pose
from thingc.realize.record import Mesh, PartRecord
from thingc.realize.store.local import Store
from thingc.realize.store.meshes import arrays


class PartSolids:
    """Solids by the text of the part's definition, made when first asked for. Metres, the part's own frame."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._solids: dict[str, Any] = {}
        self.hulls: set[str] = set()
        """The texts of the definitions whose surface is not closed: their convex hulls stand for them."""

    def solid(self, record: PartRecord) -> Any | None:
        """The solid of a part, tessellated as in the artifacts; None of a part without geometry."""
        mesh = record.meshes.get("mesh")
        if mesh is None:
            return None
        if record.text not in self._solids:
            solid, hull = solid_of(self._store, mesh)
            if hull:
                self.hulls.add(record.text)
            self._solids[record.text] = solid
        return self._solids[record.text]


def solid_of(store: Store, mesh: Mesh) -> tuple[Any, bool]:
    """The solid within a mesh of the store [m], or within its convex hull where it is not closed; and whether it is that."""
    vertices, faces = arrays(store.read(mesh.sha256))
    solid = Manifold(Mesh64(vert_properties=vertices, tri_verts=faces.astype(np.uint64)))
    hull = not mesh.closed or solid.num_tri() == 0
    return Manifold.hull_points(vertices) if hull else solid, hull


def at(solid: Any, pose: Pose) -> Any:
    """A solid somewhere else."""
    return solid.transform(np.hstack([np.array(pose.rotation), np.array(pose.translation)[:, None]]))


def box(solid: Any, pose: Pose) -> NDArray[np.float64]:
    """A box (2 x 3: low, high) along the axes of the world around a solid at a pose."""
    bounds = np.array(solid.bounding_box(), dtype=np.float64).reshape(2, 3)
    middle, half = (bounds[0] + bounds[1]) / 2.0, (bounds[1] - bounds[0]) / 2.0
    turn = np.array(pose.rotation)
    centre, reach = turn @ middle + np.array(pose.translation), np.abs(turn) @ half
    return np.stack([centre - reach, centre + reach])


def overlap(one: Any, other: Any) -> tuple[float, float]:
    """Of what two solids share: the volume [m^3], and its mean thickness [m], twice the volume by the surface (of a thin layer
    that is its thickness). 0 where they only touch."""
    shared = one ^ other
    volume = float(shared.volume())
    return (volume, 2.0 * volume / float(shared.surface_area())) if volume > 0.0 else (0.0, 0.0)

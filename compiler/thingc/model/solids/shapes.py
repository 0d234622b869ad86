"""Exact shapes of parts and links as solids of manifold3d, and their distances and intersections."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, assert_never

import numpy as np
from manifold3d import Manifold, Mesh64, OpType
from numpy.typing import NDArray

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Pose
from thingc.base.primitives import Primitive
from thingc.geometry.record import Mesh
from thingc.geometry.store.local import Store
from thingc.geometry.store.meshes import arrays
from thingc.model.assembly.types import Occurrence, Surface

FACETS = 128
"""Number of facets around curved surfaces. The error is then less than 0.1 % of the radius."""
THIN = 1e-8
"""Thickness [m] of solids that represent a point or a line, which manifold3d does not support."""
ENDLESS = 100.0
"""Size [m] of planes, and of the solid below a plane."""


class Solid(FrozenStruct, kw_only=False):
    """A solid for computing distances to other solids and intersections with them.

    `whole` is the whole solid, with facets on curved surfaces. `cores` are solids each with a radius [m]; points nearer to the core than
    the radius belong to the solid. The cores of spheres and capsules are points and lines, which makes gaps to them exact and fast.
    """

    whole: Any
    cores: tuple[tuple[Any, float], ...]

    def at(self, pose: Pose) -> Solid:
        """Return a copy of the solid that is moved to a pose."""
        return Solid(_at(self.whole, pose), tuple((_at(core, pose), radius) for core, radius in self.cores))

    def box(self, pose: Pose) -> NDArray[np.float64]:
        """Return the bounding box (2 x 3: low, high) [m] along the axes of the world for the solid at a pose."""
        bounds = np.array(self.whole.bounding_box(), dtype=np.float64).reshape(2, 3)
        middle, half = (bounds[0] + bounds[1]) / 2.0, (bounds[1] - bounds[0]) / 2.0
        turn = np.array(pose.rotation)
        centre, reach = turn @ middle + np.array(pose.translation), np.abs(turn) @ half
        return np.stack([centre - reach, centre + reach])

    def gap(self, other: Solid, within: float) -> float:
        """Return the distance [m] to another solid, but at most `within`. The distance is 0 if the solids intersect."""
        return min(
            max(float(one.min_gap(two, within + more + also)) - more - also, 0.0)
            for one, more in self.cores for two, also in other.cores
        )

    def overlap(self, other: Solid) -> tuple[float, float]:
        """Return the volume [m^3] of the intersection with another solid, and its mean thickness [m].

        The mean thickness is twice the volume divided by the surface area, which is the thickness of a thin layer. Both results are 0 if
        the solids only touch.
        """
        shared = self.whole ^ other.whole
        volume = float(shared.volume())
        return (volume, 2.0 * volume / float(shared.surface_area())) if volume > 0.0 else (0.0, 0.0)


class Solids:
    """The solids of parts and links, keyed by the text of the definition and created on demand.

    Solids are in metres, in the frame of their part or link.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._solids: dict[str, Solid | None] = {}
        self.hulls: set[str] = set()
        """Texts of definitions whose surface is not closed. The convex hull replaces this surface."""

    def solid(self, occurrence: Occurrence) -> Solid | None:
        """Return the solid of a part or link, with the same meshes as in the output. Return None if none of its shapes is solid."""
        text = occurrence.definition.text
        if text not in self._solids:
            self._solids[text] = solid_of(self._store, occurrence.solids)
            if any(isinstance(one.solid, Mesh) and not one.solid.closed for one in occurrence.solids):
                self.hulls.add(text)
        return self._solids[text]


def solid_of(store: Store, surfaces: Sequence[Surface], *, simplify: float = 0.0) -> Solid | None:
    """Create the solid that several surfaces enclose, in the frame of the surfaces.

    Return None if none of the surfaces encloses a volume.

    `simplify` [m] is the tolerance for reducing the number of facets. Intersections of a simplified solid take half the time.
    """
    made = [(_whole(store, surface), surface.solid) for surface in surfaces]
    inside = [(whole, solid) for whole, solid in made if not whole.is_empty()]
    if not inside:
        return None
    whole = Manifold.batch_boolean([whole for whole, _ in inside], OpType.Add)
    return Solid(whole.simplify(simplify) if simplify else whole, tuple(_core(*one) for one in inside))


def _whole(store: Store, surface: Surface) -> Any:
    solid = surface.solid
    return _at(_primitive(solid), solid.pose) if isinstance(solid, Primitive) else _at(_mesh(store, solid), surface.pose)


def _mesh(store: Store, mesh: Mesh) -> Any:
    """Create a solid from a mesh in the store. If the mesh is not closed, use its convex hull."""
    vertices, faces = arrays(store.read(mesh.sha256))
    solid = Manifold(Mesh64(vert_properties=vertices, tri_verts=faces.astype(np.uint64)))
    return Manifold.hull_points(vertices) if not mesh.closed or solid.num_tri() == 0 else solid


def _primitive(primitive: Primitive) -> Any:
    """Create a solid with facets from a primitive shape, in the frame of the primitive.

    Planes are infinite, as in simulators, and their size is ignored.
    """
    size = primitive.size
    match primitive.shape:
        case "box":
            return Manifold.cube([2.0 * half for half in size], True)
        case "sphere":
            return Manifold.sphere(size[0], FACETS)
        case "ellipsoid":
            return Manifold.sphere(1.0, FACETS).scale(size)
        case "cylinder":
            return Manifold.cylinder(2.0 * size[1], size[0], size[0], FACETS, True)
        case "capsule":
            ball = Manifold.sphere(size[0], FACETS)
            return Manifold.batch_hull([ball.translate((0.0, 0.0, end)) for end in (-size[1], size[1])])
        case "plane":
            return Manifold.cube([2.0 * ENDLESS, 2.0 * ENDLESS, ENDLESS], True).translate((0.0, 0.0, -ENDLESS / 2.0))
        case _:
            assert_never(primitive.shape)


def _core(whole: Any, solid: Mesh | Primitive) -> tuple[Any, float]:
    """Return the core of a solid and its radius. The core is the solid itself, except for spheres and capsules."""
    if not isinstance(solid, Primitive) or solid.shape not in ("sphere", "capsule"):
        return whole, 0.0
    radius, half = (*solid.size, 0.0)[:2]
    return _at(Manifold.cube([THIN, THIN, 2.0 * half + THIN], True), solid.pose), radius


def _at(solid: Any, pose: Pose) -> Any:
    return solid.transform(np.hstack([np.array(pose.rotation), np.array(pose.translation)[:, None]]))

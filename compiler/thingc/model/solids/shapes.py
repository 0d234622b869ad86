"""Represent the exact shapes of parts and links as solids of manifold3d, and compute their distances and intersections."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import product
from typing import Any

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
"""Number of facets around a cylinder or another curved surface. The approximation error is less than 0.1 % of the radius."""
THIN = 1e-8
"""Thickness [m] of the solids that replace a point or a line, because manifold3d supports only solids with a volume."""
ROUNDING = 1e-12
"""Relative rounding error of distances."""
ENDLESS = 100.0
"""Size [m] of the solid that replaces an infinite plane, and thickness of this solid."""


class Solid(FrozenStruct, kw_only=False):
    """A solid, for computing distances to other solids and intersections with other solids.

    `whole` is the solid with facets on curved surfaces. `cores` contains core solids, each with a radius [m]. All points whose distance
    from the core is at most the radius belong to the solid. The core of a sphere is a point, and the core of a capsule is a line, so that
    distances are exact and fast to compute.
    """

    whole: Any
    cores: tuple[tuple[Any, float], ...]

    def at(self, pose: Pose) -> Solid:
        """Return a copy of the solid at a pose."""
        return Solid(_at(self.whole, pose), tuple((_at(core, pose), radius) for core, radius in self.cores))

    def box(self, pose: Pose) -> NDArray[np.float64]:
        """Return the bounding box (2 x 3: low, high) [m] of the solid at a pose, along the axes of the world."""
        bounds = self.whole.bounding_box()
        return np.array(pose.around((bounds[:3], bounds[3:])))

    def gap(self, other: Solid, within: float) -> float:
        """Return the distance [m] to another solid.

        Distances above `within` are not computed: the result is then `within`. The distance is 0 if the solids intersect.
        """
        gap = within
        for (one, more), (two, also) in product(self.cores, other.cores):
            reach = within + more + also
            found = float(one.min_gap(two, reach))
            if found < reach * (1.0 - ROUNDING):  # otherwise the rounding error of the difference would count as a smaller distance
                gap = min(gap, max(found - more - also, 0.0))
        return gap

    def overlap(self, other: Solid) -> tuple[float, float]:
        """Return the volume [m^3] of the intersection with another solid, and its mean thickness [m].

        The mean thickness is twice the volume divided by the surface area. For a thin layer, it is the thickness of the layer. The volume
        and the thickness are 0 if the solids only touch.
        """
        shared = self.whole ^ other.whole
        volume = float(shared.volume())
        return (volume, 2.0 * volume / float(shared.surface_area())) if volume > 0.0 else (0.0, 0.0)


class Solids:
    """The solids of parts and links, keyed by the text of the definition. A solid is created when it is first needed.

    Lengths are in metres, and each solid is in the frame of its part or link.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._solids: dict[str, Solid | None] = {}
        self.hulls: set[str] = set()
        """Definition texts of parts whose surface is not closed and is replaced by its convex hull."""

    def solid(self, occurrence: Occurrence) -> Solid | None:
        """Return the solid of a part or link, which is created from the same meshes as the output files.

        Return None if the part or link does not have a solid shape.
        """
        text = occurrence.definition.text
        if text not in self._solids:
            self._solids[text] = solid_of(self._store, occurrence.solids)
            if any(isinstance(one.solid, Mesh) and not one.solid.closed for one in occurrence.solids):
                self.hulls.add(text)
        return self._solids[text]


def solid_of(store: Store, surfaces: Sequence[Surface], *, simplify: float = 0.0) -> Solid | None:
    """Create the solid that is enclosed by several surfaces, in the frame of the surfaces.

    Return None if none of the surfaces encloses a volume.

    `simplify` [m] is the tolerance for reducing the number of facets. With a tolerance, intersections take half the time.
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

    The size of a plane is ignored, because planes are infinite in simulators.
    """
    size = primitive.size
    match primitive.shape:
        case "box":
            return Manifold.cube([2.0 * half for half in size], True)
        case "sphere":
            return _unit_sphere().scale([size[0]] * 3)
        case "ellipsoid":
            return _unit_sphere().scale(size)
        case "cylinder":
            return Manifold.cylinder(2.0 * size[1], size[0], size[0], FACETS, True)
        case "capsule":
            ball = _unit_sphere().scale([size[0]] * 3)
            return Manifold.batch_hull([ball.translate((0.0, 0.0, end)) for end in (-size[1], size[1])])
        case "plane":
            return Manifold.cube([2.0 * ENDLESS, 2.0 * ENDLESS, ENDLESS], True).translate((0.0, 0.0, -ENDLESS / 2.0))


@cache
def _unit_sphere() -> Any:
    """Return a sphere with a radius of 1 m, because scaling a sphere is twenty times as fast as creating one."""
    return Manifold.sphere(1.0, FACETS)


def _core(whole: Any, solid: Mesh | Primitive) -> tuple[Any, float]:
    """Return the core of a solid and the radius around the core. The core is the solid itself, except for spheres and capsules."""
    if not isinstance(solid, Primitive) or solid.shape not in ("sphere", "capsule"):
        return whole, 0.0
    radius, half = (*solid.size, 0.0)[:2]
    return _at(Manifold.cube([THIN, THIN, 2.0 * half + THIN], True), solid.pose), radius


def _at(solid: Any, pose: Pose) -> Any:
    return solid.transform(np.hstack([np.array(pose.rotation), np.array(pose.translation)[:, None]]))

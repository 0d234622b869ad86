"""The true shapes of parts and links as solids of manifold3d, and how they lie to each other."""

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
"""Around whatever is round: less than 0.1 % of the radius off its surface."""
THIN = 1e-8
"""How thick [m] what stands for a point or a line is: manifold3d knows neither."""
ENDLESS = 100.0
"""How far [m] a plane reaches, and the matter below it."""


class Solid(FrozenStruct, kw_only=False):
    """What something is made of. `whole` is all of it, with facets where it is round. `cores` are solids each with a radius [m]: what is
    nearer to the core than that is of it. So gaps to balls and capsules are exact, and are found in no time: their cores are points and
    lines."""

    whole: Any
    cores: tuple[tuple[Any, float], ...]

    def at(self, pose: Pose) -> Solid:
        """The same somewhere else."""
        return Solid(_at(self.whole, pose), tuple((_at(core, pose), radius) for core, radius in self.cores))

    def box(self, pose: Pose) -> NDArray[np.float64]:
        """A box (2 x 3: low, high) [m] along the axes of the world around it at a pose."""
        bounds = np.array(self.whole.bounding_box(), dtype=np.float64).reshape(2, 3)
        middle, half = (bounds[0] + bounds[1]) / 2.0, (bounds[1] - bounds[0]) / 2.0
        turn = np.array(pose.rotation)
        centre, reach = turn @ middle + np.array(pose.translation), np.abs(turn) @ half
        return np.stack([centre - reach, centre + reach])

    def gap(self, other: Solid, within: float) -> float:
        """How far [m] it is apart from another one, 0 where they meet; no less than `within` where that is not near."""
        return min(
            max(float(one.min_gap(two, within + more + also)) - more - also, 0.0)
            for one, more in self.cores for two, also in other.cores
        )

    def overlap(self, other: Solid) -> tuple[float, float]:
        """Of what it shares with another one: the volume [m^3], and its mean thickness [m], twice the volume by the surface (of a thin
        layer that is its thickness). 0 where they only touch."""
        shared = self.whole ^ other.whole
        volume = float(shared.volume())
        return (volume, 2.0 * volume / float(shared.surface_area())) if volume > 0.0 else (0.0, 0.0)


class Solids:
    """The solids of parts and links by the texts of their definitions, made when first asked for. Metres, their own frames."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._solids: dict[str, Solid | None] = {}
        self.hulls: set[str] = set()
        """The texts of the definitions of which a surface is not closed: its convex hull stands for it."""

    def solid(self, occurrence: Occurrence) -> Solid | None:
        """What a part or link is made of, meshes as in the artifacts; None without anything that has an inside."""
        text = occurrence.definition.text
        if text not in self._solids:
            self._solids[text] = solid_of(self._store, occurrence.solids)
            if any(isinstance(one.solid, Mesh) and not one.solid.closed for one in occurrence.solids):
                self.hulls.add(text)
        return self._solids[text]


def solid_of(store: Store, surfaces: Sequence[Surface], *, simplify: float = 0.0) -> Solid | None:
    """The solid within some surfaces, in their frame, or None if none of them has an inside. `simplify` [m] is how far its facets may
    move so that there are fewer of them: intersections then take half of the time."""
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
    """The solid within a mesh of the store, or within its convex hull where it is not closed."""
    vertices, faces = arrays(store.read(mesh.sha256))
    solid = Manifold(Mesh64(vert_properties=vertices, tri_verts=faces.astype(np.uint64)))
    return Manifold.hull_points(vertices) if not mesh.closed or solid.num_tri() == 0 else solid


def _primitive(primitive: Primitive) -> Any:
    """A primitive with facets, in its own frame. Planes do not end, whatever their lengths: so simulators have them."""
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
    """The core of a solid, and its radius: itself, but for those that are round all over."""
    if not isinstance(solid, Primitive) or solid.shape not in ("sphere", "capsule"):
        return whole, 0.0
    radius, half = (*solid.size, 0.0)[:2]
    return _at(Manifold.cube([THIN, THIN, 2.0 * half + THIN], True), solid.pose), radius


def _at(solid: Any, pose: Pose) -> Any:
    return solid.transform(np.hstack([np.array(pose.rotation), np.array(pose.translation)[:, None]]))

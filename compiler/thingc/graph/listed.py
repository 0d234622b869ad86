"""The geometry of a link, whose shapes are listed, and what it weighs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from thingc.graph.types import Listed, Surface
from thingc.inertia import MassProperties, total
from thingc.pose import Vector
from thingc.resolve.link_definition import LinkDefinition, ListedShape
from thingc.resolve.model import Material


def listed(definition: LinkDefinition, material: Material | None) -> Listed:
    """What of a link of this material is drawn, and what touches."""
    surfaces = [(shape, _surface(shape, material)) for shape in definition.shapes]
    return Listed(
        drawn=tuple(surface for shape, surface in surfaces if shape.drawn),
        touching=tuple(surface for shape, surface in surfaces if shape.touches),
        box=_around(shape.solid.box for shape in definition.shapes if shape.solid.shape != "plane"),
    )


def _surface(shape: ListedShape, material: Material | None) -> Surface:
    own = shape.material or material
    return Surface(solid=shape.solid, material=own, color=shape.color or (own.color if own is not None else None))


def _around(boxes: Iterable[tuple[Vector, Vector]]) -> tuple[Vector, Vector] | None:
    """The box around boxes; None around none."""
    corners = [corner for box in boxes for corner in box]
    if not corners:
        return None
    (ax, bx), (ay, by), (az, bz) = ((min(side), max(side)) for side in zip(*corners, strict=True))
    return (ax, ay, az), (bx, by, bz)


def solid_shapes(definition: LinkDefinition) -> Sequence[ListedShape]:
    """The shapes that a link is taken to be made of: those that touch, or where none does those that are drawn."""
    return [one for one in definition.shapes if one.touches] or [one for one in definition.shapes if one.drawn]


def matter_of(definition: LinkDefinition) -> MassProperties:
    """What a link is made of, at density 1: its volume [m^3] as the mass, centre [m] and inertia [m^5]."""
    return total(shape.solid.matter for shape in solid_shapes(definition))


def weight_of(definition: LinkDefinition, material: Material | None) -> MassProperties | None:
    """The same by the densities of its shapes' materials: mass [kg], inertia [kg m^2]; nothing where none has one, None where only some
    have."""
    weights: list[MassProperties] = []
    solids = [shape for shape in solid_shapes(definition) if shape.solid.matter.mass > 0.0]
    for shape in solids:
        own, matter = shape.material or material, shape.solid.matter
        if own is not None and own.density is not None:
            weights.append(matter.with_mass(own.density * matter.mass))
    return total(weights) if len(weights) in (0, len(solids)) else None

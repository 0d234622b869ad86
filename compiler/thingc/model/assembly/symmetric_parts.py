"""Replace mirror images of symmetric parts, such as screws, bearings and plates, by the original part."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from thingc.geometry.record import PartDefinition, PartFailure, PartRecord
from thingc.model.resolve.types import AssemblyDefinition, Component


def with_own_images(model: AssemblyDefinition, records: Mapping[str, PartRecord | PartFailure]) -> AssemblyDefinition:
    """Return a copy of the model in which mirror images of symmetric parts are replaced by the original part.

    The replaced component also gets the order number of the original component in the bill of materials.

    `records` contains the records of all definitions in the model, and of the originals of mirror images.
    """
    made: dict[int, AssemblyDefinition] = {}  # equal definitions remain the same object, and unchanged definitions are not copied

    def of(definition: AssemblyDefinition) -> AssemblyDefinition:
        if id(definition) not in made:
            components = tuple(map(of_component, definition.components))
            same = all(new is old for new, old in zip(components, definition.components, strict=True))
            made[id(definition)] = definition if same else replace(definition, components=components)
        return made[id(definition)]

    def of_component(component: Component) -> Component:
        definition = component.definition
        if isinstance(definition, AssemblyDefinition):
            inner = of(definition)
            return component if inner is definition else replace(component, definition=inner)
        if not isinstance(definition, PartDefinition) or component.image_of is None or definition.plain is None:
            return component
        if not _is_own_image(records.get(definition.text), records.get(definition.plain.text)):
            return component
        return replace(component, definition=definition.plain, bom=component.image_of.bom, mounts_mirrored=definition.mirror)

    return of(model)


def _is_own_image(image: PartRecord | PartFailure | None, plain: PartRecord | PartFailure | None) -> bool:
    """Return whether a part equals its mirror image: solid, mounts, and specified centre of mass and inertia must be equal."""
    if not isinstance(image, PartRecord) or not isinstance(plain, PartRecord):
        return False
    return image.own_image and (image.com, image.matrix) == (plain.com, plain.matrix)

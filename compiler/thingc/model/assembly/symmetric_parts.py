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
    return _Substituted(records).of(model)


class _Substituted:
    """Replaces mirror images of symmetric parts in a model by the original parts.

    Results are cached, so that equal definitions remain the same object, and unchanged definitions are not copied.
    """

    def __init__(self, records: Mapping[str, PartRecord | PartFailure]) -> None:
        self._records = records
        self._made: dict[int, AssemblyDefinition] = {}

    def of(self, definition: AssemblyDefinition) -> AssemblyDefinition:
        """Return a copy of one assembly in which mirror images of symmetric parts are replaced by the original part."""
        if id(definition) not in self._made:
            components = tuple(map(self._component, definition.components))
            same = all(new is old for new, old in zip(components, definition.components, strict=True))
            self._made[id(definition)] = definition if same else replace(definition, components=components)
        return self._made[id(definition)]

    def _component(self, component: Component) -> Component:
        definition = component.definition
        if isinstance(definition, AssemblyDefinition):
            inner = self.of(definition)
            return component if inner is definition else replace(component, definition=inner)
        if not isinstance(definition, PartDefinition) or component.image_of is None or definition.plain is None:
            return component
        if not self._is_own(definition, definition.plain):
            return component
        return replace(component, definition=definition.plain, bom=component.image_of.bom, mounts_mirrored=definition.mirror)

    def _is_own(self, definition: PartDefinition, plain: PartDefinition) -> bool:
        """Return whether a part equals its mirror image: solid, mounts, and specified centre of mass and inertia must be equal."""
        image, record = self._records.get(definition.text), self._records.get(plain.text)
        if not isinstance(image, PartRecord) or not isinstance(record, PartRecord):
            return False
        return image.own_image and (image.com, image.matrix) == (record.com, record.matrix)

"""How the parts of a model are printed, as far as their masses depend on it: what to ask the geometry service for."""

from __future__ import annotations

from collections.abc import Mapping

from thingc.graph.mass import merged, slicing_of
from thingc.realize.record import PartDefinition, PartFailure, PartRecord
from thingc.realize.slices import Slicing
from thingc.resolve.model import AssemblyDefinition, Component, Material, Process


def material_of(component: Component, record: PartRecord | None, scope: AssemblyDefinition) -> Material | None:
    """What a component is made of: what the document says, else the Thing's default where the document knows it."""
    if component.material is not None or record is None or record.material is None:
        return component.material
    return scope.materials.get(record.material)


def process_of(component: Component, material: Material | None) -> Process | None:
    """How a component is made: what it says, key by key on top of what its material says."""
    return merged(component.overrides.process, material.process if material is not None else None)


def slicings_of(
    model: AssemblyDefinition, records: Mapping[str, PartRecord | PartFailure],
) -> dict[str, set[Slicing]]:
    """The ways in which parts of a model are cut into layers, by the text of their definition. Equal copies of a part are one;
    a part that is printed in two ways has two."""
    slicings: dict[str, set[Slicing]] = {}
    waiting, met = [model], {id(model)}
    while waiting:
        scope = waiting.pop()
        for component in scope.components:
            definition = component.definition
            if isinstance(definition, AssemblyDefinition):
                if id(definition) not in met:
                    met.add(id(definition))
                    waiting.append(definition)
            elif isinstance(definition, PartDefinition):
                record = records.get(definition.text)
                if not isinstance(record, PartRecord):
                    continue
                process = process_of(component, material_of(component, record, scope))
                slicing = slicing_of(process, component.overrides, record)
                if slicing is not None:
                    slicings.setdefault(definition.text, set()).add(slicing)
    return slicings

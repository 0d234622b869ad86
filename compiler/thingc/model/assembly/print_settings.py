"""Collect the print settings that affect the mass of parts. The settings are part of the requests to the geometry service."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from thingc.geometry.print_slices import LikelySlicing, Slicing
from thingc.geometry.record import PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.model.assembly.mass import layers_of, merged, slicing_of
from thingc.model.resolve.nested_assemblies import assemblies_of
from thingc.model.resolve.types import AssemblyDefinition, Component, Material, Process


def material_of(component: Component, record: PartRecord | None, scope: AssemblyDefinition) -> Material | None:
    """Return the material of a component: the material in the document or, if `scope` contains it, the default of the part class."""
    if component.material is not None or record is None or record.material is None:
        return component.material
    return scope.materials.get(record.material)


def process_of(component: Component, material: Material | None) -> Process | None:
    """Return the manufacturing process of a component. Settings of the component take precedence over settings of its material."""
    return merged(component.overrides.process, material.process if material is not None else None)


def slicings_of(model: AssemblyDefinition, records: Mapping[str, PartRecord | PartFailure]) -> dict[str, set[Slicing]]:
    """Return the slicing settings of all printed parts of a model, keyed by the text of the part's definition.

    If components print the same part differently, the result contains several settings for the part.
    """
    slicings: dict[str, set[Slicing]] = {}
    for definition, component, scope in _parts(model):
        record = records.get(definition.text)
        if not isinstance(record, PartRecord):
            continue
        process = process_of(component, material_of(component, record, scope))
        slicing = slicing_of(process, component.overrides, record)
        if slicing is not None:
            slicings.setdefault(definition.text, set()).add(slicing)
    return slicings


def likely_slicings(model: AssemblyDefinition, schemas: Mapping[str, PartSchema | PartFailure]) -> dict[str, set[LikelySlicing]]:
    """Predict the slicing settings of parts before the parts are built. The materials are predicted from the part classes."""
    likely: dict[str, set[LikelySlicing]] = {}
    for definition, component, scope in _parts(model):
        schema, material, up = schemas.get(definition.reference), component.material, component.overrides.up
        if material is None and isinstance(schema, PartSchema):
            material = scope.materials.get(schema.material or "")
        slicing = layers_of(process_of(component, material), up)
        if slicing is not None:
            likely.setdefault(definition.text, set()).add((slicing, up is None))
    return likely


def _parts(model: AssemblyDefinition) -> Iterator[tuple[PartDefinition, Component, AssemblyDefinition]]:
    """Yield the distinct parts of each assembly, with their components."""
    for scope in assemblies_of(model):
        for component in scope.components:
            if isinstance(component.definition, PartDefinition):
                yield component.definition, component, scope

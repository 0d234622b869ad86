"""Iterate over the definitions of all nested assemblies and parts of a model."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.geometry.record import PartDefinition
from thingc.model.resolve.types import AssemblyDefinition


def assemblies_of(model: AssemblyDefinition) -> Iterator[AssemblyDefinition]:
    """Yield the definition of the top assembly, then the definitions of all nested assemblies without duplicates."""
    waiting, met = [model], {id(model)}
    for definition in waiting:
        yield definition
        for component in definition.components:
            inner = component.definition
            if isinstance(inner, AssemblyDefinition) and id(inner) not in met:
                met.add(id(inner))
                waiting.append(inner)


def decomposed(model: AssemblyDefinition) -> frozenset[str]:
    """Return the definition texts of the parts whose meshes must be decomposed into convex pieces.

    The components of these parts set `collision: decompose`.
    """
    return frozenset(
        one.definition.text for definition in assemblies_of(model) for one in definition.components
        if isinstance(one.definition, PartDefinition) and one.overrides.collision == "decompose"
    )


def part_definitions(model: AssemblyDefinition) -> tuple[PartDefinition, ...]:
    """Return the part definitions of a model without duplicates, in document order. A nested document is traversed at its first use."""
    definitions: dict[PartDefinition, None] = {}
    seen: set[tuple[str, object, str | None]] = set()
    waiting = [iter(model.components)]
    while waiting:
        component = next(waiting[-1], None)
        if component is None:
            waiting.pop()
            continue
        definition = component.definition
        if isinstance(definition, PartDefinition):
            definitions.setdefault(definition)
            if component.image_of is not None and definition.plain is not None:  # the part may equal its mirror image
                definitions.setdefault(definition.plain)
        elif isinstance(definition, AssemblyDefinition):
            key = (definition.document, definition.parameters, definition.mirror)
            if key not in seen:
                seen.add(key)
                waiting.append(iter(definition.components))
    return tuple(definitions)

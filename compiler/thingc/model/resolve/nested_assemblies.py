"""Iterate over the definitions of all nested assemblies and parts of a model."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.geometry.record import PartDefinition, WantedPieces
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


def find_decompositions(model: AssemblyDefinition) -> WantedPieces:
    """Return the convex decompositions of the parts whose components set `collision: decompose`."""
    wanted: dict[str, set[int]] = {}
    for one in (one for definition in assemblies_of(model) for one in definition.components):
        pieces = {choice.pieces for choice in one.overrides.choices.values() if choice.collision == "decompose"}
        if isinstance(one.definition, PartDefinition) and pieces:
            wanted.setdefault(one.definition.text, set()).update(pieces)
    return {text: tuple(sorted(several)) for text, several in wanted.items()}


def part_definitions(model: AssemblyDefinition) -> tuple[PartDefinition, ...]:
    """Return the part definitions of a model without duplicates, in document order. A nested document is traversed at its first use."""
    definitions: dict[PartDefinition, None] = {}
    seen: set[tuple[str, object, str | None]] = set()

    def visit(assembly: AssemblyDefinition) -> None:
        for component in assembly.components:
            definition = component.definition
            if isinstance(definition, PartDefinition):
                definitions.setdefault(definition)
                if component.image_of is not None and definition.plain is not None:  # the part may equal its mirror image
                    definitions.setdefault(definition.plain)
            elif isinstance(definition, AssemblyDefinition):
                key = (definition.document, definition.parameters, definition.mirror)
                if key not in seen:
                    seen.add(key)
                    visit(definition)

    visit(model)
    return tuple(definitions)

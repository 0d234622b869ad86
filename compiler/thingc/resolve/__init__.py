"""The pass from checked documents to the model: parameters, expressions, units, references, defaults, repeats, patterns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from thingc.diagnostics import Report
from thingc.realize.record import PartDefinition, PartFailure, PartSchema
from thingc.resolve.model import AssemblyDefinition

if TYPE_CHECKING:
    from thingc.load import Documents
    from thingc.spec.doubts import Specs
    from thingc.workspace import Workspace

__all__ = ["part_definitions", "resolve", "resolve_materials"]


def resolve(
    documents: Documents, specs: Specs, workspace: Workspace,
    schemas: Mapping[str, PartSchema | PartFailure], parameters: Mapping[str, str], report: Report,
) -> AssemblyDefinition | None:
    """The model of the root document.

    `specs` has the documents (or their sound rest) by their path in the workspace, `schemas` what each `part:` takes,
    `parameters` the texts of `-p NAME=VALUE`. Everything wrong is reported; what depends on it is left out of the model.
    None where the root document is unsound as a whole.
    """
    from thingc.resolve.assembly import resolved
    from thingc.resolve.parameters import from_command_line
    from thingc.resolve.table import Context
    from thingc.spec.assembly import AssemblySpec

    root = documents.root
    spec = specs.get(root.relative)
    if not isinstance(spec, AssemblySpec):
        return None
    context = Context(documents=documents, specs=specs, workspace=workspace, schemas=schemas, report=report)
    context.nesting.append(root.relative)
    given = from_command_line(context, root, spec, parameters)
    return resolved(context, root.relative, spec, given, top=True).definition


def resolve_materials(
    documents: Documents, specs: Specs, workspace: Workspace, report: Report
) -> None:
    """Report what is wrong with a `materials/1` document that is checked by itself."""
    from thingc.resolve.materials import of_document
    from thingc.resolve.table import Context

    context = Context(documents=documents, specs=specs, workspace=workspace, schemas={}, report=report)
    of_document(context, documents.root)


def part_definitions(model: AssemblyDefinition) -> tuple[PartDefinition, ...]:
    """Every part definition of a model once, in document order (nested documents where they first stand)."""
    found: dict[PartDefinition, None] = {}
    seen: set[tuple[str, object]] = set()
    waiting = [iter(model.components)]
    while waiting:
        component = next(waiting[-1], None)
        if component is None:
            waiting.pop()
            continue
        definition = component.definition
        if isinstance(definition, PartDefinition):
            found.setdefault(definition)
        elif definition is not None and (definition.document, definition.parameters) not in seen:
            seen.add((definition.document, definition.parameters))
            waiting.append(iter(definition.components))
    return tuple(found)

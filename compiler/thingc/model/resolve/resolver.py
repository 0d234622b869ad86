"""The pass `resolve`, which converts validated documents to the model.

The pass evaluates parameters, expressions, units, references, defaults, repeats and patterns.

The inputs of the pass are `Settings` and `Sources`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from thingc.base.diagnostics import MAX_FAULTS, Code, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.units import Quantity
from thingc.documents.load.documents import Documents
from thingc.documents.spec.invalid_entries import Specs
from thingc.documents.workspace import Workspace
from thingc.geometry.record import PartFailure, PartSchema
from thingc.geometry.store.file_digests import digest_of
from thingc.model.resolve.types import AssemblyDefinition


class Settings(FrozenStruct):
    """The settings that a user specifies outside the documents: parameters (`-p`) and values at paths (`--set`).

    `parameters` maps names to strings such as `{"reach": "120 mm"}`. `choices` maps paths in the root document to strings such as
    `{"components.foot.part": "feet:Wide"}`. `quantities` contains parsed values, which replace some of these strings.
    """

    parameters: Mapping[str, str] = {}
    choices: Mapping[str, str] = {}
    quantities: Mapping[str, Quantity] = {}


class Sources(FrozenStruct):
    """The inputs of the pass `resolve`: parsed documents, their validated models, and the parameter schemas of parts.

    `Sources` also contains a function that returns the SHA-256 of a file.
    """

    workspace: Workspace
    documents: Documents
    specs: Specs
    schemas: Mapping[str, PartSchema | PartFailure]
    digest: Callable[[str], str] = digest_of


def resolve(
    sources: Sources, settings: Settings, report: Report, memo: Memo | None = None, nested_memo: Memo | None = None,
) -> AssemblyDefinition | None:
    """Resolve the root document of `sources` with these settings.

    `sources` must also contain the documents and parts that the choices select.

    All errors are added to `report`. Elements that depend on invalid elements are omitted from the model. Return None if the root document
    is invalid as a whole. The cache `memo` contains results that are valid for these documents. The cache `nested_memo` contains results of
    nested documents that remain valid if only the root document changes.
    """
    from thingc.documents.spec.assembly import AssemblySpec
    from thingc.model.resolve import choices as choose
    from thingc.model.resolve.assembly import resolve_assembly
    from thingc.model.resolve.document_scope import ResolveRun
    from thingc.model.resolve.parameters import from_command_line
    from thingc.model.resolve.scope import TooManyErrors

    root = sources.documents.root
    spec = sources.specs.get(root.relative)
    if not isinstance(spec, AssemblySpec):
        return None
    context = ResolveRun(
        documents=sources.documents, specs=sources.specs, workspace=sources.workspace, schemas=sources.schemas, report=report,
        digest=sources.digest, quantities=settings.quantities, memo=memo or Memo(),
        nested_memo=Memo() if nested_memo is None or settings != Settings() else nested_memo,
    )
    context.recall()
    context.nesting.append(root.relative)
    parameters = from_command_line(context, spec, settings.parameters)
    chosen = choose.from_command_line(context, settings.choices) if settings.choices else ()
    try:
        table = resolve_assembly(context, root.relative, spec, parameters, chosen, top=True)
    except TooManyErrors:
        report.add(Code.TOO_LARGE, f"more than {MAX_FAULTS} errors; further errors are not shown", None)
        return None
    if context.overfull:
        return None
    context.remember(table)
    return table.definition


def resolve_materials(sources: Sources, report: Report) -> None:
    """Report errors and suspicious values of a `materials/1` document that is not part of an assembly."""
    from thingc.model.resolve.document_scope import ResolveRun
    from thingc.model.resolve.materials import of_document
    from thingc.model.resolve.plausibility import density_cure, density_doubt

    context = ResolveRun(documents=sources.documents, specs=sources.specs, workspace=sources.workspace, schemas={}, report=report)
    for material in of_document(context, context.documents.root).values():
        doubt = None if material is None or material.density is None else density_doubt(material.density)
        if material is not None and doubt is not None:
            report.warn(
                Code.DENSITY, f"the density of `{material.name}` {doubt.words}", material.density_origin,
                path=f"materials.{material.name}.density", help=density_cure(doubt),
            )

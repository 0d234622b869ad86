"""Validate documents with their pydantic models.

The module `validation_errors.py`, which explains errors, is only imported if a document has errors.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType

from pydantic_core import ValidationError

from thingc.base.diagnostics import Code, Report
from thingc.base.memo import Memo
from thingc.base.source import Document, ScalarNode, SequenceNode, Span, walk
from thingc.documents.load.documents import Documents
from thingc.documents.spec.allowances import allowances
from thingc.documents.spec.assembly import AssemblySpec
from thingc.documents.spec.base import Model
from thingc.documents.spec.catalog import CatalogSpec
from thingc.documents.spec.invalid_entries import InvalidEntries, Specs
from thingc.documents.spec.materials import MaterialsSpec

KINDS = ("assembly", "calibration", "materials", "variants", "workspace")
"""Kinds of documents that have a pydantic model. The model of the kind `assembly` is the class `AssemblySpec` in `spec.assembly`."""


def model_of(kind: str) -> type[Model] | None:
    """Return the pydantic model of a kind of document or table, such as `assembly`. Return None for an unknown kind."""
    if kind == "motion":
        return Model
    if kind not in (*KINDS, "catalog"):
        return None
    model: type[Model] = getattr(import_module(f"{__package__}.{kind}"), f"{kind.capitalize()}Spec")
    return model


def validate(documents: Documents, report: Report, memo: Memo | None = None) -> Specs:
    """Validate all documents, and return their models, keyed by the path of the document in the workspace.

    For an invalid document, all errors are reported. Its model contains only the valid entries, and `doubts` contains the removed entries.
    Documents without useful valid entries are omitted. `memo` caches the models of valid documents.
    """
    specs, memo = Specs(), memo or Memo()
    for path, document in documents.by_path.items():
        cache_key, content, reported_before = ("spec", path), (document.sha256,), len(report.diagnostics)
        spec, doubts = memo.last(cache_key, content) or _validate_document(document, report)
        if len(report.diagnostics) == reported_before:
            memo.keep(cache_key, content, (spec, doubts))
        if isinstance(spec, (AssemblySpec, CatalogSpec, MaterialsSpec)) and path not in documents.broken:
            specs[path] = spec
            if doubts:
                specs.doubts[path] = doubts
            if isinstance(spec, AssemblySpec):
                specs.allowances.extend(allowances(spec, document))
    return specs


def validate_one(document: Document, report: Report) -> Model | None:
    """Validate one document. If the document is invalid, report all errors and return None."""
    spec, doubts = _validate_document(document, report)
    return None if doubts else spec


def _validate_document(document: Document, report: Report) -> tuple[Model | None, InvalidEntries]:
    """Validate a document, and report its errors. Return the model of its valid entries, and the removed entries.

    The model is None if no useful entries remain.
    """
    model = model_of(document.kind)
    if model is None:
        report.add(Code.WRONG_KIND, f"documents of kind `{document.kind}` are not supported yet", document.span(("thingc",)))
        return None, InvalidEntries()
    plain = document.tree.plain()
    assert isinstance(plain, dict)
    plain.pop("$schema", None)  # for editors
    nodes = tuple(walk(document.tree))
    empty = {path: node for path, node in nodes if isinstance(node, ScalarNode) and node.value is None}
    damaged = frozenset(path for path, node in nodes if not isinstance(node, SequenceNode) and node.damaged)
    _build(model)
    error = None
    try:
        spec = model.model_validate(plain, strict=True)
        if not empty and not damaged:
            return spec, InvalidEntries()
    except ValidationError as raised:
        error = raised
    from thingc.documents.spec.validation_errors import valid_entries

    return valid_entries(document, model, plain, error, empty, damaged, report)


def _build(model: type[Model]) -> None:
    """Build the validator of a pydantic model when it is first used.

    pydantic normally searches all installed packages for plugins first. This search is skipped here, because the search takes longer than
    validating a document.
    """
    if model.__pydantic_complete__:
        return
    name = "pydantic.plugin._loader"
    stub, original = ModuleType(name), sys.modules.get(name)
    stub.__dict__["get_plugins"] = tuple
    sys.modules[name] = stub
    try:
        model.model_rebuild()
    finally:
        del sys.modules[name]
        if original is not None:
            sys.modules[name] = original


def documents_in_lumps(specs: Specs, documents: Documents) -> frozenset[str]:
    """Return the absolute paths of the assembly documents that are nested only in components with `as: lump`."""
    assemblies = {path: spec for path, spec in specs.items() if isinstance(spec, AssemblySpec)}
    if all(component.as_ is None for spec in assemblies.values() for component in spec.components.values()):
        return frozenset()
    uses = {(documents.root.relative, False)}
    waiting = [*uses]
    for outer, in_lump in waiting:  # the list grows
        for component in assemblies[outer].components.values() if outer in assemblies else ():
            document = documents.find_referenced(documents.by_path[outer], component.assembly) if component.assembly else None
            if document is not None and (use := (document.relative, in_lump or component.as_ is not None)) not in uses:
                uses.add(use)
                waiting.append(use)
    lumps, others = ({path for path, in_lump in uses if in_lump is wanted} for wanted in (True, False))
    return frozenset(documents.by_path[path].path for path in lumps - others)


def part_references(specs: Specs, documents: Documents) -> tuple[tuple[str, Span], ...]:
    """Return every reference to a part class (`part: module:Class`) in the assembly documents, with its location and in source order."""
    references: list[tuple[str, Span]] = []
    for path, spec in specs.items():
        if isinstance(spec, AssemblySpec):
            document = documents.by_path[path]
            references.extend(
                (component.part, document.span(("components", name, "part")))
                for name, component in spec.components.items() if component.part is not None
            )
    return tuple(references)

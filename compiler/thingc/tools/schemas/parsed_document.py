"""A document read for its editor: its tree and its model, as far as they are sound."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from thingc.base.diagnostics import Code, Report
from thingc.base.frozen import dataclass
from thingc.geometry.record import PartFailure, PartSchema

if TYPE_CHECKING:
    from thingc.documents.load.documents import Documents
    from thingc.documents.spec.invalid_entries import Specs
    from thingc.documents.workspace import Workspace
    from thingc.model.resolve.types import AssemblyDefinition

KINDS = ("assembly", "materials", "variants", "workspace")


@dataclass(frozen=True, slots=True, kw_only=True)
class ParsedDocument:
    """One document with those that it names, and the parts (`references`) that they name. `broken`: it is not well-formed, and this is what
    could be read of it."""

    documents: Documents
    specs: Specs
    references: tuple[str, ...]
    broken: bool

    @property
    def kind(self) -> str:
        """`assembly`, `materials`, `variants` or `workspace`."""
        return self.documents.root.kind

    def model(self, workspace: Workspace, schemas: Mapping[str, PartSchema | PartFailure]) -> AssemblyDefinition | None:
        """The model of its sound rest; None where nothing is sound."""
        from thingc.model.resolve.resolver import resolve
        from thingc.model.resolve.sources import Settings, Sources

        sources = Sources(workspace=workspace, documents=self.documents, specs=self.specs, schemas=schemas)
        return resolve(sources, Settings(), Report())


def read_document(path: str, workspace: Workspace) -> ParsedDocument | None:
    """Read a document; None if nothing of it can be read. Its errors are not reported here: `thingc check` does that."""
    from thingc.documents.load.documents import load
    from thingc.documents.spec.invalid_entries import Specs
    from thingc.documents.spec.validation import part_references, validate

    report = Report()
    documents = load(path, workspace, report, kinds=KINDS)
    if documents is None:
        return None
    specs = validate(documents, Report()) if documents.root.kind == "assembly" else Specs()
    return ParsedDocument(
        documents=documents, specs=specs,
        references=tuple(dict.fromkeys(reference for reference, _ in part_references(specs, documents))),
        broken=any(d.code is Code.SYNTAX and d.span is not None and d.span.file == path for d in report.diagnostics),
    )

"""A document read for its editor: its tree and its model, as far as they are sound, and the files that they come from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from thingc.diagnostics import Code, Report
from thingc.frozen import dataclass
from thingc.realize.record import PartFailure, PartSchema
from thingc.watching import Stat, stat_of

if TYPE_CHECKING:
    from thingc.load import Documents
    from thingc.resolve.model import AssemblyDefinition
    from thingc.spec import Specs
    from thingc.workspace import Workspace

KINDS = ("assembly", "materials", "variants", "workspace")

_ELSEWHERE = {Code.MISSING_FILE, Code.UNREADABLE, Code.WRONG_KIND, Code.SYNTAX, Code.HEADER}
"""Faults that a change of another file can mend."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One document and those that it names. `inputs` are their paths with what they were like before they were read;
    `waiting`: a document that it names was not there or not readable; `broken`: it is not well-formed, and this is what could
    be read of it."""

    relative: str
    documents: Documents
    specs: Specs
    references: tuple[str, ...]
    inputs: Mapping[str, Stat]
    waiting: bool
    broken: bool

    @property
    def kind(self) -> str:
        """`assembly`, `materials`, `variants` or `workspace`."""
        return self.documents.root.kind

    def current(self) -> bool:
        """Whether all of its files are as they were."""
        return all(stat_of(path) == state for path, state in self.inputs.items())

    def model(self, workspace: Workspace, schemas: Mapping[str, PartSchema | PartFailure]) -> AssemblyDefinition | None:
        """The model of its sound rest; None where nothing is sound."""
        from thingc.resolve import Settings, Sources, resolve

        sources = Sources(workspace=workspace, documents=self.documents, specs=self.specs, schemas=schemas)
        return resolve(sources, Settings(), Report())


def read(path: str, workspace: Workspace, seen: Mapping[str, Stat]) -> Reading | None:
    """Read a document; None where nothing of it can be. What is wrong with it is not said here: `thingc check` does.

    `seen` are the documents of the workspace as they were before.
    """
    from thingc.load import load
    from thingc.spec import Specs, part_references, validate

    report = Report()
    documents = load(path, workspace, report, kinds=KINDS)
    if documents is None:
        return None
    assembly = documents.root.kind == "assembly"
    specs = validate(documents, Report()) if assembly else Specs()
    return Reading(
        relative=documents.root.relative, documents=documents, specs=specs,
        references=tuple(dict.fromkeys(reference for reference, _ in part_references(specs, documents))),
        inputs={one.path: seen.get(one.path, stat_of(one.path)) for one in documents.by_path.values()},
        waiting=any(d.code in _ELSEWHERE for d in report.diagnostics),
        broken=any(d.code is Code.SYNTAX and d.span is not None and d.span.file == path for d in report.diagnostics),
    )

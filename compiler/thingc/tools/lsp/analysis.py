"""One document as it stands in an editor, unsaved, with everything that the compiler knows of it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.source import Document, MappingNode
from thingc.batch.variants_document import read_plan
from thingc.documents.load.documents import Documents, load
from thingc.documents.load.paths import DOCUMENT_SUFFIXES
from thingc.documents.workspace import OWN_FILE, Workspace
from thingc.driver import pipeline, up_to_date
from thingc.driver.environment import Environment, Lend, Options
from thingc.geometry.record import PartFailure, PartRecord, PartSchema
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.types import AssemblyDefinition
from thingc.model.robot.types import Robot
from thingc.tools.lsp.cached_parts import AvailableNames
from thingc.tools.lsp.positions import TextLines
from thingc.tools.schemas.document_facts import DocumentFacts, facts_of

T = TypeVar("T")


class OpenText(FrozenStruct):
    """A file that is open in the editor: its URI as the editor writes it, the version of its text, and the text."""

    uri: str
    version: int
    text: str


class Analysis(FrozenStruct, eq=False):
    """A document (absolute `path`) with the texts of all that is `open`, by absolute path.

    `workspace` is None where none was found; `documents` are the document's tree and those of all that it names, None where the text is
    too broken for one; `schemas` is what their parts take, by reference; `model`, `records` (by definition text), `assembly` and `robots`
    are what each pass has made of sound input. Of parts that workers have yet to answer for nothing is there. `findings` are what `check`
    says of the text, in its order. `whole`: the text is a well-formed document, so that no name is missing because of a slip in another
    line; `last` is the last analysis of this document that was, if this one is not. `in_reach` knows what else its workspace has to name.

    A file that is no document (a part's Python) has its text alone.
    """

    path: str
    open: Mapping[str, OpenText] = {}
    workspace: Workspace | None = None
    documents: Documents | None = None
    schemas: Mapping[str, PartSchema | PartFailure] = {}
    model: AssemblyDefinition | None = None
    records: Mapping[str, PartRecord | PartFailure] = {}
    assembly: Assembly | None = None
    robots: tuple[Robot, ...] = ()
    findings: tuple[Diagnostic, ...] = ()
    whole: bool = True
    last: Analysis | None = None
    looked_at: frozenset[str] = frozenset()
    in_reach: AvailableNames | None = None
    _kept: dict[str, Any] = {}
    """What was worked out of these texts: a copy with other texts needs an empty one."""

    @property
    def known(self) -> Analysis:
        """The analysis to take names from: this one, or the last one of a text that was whole. Its spans are of its own text."""
        return self if self.whole or self.last is None else self.last

    @property
    def text(self) -> str:
        """The document's own text; empty where it is not open and could not be read."""
        return self.text_of(self.path)

    @property
    def tree(self) -> MappingNode | None:
        """The document's own tree."""
        return None if self.documents is None else self.documents.root.tree

    @property
    def kind(self) -> str:
        """`assembly`, `materials`, `variants` or `workspace`; empty where it is none or not known."""
        return "" if self.documents is None else self.documents.root.kind

    def document(self, path: str) -> Document | None:
        """The document at an absolute path, this one or one that it names."""
        by_path = {} if self.documents is None else self.documents.by_path
        return next((one for one in by_path.values() if one.path == path), None)

    def text_of(self, path: str) -> str:
        """The text of a file as this analysis has seen it; empty where it cannot be read."""
        if path in self.open:
            return self.open[path].text
        document = self.document(path)
        if document is not None:
            return document.text
        try:
            with open(path, encoding="utf-8-sig", errors="replace", newline="") as stream:
                return stream.read(10_000_000)
        except (OSError, ValueError):
            return ""

    def lines(self, file: str | None = None) -> TextLines:
        """The lines of a file (of the document itself), for ranges."""
        path = self.path if file is None else file
        return self.once(f"lines {path}", lambda: TextLines(self.text_of(path)))

    def uri(self, path: str) -> str:
        """A file as the editor calls it."""
        return self.open[path].uri if path in self.open else Path(path).as_uri()

    def once(self, name: str, make: Callable[[], T]) -> T:
        """What is made of this analysis when it is asked for first."""
        if name not in self._kept:
            self._kept[name] = make()
        kept: T = self._kept[name]
        return kept

    @property
    def facts(self) -> DocumentFacts:
        """What the schemas of editors contain of it (`tools/schemas/`): its names, including those of wrong lines."""
        if (tree := self.tree) is None:
            return DocumentFacts()
        return self.once("facts", lambda: facts_of(tree, self.model, self.records, self.schemas, {}))


def is_document_path(path: str) -> bool:
    """Whether a file is called as documents are."""
    return path.lower().endswith(DOCUMENT_SUFFIXES)


def analyse(
    path: str, opened: Mapping[str, OpenText], options: Options, lend: Lend | None = None, memo: Memo | None = None,
    last: Analysis | None = None,
) -> Analysis:
    """What `check` finds out of the document at an absolute path, with these texts in the place of those on the disk.

    `options` say whether code may run and where the store is; `lend` who answers for parts (None: as for a check of its own; what it
    says of parts that are waited for is left out, see `cached_parts`); `memo` has the
    answers of the analysis before, `last` is that analysis. Whatever is wrong is among the findings.
    """
    if not is_document_path(path):
        return Analysis(path=path, open=opened)
    texts = {one: text.text.encode(errors="surrogatepass") for one, text in opened.items() if is_document_path(one)}
    options = replace(options, texts=texts)
    with Environment(path, options, lend, memo) as environment:
        if os.path.basename(path) == OWN_FILE:
            return _of_workspace(environment, opened, last)
        compilation = pipeline.check(environment)
        looked_at = up_to_date.looked_at(environment, compilation)
    report, documents = compilation.report, compilation.documents
    if documents is not None and documents.root.kind == "variants":
        report = Report()
        read_plan(path, options, report, lend)
    analysis = Analysis(
        path=path, open=opened, workspace=environment.workspace, documents=documents, schemas=compilation.schemas,
        model=compilation.model, records=compilation.records, assembly=compilation.assembly, robots=compilation.robots,
        findings=tuple(one for one in report.ordered() if one.code is not Code.NOT_LOCKED or not options.code),
        looked_at=frozenset(looked_at),
    )
    return _remembering(analysis, last)


def _of_workspace(environment: Environment, opened: Mapping[str, OpenText], last: Analysis | None) -> Analysis:
    """The analysis of a `thingc.toml`."""
    path, workspace = environment.document, environment.workspace
    general = workspace if workspace is not None else last.workspace if last is not None else None
    documents = load(path, general, Report(), kinds=("workspace",), texts=environment.options.texts) if general is not None else None
    return _remembering(Analysis(
        path=path, open=opened, workspace=workspace, documents=documents, findings=tuple(environment.report.ordered()),
        looked_at=frozenset([path]),
    ), last)


def _remembering(analysis: Analysis, last: Analysis | None) -> Analysis:
    """The analysis, with the last one that was whole where it is not."""
    whole = analysis.documents is not None and not any(
        one.code is Code.SYNTAX and one.span is not None and one.span.file == analysis.path for one in analysis.findings
    )
    return analysis if whole else replace(analysis, whole=False, last=last.known if last is not None else None)

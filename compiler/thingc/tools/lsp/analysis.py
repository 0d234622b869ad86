"""Check a document for the language server, including the unsaved text of files that are open in the editor."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.source import Document, MappingNode, Span
from thingc.batch.variants_document import read_plan
from thingc.documents.load.documents import Documents, load
from thingc.documents.load.paths import DOCUMENT_SUFFIXES
from thingc.documents.workspace import OWN_FILE, Workspace
from thingc.driver import pipeline, up_to_date
from thingc.driver.environment import Environment, Options, PartsProvider
from thingc.geometry.record import PartFailure, PartRecord, PartSchema
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.types import AssemblyDefinition
from thingc.model.robot.types import Robot
from thingc.tools.lsp.cached_parts import AvailableNames
from thingc.tools.lsp.positions import TextLines, map_spans
from thingc.tools.schemas.document_facts import DocumentFacts, facts_of

T = TypeVar("T")


class OpenText(FrozenStruct):
    """The text of a file that is open in the editor, with the editor's URI of the file and the version of the text."""

    uri: str
    version: int
    text: str


class Analysis(FrozenStruct, eq=False):
    """The results of checking the document at the absolute path `path`.

    `open` maps the absolute paths of open files to their unsaved texts. If the file is not a document, such as a Python file, the analysis
    contains only the text. Parts without a cached result are missing from all attributes.

    Attributes:
        workspace: The workspace of the document, or None if there is no workspace.
        documents: The document and all documents to which it refers, or None if the text cannot be parsed.
        schemas: The schemas of the parts in the document, keyed by part reference.
        model: The result of the compiler pass `resolve`, or None if the input of the pass is invalid. `records` (keyed by definition text),
            `assembly` and `robots` are results of later passes.
        findings: The diagnostics of the document, in the order of `thingc check`.
        well_formed: Whether the text is well-formed. After a syntax error, names may be missing from the results.
        last: The last analysis in which the text was well-formed, if `well_formed` is false.
        available_names: The names of parts and documents in the workspace.
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
    well_formed: bool = True
    last: Analysis | None = None
    dependencies: frozenset[str] = frozenset()
    available_names: AvailableNames | None = None
    _cache: dict[str, Any] = {}
    """The cached results of this analysis. A copy of the analysis with other texts must have an empty cache."""

    @property
    def known(self) -> Analysis:
        """This analysis if its text is well-formed, else the last analysis of well-formed text. Use this analysis to look up names.

        Spans in the last analysis refer to the text of that analysis, not to the current text.
        """
        return self if self.well_formed or self.last is None else self.last

    @property
    def text(self) -> str:
        """The text of the document, or an empty string if the document is not open and cannot be read."""
        return self.text_of(self.path)

    @property
    def tree(self) -> MappingNode | None:
        """The syntax tree of the document, or None if the text cannot be parsed."""
        return None if self.documents is None else self.documents.root.tree

    @property
    def kind(self) -> str:
        """The kind of the document: `assembly`, `materials`, `variants` or `workspace`, or an empty string if unknown."""
        return "" if self.documents is None else self.documents.root.kind

    def document(self, path: str) -> Document | None:
        """Return the document at an absolute path if it is the analysed document or a document to which this document refers, else None."""
        by_path = {} if self.documents is None else self.documents.by_path
        return next((one for one in by_path.values() if one.path == path), None)

    def text_of(self, path: str) -> str:
        """Return the text of a file in this analysis, or an empty string if the file cannot be read."""
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
        """Return the lines of a file. The default is the analysed document."""
        path = self.path if file is None else file
        return self.compute_once(f"lines {path}", lambda: TextLines(self.text_of(path)))

    def current_span(self, span: Span) -> Span | None:
        """Convert a span in the last well-formed text to a span in the current text. Return None if the lines of the span have changed."""
        return span if self.known is self else map_spans(self.known.text, self.text)(span)

    def uri(self, path: str) -> str:
        """Return the URI of a file. If the file is open, return the URI that the editor uses for it."""
        return self.open[path].uri if path in self.open else Path(path).as_uri()

    def compute_once(self, name: str, make: Callable[[], T]) -> T:
        """Call the function `make` and return the result. Later calls with the same `name` return the cached result."""
        if name not in self._cache:
            self._cache[name] = make()
        result: T = self._cache[name]
        return result

    @property
    def facts(self) -> DocumentFacts:
        """The names in the document that editors suggest, including names in lines with errors."""
        if (tree := self.tree) is None:
            return DocumentFacts()
        return self.compute_once("facts", lambda: facts_of(tree, self.model, self.records, self.schemas, {}))


def is_document_path(path: str) -> bool:
    """Return whether a path has the suffix of a document, such as `.yaml`."""
    return path.lower().endswith(DOCUMENT_SUFFIXES)


def analyse(
    path: str, opened: Mapping[str, OpenText], options: Options, provider: PartsProvider | None = None, memo: Memo | None = None,
    last: Analysis | None = None,
) -> Analysis:
    """Check the document at an absolute path. The texts `opened` replace files on disk.

    `options` specify the store and whether part code may run. The function `provider` returns the source of parts, by default as in
    `thingc check`. The module `cached_parts` describes pending parts. `memo` caches results of the previous analysis, `last`.
    """
    if not is_document_path(path):
        return Analysis(path=path, open=opened)
    texts = {one: text.text.encode(errors="surrogatepass") for one, text in opened.items() if is_document_path(one)}
    options = replace(options, texts=texts)
    with Environment(path, options, provider, memo) as environment:
        if os.path.basename(path) == OWN_FILE:
            return _analyse_settings(environment, opened, last)
        compilation = pipeline.check(environment)
        dependencies = up_to_date.dependencies_of(environment, compilation)
    report, documents = compilation.report, compilation.documents
    if documents is not None and documents.root.kind == "variants":
        report = Report()
        read_plan(path, options, report, provider)
    analysis = Analysis(
        path=path, open=opened, workspace=environment.workspace, documents=documents, schemas=compilation.schemas,
        model=compilation.model, records=compilation.records, assembly=compilation.assembly, robots=compilation.robots,
        findings=tuple(one for one in report.sorted_diagnostics() if one.code is not Code.NOT_LOCKED or not options.code),
        dependencies=frozenset(dependencies),
    )
    return _with_last(analysis, last)


def _analyse_settings(environment: Environment, opened: Mapping[str, OpenText], last: Analysis | None) -> Analysis:
    """Check the settings file `thingc.toml`, and return the analysis."""
    path, workspace = environment.document, environment.workspace
    general = workspace if workspace is not None else last.workspace if last is not None else None
    documents = load(path, general, Report(), kinds=("workspace",), texts=environment.options.texts) if general is not None else None
    return _with_last(Analysis(
        path=path, open=opened, workspace=workspace, documents=documents, findings=tuple(environment.report.sorted_diagnostics()),
        dependencies=frozenset([path]),
    ), last)


def _with_last(analysis: Analysis, last: Analysis | None) -> Analysis:
    """If the text of an analysis is not well-formed, add the last analysis of well-formed text to the attribute `last`."""
    well_formed = analysis.documents is not None and not any(
        one.code is Code.SYNTAX and one.span is not None and one.span.file == analysis.path for one in analysis.findings
    )
    return analysis if well_formed else replace(analysis, well_formed=False, last=last.known if last is not None else None)

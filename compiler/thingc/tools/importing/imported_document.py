"""Compile a robot file of another format without writing a document, and report diagnostics at the elements of this file."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from tempfile import TemporaryDirectory

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Note, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document, Path, Span, node_at
from thingc.documents.workspace import OWN_FILE
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation, settings_of
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import Imported, import_robot
from thingc.tools.importing.update_import import RECORD

_WORKSPACE = b'thingc = "workspace/1"\n'
"""Content of the workspace file beside the document. The settings of the user's workspace do not apply."""
_OF_TEXT = frozenset({Code.LIMIT_UNITS, Code.UNNEEDED})
"""Codes about the text of a document that the import generated."""


class ImportedDocument(FrozenStruct):
    """The document that an import generated, without a file in the user's folders.

    `path` is the path of the document, and `options` the options with which the document compiles.
    """

    path: str
    options: Options
    imported: Imported

    def compile(self, report: Report) -> Compilation:
        """Compile the document, and add its diagnostics to `report`. Their places and names are those of the source file."""
        with Environment(self.path, self.options) as environment:
            compilation = pipeline.compile(environment)
        self.report_at_source(compilation, report)
        return compilation

    def report_at_source(self, compilation: Compilation, report: Report) -> None:
        """Add the diagnostics of a compilation of the document to `report`, at the elements of the source file."""
        root = None if compilation.documents is None else compilation.documents.root
        for one in compilation.report.sorted_diagnostics():
            if one.code not in _OF_TEXT:
                report.say(self._at_source(one, root))

    def _at_source(self, one: Diagnostic, root: Document | None) -> Diagnostic:
        notes = [(self._with_source_names(note.message), self.source_span(note.span, root)) for note in one.notes]
        path = self._with_source_names(f"`{one.path}`")[1:-1] if one.path else None
        return replace(
            one, message=self._with_source_names(one.message), span=self.source_span(one.span, root), path=path,
            help=self._with_source_names(one.help) if one.help else None, fixes=(), allow=False,  # a robot file cannot contain `allow`
            notes=tuple(Note(message=words, span=where) for words, where in notes),
        )

    def _with_source_names(self, text: str) -> str:
        """Replace the document names of renamed links and joints in the quoted words of a message."""
        sources = {word: name for name, word in self.imported.renamed.items()}
        return re.sub(r"`[^`]+`", lambda quoted: re.sub(r"\w+", lambda word: sources.get(word[0], word[0]), quoted[0]), text)

    def source_span(self, span: Span | None, root: Document | None) -> Span | None:
        """Return the source location of the innermost element of the document that contains a span."""
        if span is None or span.file != self.path:
            return span
        places, around = self.imported.places, list[Path]()
        if root is not None:
            written = [path for path in places if path and node_at(root.tree, path) is not None]
            around = [path for path in written if root.span(path).holds(span) or root.span(path, key=True).holds(span)]
        return places[max(around, key=len, default=())]


@contextmanager
def imported_document(path: str, options: Options, report: Report, source: ImportRequest) -> Iterator[ImportedDocument | None]:
    """Import a robot file. Yield the generated document, or None after errors, which are added to `report`.

    Files of meshes are copied to a temporary folder, which is removed at the end of the `with` statement. Without meshes, nothing is
    written.
    """
    imported = import_robot(path, report, source)
    if imported is None:
        yield None
        return
    with ExitStack() as stack:
        meshes = {name: content for name, content in imported.files.items() if name not in (imported.document, RECORD)}
        folder = os.path.dirname(os.path.abspath(path))
        if meshes:
            folder = os.path.realpath(stack.enter_context(TemporaryDirectory(prefix="thingc-")))
        for name, content in meshes.items():
            file = os.path.join(folder, name)
            os.makedirs(os.path.dirname(file), exist_ok=True)
            with open(file, "wb") as stream:
                stream.write(content)
        document = os.path.join(folder, f"{os.path.basename(path)}.yaml")  # two robots in a folder are different documents
        texts = {document: imported.files[imported.document], os.path.join(folder, OWN_FILE): _WORKSPACE}
        yield ImportedDocument(path=document, options=replace(options, texts=texts, code=True, lock=False), imported=imported)


def compile_robot(path: str, options: Options, source: ImportRequest) -> Compilation:
    """Import and compile a robot file, without writing a document. Diagnostics are at the elements of the file."""
    report = Report()
    with imported_document(path, options, report, source) as document:
        compilation = Compilation(settings=settings_of(options), report=report) if document is None else document.compile(report)
    return replace(compilation, report=report)

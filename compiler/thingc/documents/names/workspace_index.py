"""Index of all names in the documents and part modules of a workspace.

For files that are open in an editor, the unsaved contents are indexed.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache

from thingc.base.diagnostics import Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.grouping import group_by
from thingc.base.source import Document, Span, text_of
from thingc.documents.load.discovery import documents_in
from thingc.documents.load.documents import read_tree
from thingc.documents.names.document_names import DocumentNames
from thingc.documents.names.part_names import Name, NamePlace, PartNames
from thingc.documents.names.references import NameReader
from thingc.documents.workspace import Workspace

MAX_TEXT = 10_000_000


class NameIndex(FrozenStruct, kw_only=False):
    """The locations at which names are declared or used in the documents and part modules of a workspace."""

    places: tuple[NamePlace, ...]
    by_name: Mapping[Name, tuple[NamePlace, ...]]

    def at(self, file: str, line: int, column: int) -> NamePlace | None:
        """Return the declaration or the use of a name at a cursor position (line and column, counted from 1).

        The cursor can also be directly after the name. If several names contain the position, return the shortest name.
        """
        candidates = [
            place for place in self.places
            if place.span.file == file and (place.span.line, place.span.column) <= (line, column)
            <= (place.span.end_line, place.span.end_column)
        ]
        return min(candidates, key=lambda place: (place.role == "fits", place.span.end_column - place.span.column), default=None)

    def find_declaration(self, name: Name) -> Span | None:
        """Return the location at which a name is declared, or None if the declaration is unknown."""
        return next((place.span for place in self.by_name.get(name, ()) if place.role == "declared"), None)


def _index_names(documents: Mapping[str, DocumentNames], parts: PartNames) -> NameIndex:
    """Build the index of all names in the documents of a workspace and in their part modules. `documents` is keyed by absolute path."""
    found: dict[tuple[Name, Span], NamePlace] = {}
    for document in documents.values():
        for place in NameReader(documents, parts, document).places():
            previous = found.get((place.name, place.span))
            if previous is None or previous.role != "declared":
                found[place.name, place.span] = place
    found.update(((place.name, place.span), place) for place in parts.places())
    for reference, thing in parts.classes():
        if thing.span is not None:
            name = Name("part", thing.file, reference.partition(":")[2])
            found[name, thing.span] = NamePlace(name, thing.span, "declared")
    places = tuple(sorted(found.values(), key=lambda p: (p.span.file, p.span.line, p.span.column, p.name.kind, p.name.text)))
    by_name = group_by(places, lambda place: place.name)
    return NameIndex(places, {name: tuple(places_of_name) for name, places_of_name in by_name.items()})


class WorkspaceIndex(FrozenStruct):
    """The documents of a workspace by absolute path: `documents` are parsed, and `broken` contains the texts that cannot be parsed.

    `read` is a function that returns the text of any file (or None), and `relative` returns the display path of a file.
    """

    documents: Mapping[str, DocumentNames]
    broken: Mapping[str, str]
    parts: PartNames
    index: NameIndex
    read: Callable[[str], str | None]
    relative: Callable[[str], str]
    folders: tuple[str, ...] = ()

    def with_texts(self, texts: Mapping[str, str]) -> WorkspaceIndex:
        """Return a copy of the index in which `texts` replaces the contents of some files."""
        def read(path: str) -> str | None:
            return texts[path] if path in texts else self.read(path)

        documents = {
            path: document if path not in texts else read_document(path, document.document.relative, texts[path])
            for path, document in self.documents.items()
        }
        return _build_index({path: one for path, one in documents.items() if one is not None}, {
            **self.broken, **{path: texts[path] for path, one in documents.items() if one is None},
        }, read, self.relative, self.folders)


def read_from_disk(path: str) -> str | None:
    """Return the text of a file with unchanged line ends."""
    try:
        with open(path, encoding="utf-8-sig", newline="") as stream:
            return stream.read(MAX_TEXT)
    except (OSError, ValueError):
        return None


def index_workspace(
    workspace: Workspace, texts: Mapping[str, str], last: Iterable[Document] = (), only: Iterable[str] | None = None, *,
    disk: Callable[[str], str | None] = read_from_disk,
) -> WorkspaceIndex:
    """Build the index of names for all documents of a workspace, or only for the documents at the absolute paths `only`.

    `texts` maps absolute paths to the contents of files that are open in an editor. `last` contains previous versions of documents, which
    are used for documents that cannot be parsed now. The function `disk` reads all other files.
    """
    def read(path: str) -> str | None:
        return texts[path] if path in texts else disk(path)

    documents: dict[str, DocumentNames] = {}
    broken: dict[str, str] = {}
    last_names = {previous.path: DocumentNames(previous) for previous in last}
    for path in dict.fromkeys((*(documents_in(workspace.root, workspace) if only is None else only), *last_names)):
        text = read(path)
        document = read_document(path, workspace.relative(path), text) if text is not None else None
        if document is None and text is not None:
            broken[path], document = text, last_names.get(path)
        if document is not None:
            documents[path] = document
    return _build_index(documents, broken, read, workspace.relative, tuple(workspace.parts))


def _build_index(
    documents: Mapping[str, DocumentNames], broken: Mapping[str, str], read: Callable[[str], str | None], relative: Callable[[str], str],
    folders: tuple[str, ...],
) -> WorkspaceIndex:
    parts = PartNames(folders, read)
    return WorkspaceIndex(
        documents=documents, broken=broken, parts=parts, index=_index_names(documents, parts), read=read, relative=relative,
        folders=folders,
    )


@lru_cache(maxsize=512)
def read_document(path: str, relative: str, text: str) -> DocumentNames | None:
    """Parse the text of a document. Return None if the text is not well-formed."""
    report = Report()
    data = text.encode("utf-8", errors="surrogatepass")
    tree = read_tree(path, data, report) if len(data) <= MAX_TEXT else None
    if tree is None or report.failed:
        return None
    return DocumentNames(Document(
        path=path, relative=relative, kind=text_of(tree.entries.get("thingc")).partition("/")[0], tree=tree,
        sha256=hashlib.sha256(data).hexdigest(), text=text.removeprefix("\ufeff"),
    ))


def contains_word(text: str, word: str) -> bool:
    """Return whether a text contains the name `word`, or an item of a repeat with this name (`leg_0` for `leg`)."""
    return re.search(rf"(?<![A-Za-z0-9_]){re.escape(word)}(?![A-Za-z0-9])", text, re.ASCII) is not None

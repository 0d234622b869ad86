"""Find and rename names in documents and part modules, and compute symbols, folding ranges and semantic tokens.

While the text cannot be parsed, the functions use the names in unchanged lines of the last parsable text, and renaming is not possible.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from thingc.base.diagnostics import Report
from thingc.base.source import MappingNode, Node, ScalarNode, SequenceNode, Span, line_of
from thingc.documents.expressions.parsing import parse_expression
from thingc.documents.expressions.terms import ExpressionError, find_tokens
from thingc.documents.names.document_names import DocumentNames
from thingc.documents.names.part_names import NamePlace
from thingc.documents.names.rename import RenameRefused, check_renamable, rename_edits
from thingc.documents.names.workspace_index import WorkspaceIndex, index_workspace
from thingc.documents.spec.name_types import RefersTo
from thingc.documents.workspace import Workspace
from thingc.tools.lsp.analysis import Analysis
from thingc.tools.lsp.positions import TextLines, TextPlace, map_spans

_TEXT, _READ, _WRITE = 1, 2, 3
_KINDS = {
    "component": 5, "joint": 6, "parameter": 13, "pose": 24, "mode": 10, "mount": 11, "export": 11, "sensor": 8, "test": 17, "link": 23,
    "material": 14, "index": 13, "part": 5, "part mount": 8, "part parameter": 13, "tendon": 6, "transmission": 6, "motion": 24,
    "choice": 10, "list": 18,
}
"""Maps kinds of names to LSP symbol kinds. For example, a component is shown as a class, a joint as a method, and a pose as an event.

The names in a section of a document, such as `joints`, are of the kind without the plural `s`.
"""
MAX_SYMBOLS = 500


class _Names:
    """The names that a document can use, and their spans in the current text of the document."""

    def __init__(self, analysis: Analysis, workspace_index: WorkspaceIndex) -> None:
        self.analysis = analysis
        self.workspace_index = workspace_index

    def at(self, place: TextPlace) -> NamePlace | None:
        """Return the name at a position of the text, or None if the position is not inside a name."""
        path = self.analysis.path
        cursor = Span(file=path, line=place.line, column=place.column, end_line=place.line, end_column=place.column)
        position = map_spans(self.analysis.text, self.analysis.known.text)(cursor)
        return None if position is None else self.workspace_index.index.at(path, position.line, position.column)

    def range(self, span: Span) -> Any:
        """Return the LSP range of a span. Return None if the line of the span has changed since the text was parsed."""
        where = self.analysis.current_span(span) if span.file == self.analysis.path else span
        return None if where is None else TextLines(self.workspace_index.read(span.file) or "").range(where)

    def locations(self, spans: Iterable[Span]) -> list[dict[str, Any]]:
        """Convert spans to LSP locations in the same order."""
        places = ((span, self.range(span)) for span in dict.fromkeys(spans))
        return [{"uri": self.analysis.uri(span.file), "range": range_} for span, range_ in places if range_ is not None]


def _names(analysis: Analysis, *, near: bool = False) -> _Names | None:
    """Return the names that a document can use, or None if the document is not in a workspace.

    If `near` is true, the result contains only names in the document and in the documents to which it refers.
    """
    workspace = analysis.known.workspace or Workspace.find(analysis.path, Report())
    if workspace is None:
        return None
    documents = analysis.known.documents
    last = [documents.root] if documents is not None and not analysis.well_formed else []
    near = near and analysis.known.kind == "assembly"  # the analysis of a variants document omits the documents of its variants
    only = [one.path for one in documents.by_path.values()] if near and documents is not None else None
    return _Names(analysis, index_workspace(workspace, {path: one.text for path, one in analysis.open.items()}, last, only))


def _find_name(analysis: Analysis, place: TextPlace, *, near: bool = False) -> tuple[_Names, NamePlace] | None:
    names = _names(analysis, near=near)
    name = None if names is None else names.at(place)
    return None if names is None or name is None else (names, name)


def definition(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """Return the location of the declaration of the name at a position. In a Python file, return the documents that use the name."""
    if (found := _find_name(analysis, place, near=not analysis.path.endswith(".py"))) is None:
        return []
    names, name = found
    if name.name.kind == "document":
        return names.locations([line_of(name.name.file)])
    if name.role == "declared" and name.span.file.endswith(".py"):
        return names.locations(one.span for one in names.workspace_index.index.by_name[name.name] if not one.span.file.endswith(".py"))
    declared = names.workspace_index.index.find_declaration(name.name)
    return names.locations([] if declared is None else [declared])


def references(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """Return the locations of all uses of the name at a position, including name patterns that match the name."""
    if (found := _find_name(analysis, place)) is None:
        return []
    names, name = found
    declared = params.get("context", {}).get("includeDeclaration", True)
    return names.locations(one.span for one in names.workspace_index.index.by_name[name.name] if declared or one.role != "declared")


def highlights(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """Return the locations in the same document where the name at a position is used."""
    if (found := _find_name(analysis, place, near=True)) is None:
        return []
    names, name = found
    kinds = {"declared": _WRITE, "used": _READ, "fits": _TEXT}
    uses = [one for one in names.workspace_index.index.by_name[name.name] if one.span.file == analysis.path]
    return [{"range": range_of_use, "kind": kinds[one.role]} for one in uses if (range_of_use := names.range(one.span)) is not None]


def prepare_rename(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """Return the name to rename at a position, or None if there is no name. Raises `RenameRefused` if the name cannot be renamed."""
    if (found := _find_name(analysis, place)) is None:
        return None
    names, name = found
    check_renamable(names.workspace_index, name.name)
    if name.role == "fits":
        raise RenameRefused(f"`{name.name.text}` matches a pattern and cannot be renamed here")
    return {"range": names.range(name.span), "placeholder": name.name.text}


def rename(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """Return the edits that rename the name at a position in all files of the workspace.

    Raises `RenameRefused` if the name cannot be renamed.
    """
    if (found := _find_name(analysis, place)) is None:
        raise RenameRefused("there is no name at this position")
    names, name = found
    prepare_rename(analysis, text, place, params)
    result = rename_edits(names.workspace_index, name.name, params["newName"])
    changes: dict[str, list[dict[str, Any]]] = {}
    for span in result.places:
        changes.setdefault(span.file, []).append({"range": names.range(span), "newText": params["newName"]})
    versions = {path: one.version for path, one in analysis.open.items()}
    return {"documentChanges": [
        {"textDocument": {"uri": analysis.uri(path), "version": versions.get(path)}, "edits": edits} for path, edits in changes.items()
    ]}


def workspace_symbols(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """Return the names in a workspace that match a query. A name matches if it contains the letters of the query in the same order."""
    names, query = _names(analysis), params.get("query", "").lower()
    symbols: list[dict[str, Any]] = []
    for one in names.workspace_index.index.places if names is not None else ():
        name = one.name
        if one.role == "declared" and _has_letters(name.text.lower(), query) and names is not None and len(symbols) < MAX_SYMBOLS:
            symbol = {"name": name.text, "kind": _KINDS[name.kind], "containerName": name.owner or os.path.basename(name.file)}
            symbols += [{**symbol, "location": location} for location in names.locations([one.span])]
    return symbols


def _has_letters(text: str, letters: str) -> bool:
    remaining = iter(text)
    return all(letter in remaining for letter in letters)


TOKENS = ("parameter", "variable", "function", "number", "unit")
"""Types of tokens in expressions. `variable` is a constant or the index of a `repeat`.

LSP does not define a type `unit`, so units are sent as `keyword`.
"""
_MODULE = 2


def symbols(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """Return the outline of a document: the sections, and the names that each section declares."""
    return _symbols_in(analysis, analysis.known.tree, None)


def _symbols_in(analysis: Analysis, mapping: Node | None, kind: int | None) -> list[dict[str, Any]]:
    """Convert the keys of a mapping to LSP symbols of a `kind`. If `kind` is None, the keys are the names of sections."""
    if not isinstance(mapping, MappingNode):
        return []
    symbols = []
    lines = analysis.lines()
    for key, node in mapping.entries.items():
        inner_kind = _KINDS.get(key.removesuffix("s")) if kind is None else None
        name, extent = analysis.current_span(mapping.keys[key]), analysis.current_span(_around(mapping.keys[key], node))
        if key and name is not None and extent is not None:
            symbols.append({
                "name": key, "kind": _MODULE if kind is None else kind, "detail": _detail(node),
                "range": lines.range(extent), "selectionRange": lines.range(name),
                "children": _symbols_in(analysis, node, inner_kind) if inner_kind is not None else [],
            })
    return symbols


def folds(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """Return the ranges of a document that an editor can fold: comments, and values on several lines.

    The range of a value includes the line of the key.
    """
    ends: dict[int, int] = {}
    for key, node in _inside(analysis.known.tree):
        span = analysis.current_span(_around(key, node))
        if span is not None and span.end_line > span.line:
            ends[span.line] = max(ends.get(span.line, 0), span.end_line)
    ranges: list[dict[str, Any]] = [{"startLine": line - 1, "endLine": end - 1} for line, end in sorted(ends.items())]
    return ranges + list(_comments(text))


def _comments(text: str) -> Iterator[dict[str, Any]]:
    begin = None
    for number, line in enumerate([*text.splitlines(), ""]):
        comment = line.lstrip().startswith("#")
        if comment and begin is None:
            begin = number
        elif not comment and begin is not None:
            if number - begin > 1:
                yield {"startLine": begin, "endLine": number - 1, "kind": "comment"}
            begin = None


def tokens(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """Return the semantic tokens of the expressions in a document, in LSP's relative encoding. The types of the tokens are in `TOKENS`."""
    known = analysis.known
    if known.documents is None:
        return None
    declared = DocumentNames(known.documents.root)
    parameters = declared.section("parameters") if known.kind == "assembly" else {}
    found: list[tuple[int, int, int, int]] = []
    for mention in declared.occurrences:
        if mention.names in (RefersTo("expression"), RefersTo("rule")):
            for start, end, kind in _words(mention.text, mention.names == RefersTo("rule"), parameters):
                span = declared.narrow_span(declared.span_of(mention), mention.text, start, end)
                current = analysis.current_span(span) if span is not None else None
                if current is not None:
                    range_of_token = analysis.lines().range(current)
                    first, last = range_of_token["start"], range_of_token["end"]
                    found.append((first["line"], first["character"], last["character"] - first["character"], TOKENS.index(kind)))
    data: list[int] = []
    line = character = 0
    for one in sorted(set(found)):
        data += [one[0] - line, one[1] - (character if one[0] == line else 0), one[2], one[3], 0]
        line, character = one[0], one[1]
    return {"data": data}


def _words(text: str, dotted: bool, parameters: Mapping[str, Node]) -> Iterator[tuple[int, int, str]]:
    try:
        words = list(find_tokens(parse_expression(text, dotted=dotted)))
    except ExpressionError:
        return
    for start, end, kind in words:
        name = kind == "name"
        yield start, end, ("parameter" if dotted or text[start:end] in parameters else "variable") if name else kind


def _inside(node: Node | None) -> Iterator[tuple[Span, Node]]:
    """Yield every key of a document with its value, and every item of a list."""
    if isinstance(node, MappingNode):
        for key, value in node.entries.items():
            yield node.keys[key], value
            yield from _inside(value)
    elif isinstance(node, SequenceNode):
        for item in node.items:
            yield item.span, item
            yield from _inside(item)


def _around(key: Span, node: Node) -> Span:
    """Return the span that contains a key and its value. In TOML, the span of a table can start before the key."""
    begin = min((key.line, key.column), (node.span.line, node.span.column))
    end = max((key.end_line, key.end_column), (node.span.end_line, node.span.end_column))
    return Span(file=key.file, line=begin[0], column=begin[1], end_line=end[0], end_column=end[1])


def _detail(node: Node) -> str:
    """Return a short text that an editor shows next to the name of an element: the part, the kind or the value of the element."""
    if isinstance(node, ScalarNode):
        return node.text[:80]
    if isinstance(node, MappingNode):
        for key in ("part", "assembly", "file", "type", "value", "root"):
            if isinstance(value := node.entries.get(key), ScalarNode):
                return value.text[:80]
        if len(node.entries) == 1:
            return next(iter(node.entries))
    return ""

"""A document at a glance: its sections and names, what can be folded, and the colours of its expressions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from thingc.base.source import MappingNode, Node, ScalarNode, SequenceNode, Span
from thingc.documents.expressions.parsing import parse_expression
from thingc.documents.expressions.terms import ExpressionError, words_in
from thingc.documents.names.document_names import DocumentNames
from thingc.documents.spec.name_types import RefersTo
from thingc.tools.lsp.analysis import Analysis
from thingc.tools.lsp.positions import TextPlace, steady

TOKENS = ("parameter", "variable", "function", "number", "unit")
"""Of expressions: parameters, constants and the index of a repeat, functions, numbers, units. An editor is told `keyword` for a unit."""
_SECTIONS = {
    "components": 5, "joints": 6, "parameters": 13, "poses": 24, "modes": 10, "mounts": 11, "sensors": 8, "tests": 17, "links": 23,
    "tendons": 6, "materials": 14, "choices": 10, "list": 18,
}
"""What the protocol takes the names of a section for, by its numbers."""
_MODULE = 2


def symbols(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """The sections of the document, and the names in each."""
    return _symbols_in(analysis, analysis.known.tree, None)


def _symbols_in(analysis: Analysis, mapping: Node | None, kind: int | None) -> list[dict[str, Any]]:
    """The keys of a mapping as names of a `kind`; None: they are sections, which have names in them."""
    if not isinstance(mapping, MappingNode):
        return []
    listed = []
    lines = analysis.lines()
    for key, node in mapping.entries.items():
        name, whole = _now(analysis, mapping.keys[key]), _now(analysis, _around(mapping.keys[key], node))
        if key and name is not None and whole is not None:
            listed.append({
                "name": key, "kind": _MODULE if kind is None else kind, "detail": _detail(node),
                "range": lines.range(whole), "selectionRange": lines.range(name),
                "children": _symbols_in(analysis, node, _SECTIONS[key]) if kind is None and key in _SECTIONS else [],
            })
    return listed


def folds(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """What goes over several lines, from the line of its key on, and comments of several lines."""
    ends: dict[int, int] = {}
    for key, node in _inside(analysis.known.tree):
        whole = _now(analysis, _around(key, node))
        if whole is not None and whole.end_line > whole.line:
            ends[whole.line] = max(ends.get(whole.line, 0), whole.end_line)
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
    """The words of expressions, each as the line and the character from the one before, its length and its kind (`TOKENS`)."""
    known = analysis.known
    if known.documents is None:
        return None
    written = DocumentNames(known.documents.root)
    parameters = written.section("parameters") if known.kind == "assembly" else {}
    coloured: list[tuple[int, int, int, int]] = []
    for mention in written.mentions:
        if mention.names in (RefersTo("expression"), RefersTo("rule")):
            for start, end, kind in _words(mention.text, mention.names == RefersTo("rule"), parameters):
                span = written.place(written.around(mention), mention.text, start, end)
                now = _now(analysis, span) if span is not None else None
                if now is not None:
                    there = analysis.lines().range(now)
                    first, last = there["start"], there["end"]
                    coloured.append((first["line"], first["character"], last["character"] - first["character"], TOKENS.index(kind)))
    data: list[int] = []
    line = character = 0
    for one in sorted(set(coloured)):
        data += [one[0] - line, one[1] - (character if one[0] == line else 0), one[2], one[3], 0]
        line, character = one[0], one[1]
    return {"data": data}


def _words(text: str, dotted: bool, parameters: Mapping[str, Node]) -> Iterator[tuple[int, int, str]]:
    try:
        words = list(words_in(parse_expression(text, dotted=dotted)))
    except ExpressionError:
        return
    for start, end, kind in words:
        name = kind == "name"
        yield start, end, ("parameter" if dotted or text[start:end] in parameters else "variable") if name else kind


def _inside(node: Node | None) -> Iterator[tuple[Span, Node]]:
    """Every key of a document with its value, and every item of a list."""
    if isinstance(node, MappingNode):
        for key, value in node.entries.items():
            yield node.keys[key], value
            yield from _inside(value)
    elif isinstance(node, SequenceNode):
        for item in node.items:
            yield item.span, item
            yield from _inside(item)


def _around(key: Span, node: Node) -> Span:
    """From a key, or a value that begins before it (a TOML table), to the end of both."""
    begin = min((key.line, key.column), (node.span.line, node.span.column))
    end = max((key.end_line, key.end_column), (node.span.end_line, node.span.end_column))
    return Span(file=key.file, line=begin[0], column=begin[1], end_line=end[0], end_column=end[1])


def _now(analysis: Analysis, span: Span) -> Span | None:
    """A place of the text that names are taken from in the text as it stands; None where its lines have changed."""
    known = analysis.known
    if known.whole and known is analysis:
        return span
    return steady(known.documents.root.text if known.documents is not None else "", analysis.text)(span)


def _detail(node: Node) -> str:
    """What a thing with a name is, in a word: its part, its type, its value."""
    if isinstance(node, ScalarNode):
        return node.text[:80]
    if isinstance(node, MappingNode):
        for key in ("part", "assembly", "file", "type", "value", "root"):
            if isinstance(value := node.entries.get(key), ScalarNode):
                return value.text[:80]
        if len(node.entries) == 1:
            return next(iter(node.entries))
    return ""

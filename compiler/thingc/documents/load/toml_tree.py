"""Parse TOML to a tree with source positions. The values come from tomllib, and the positions come from tree-sitter."""

from __future__ import annotations

import datetime
import re
import tomllib
from bisect import bisect_left
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Union

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.source import MappingNode, Node, Scalar, ScalarNode, SequenceNode, Span
from thingc.base.suggestions import Hint
from thingc.base.units import shorten
from thingc.documents.load.text import MAX_FAULTS, MAX_LEVELS, MAX_NODES, Source

if TYPE_CHECKING:
    from tree_sitter import Node as Syntax


def read_toml(source: Source, report: Report) -> MappingNode | None:
    """Parse a TOML 1.0 document to a tree. If the document is invalid, report the error and return None."""
    syntax = TomlSyntax(source.text)
    if _too_large(source, syntax, report):
        return None
    try:
        values = tomllib.loads(source.text)
    except (ValueError, RecursionError) as error:
        _report_error(error, source, syntax, report)
        return None
    root = _Statements(source, syntax, None).read()
    return _Joiner(source, report).table(root, values, 1)


class TomlSyntax:
    """The syntax tree of a TOML document, created by tree-sitter.

    `root` is the root node of the syntax tree. All positions are indices of characters in the text.
    """

    def __init__(self, text: str) -> None:
        import tree_sitter_toml
        from tree_sitter import Language, Parser

        self._data = text.encode()
        self.root = Parser(Language(tree_sitter_toml.language())).parse(self._data).root_node
        self._offsets: list[int] | None = None
        if len(self._data) != len(text):
            self._offsets = [offset for offset, byte in enumerate(self._data) if byte & 0xC0 != 0x80]

    def range(self, node: Syntax) -> tuple[int, int]:
        """Return the start and the end (exclusive) of a syntax node, as character indices into the text of the document."""
        start, end = node.start_byte, node.end_byte
        return (start, end) if self._offsets is None else (bisect_left(self._offsets, start), bisect_left(self._offsets, end))

    def split_key(self, key: Syntax) -> list[tuple[str, tuple[int, int]]]:
        """Split a dotted key such as `a.b` into its words. Return each word with its range of characters."""
        if key.type == "dotted_key":
            return [part for child in key.named_children for part in self.split_key(child)]
        text = self._data[key.start_byte : key.end_byte].decode()
        if key.type == "quoted_key":
            try:
                text = next(iter(tomllib.loads(f"{text} = 0")))
            except tomllib.TOMLDecodeError:
                pass
        return [(text, self.range(key))]


@dataclass(slots=True)
class _Leaf:
    """A scalar of a TOML document, with its start and its end as character indices."""

    start: int
    end: int


@dataclass(slots=True)
class _Array:
    """A list of values in a TOML document, or an array of tables (`[[name]]`)."""

    start: int
    end: int
    items: list[_Item] = field(default_factory=list)


@dataclass(slots=True)
class _Table:
    """A table of a TOML document with its entries and the range of each key.

    `again` contains the additional locations of a key that occurs in several headers.
    """

    start: int
    end: int
    entries: dict[str, _Item] = field(default_factory=dict)
    keys: dict[str, tuple[int, int]] = field(default_factory=dict)
    again: list[tuple[str, tuple[int, int]]] = field(default_factory=list)
    declared: bool = False


_Item = Union[_Leaf, _Array, _Table]


class _Statements:
    """Converts the statements of a TOML document to a tree of tables. If a report is given, duplicate keys are reported."""

    def __init__(self, source: Source, syntax: TomlSyntax, report: Report | None) -> None:
        self.source = source
        self.syntax = syntax
        self.report = report
        self.faults_before = len(report.diagnostics) if report is not None else 0

    def read(self) -> _Table:
        root = _Table(0, len(self.source.text))
        for statement in self.syntax.root.named_children:
            if statement.type == "pair":
                self.pair(root, statement)
            elif statement.type in ("table", "table_array_element"):
                self.header(root, statement)
        return root

    def header(self, root: _Table, statement: Syntax) -> None:
        children = statement.named_children
        if not children:
            return
        key_names = self.syntax.split_key(children[0])
        start, end = self.syntax.range(statement)
        end = start + len(self.source.text[start:end].rstrip())
        table = self.descend(root, key_names[:-1], start, end)
        if table is None or not key_names:
            return
        name, key_range = key_names[-1]
        entry = table.entries.get(name)
        if statement.type == "table_array_element":
            if not isinstance(entry, _Array):
                if self.is_duplicate(table, name, key_range):
                    return
                entry = _Array(start, end)
                table.entries[name], table.keys[name] = entry, key_range
            inner = _Table(start, end)
            entry.items.append(inner)
            entry.end = end
        elif isinstance(entry, _Table) and not entry.declared:
            inner = entry
            inner.start, inner.end, inner.declared = min(inner.start, start), max(inner.end, end), True
            table.again.append((name, key_range))
        elif self.is_duplicate(table, name, key_range):
            return
        else:
            inner = _Table(start, end, declared=True)
            table.entries[name], table.keys[name] = inner, key_range
        for child in children[1:]:
            if child.type == "pair":
                self.pair(inner, child)

    def pair(self, table: _Table, statement: Syntax) -> None:
        children = [child for child in statement.named_children if child.type != "comment"]
        if len(children) < 2:
            return
        key_names = self.syntax.split_key(children[0])
        value = self.value(children[1])
        target = self.descend(table, key_names[:-1], self.syntax.range(statement)[0], value.end) if key_names else None
        if target is None:
            return
        name, key_range = key_names[-1]
        if not self.is_duplicate(target, name, key_range):
            target.entries[name], target.keys[name] = value, key_range

    def is_duplicate(self, table: _Table, name: str, key_range: tuple[int, int]) -> bool:
        if name not in table.entries:
            return False
        if self.report is not None and len(self.report.diagnostics) - self.faults_before < MAX_FAULTS:
            span = self.source.span
            self.report.add(
                Code.DUPLICATE_KEY, f"duplicate key `{shorten(name)}`", span(*key_range),
                notes=[Note(message="first defined here", span=span(*table.keys[name]))], help="remove or rename one of the two keys",
            )
        return True

    def descend(self, table: _Table, key_names: list[tuple[str, tuple[int, int]]], start: int, end: int) -> _Table | None:
        """Return the table that a dotted key selects. Missing tables are created.

        For an array of tables, return the last table of the array.
        """
        for name, key_range in key_names:
            entry = table.entries.get(name)
            if isinstance(entry, _Array) and entry.items:
                entry.end = max(entry.end, end)
                entry = entry.items[-1]
            if entry is None:
                entry = _Table(start, end)
                table.entries[name], table.keys[name] = entry, key_range
            else:
                table.again.append((name, key_range))
            if not isinstance(entry, _Table):
                self.is_duplicate(table, name, key_range)
                return None
            entry.end = max(entry.end, end)
            table = entry
        return table

    def value(self, syntax: Syntax) -> _Item:
        start, end = self.syntax.range(syntax)
        if syntax.type == "array":
            return _Array(start, end, [self.value(child) for child in syntax.named_children if child.type != "comment"])
        if syntax.type == "inline_table":
            table = _Table(start, end, declared=True)
            for child in syntax.named_children:
                if child.type == "pair":
                    self.pair(table, child)
            return table
        return _Leaf(start, end)


class _Joiner:
    """Combines the values from tomllib and the positions from tree-sitter into a tree of nodes."""

    def __init__(self, source: Source, report: Report) -> None:
        self.source = source
        self.report = report
        self.faults_before = len(report.diagnostics)

    def fault(self, code: Code, message: str, span: Span, help: Hint | None = None) -> None:
        """Report an error, unless the maximum number of errors has already been reported."""
        if len(self.report.diagnostics) - self.faults_before < MAX_FAULTS:
            self.report.add(code, message, span, help=help)

    def table(self, table: _Table, values: dict[str, Any], level: int) -> MappingNode:
        entries: dict[str, Node] = {}
        keys = {}
        for name, item in table.entries.items():
            if name in values:
                entries[name] = self.node(item, values[name], level + 1)
                keys[name] = self.source.span(*table.keys[name])
        again = tuple((name, self.source.span(*place)) for name, place in table.again)
        return MappingNode(entries=entries, keys=keys, span=self.source.span(table.start, table.end), again=again)

    def node(self, item: _Item, value: Any, level: int) -> Node:
        span = self.source.span(item.start, item.end)
        if level > MAX_LEVELS:
            self.fault(Code.TOO_LARGE, f"the document has more than {MAX_LEVELS} levels of nesting", span)
            return ScalarNode(value=None, text="", span=span)
        if isinstance(item, _Table) and isinstance(value, dict):
            return self.table(item, value, level)
        if isinstance(item, _Array) and isinstance(value, list):
            return SequenceNode(
                items=tuple(self.node(inner, entry, level + 1) for inner, entry in zip(item.items, value, strict=False)),
                span=span,
            )
        return self.scalar(item, value)

    def scalar(self, item: _Item, value: Any) -> ScalarNode:
        text = self.source.text[item.start : item.end]
        span = self.source.span(item.start, item.end)
        scalar: Scalar
        damaged = False
        if isinstance(value, (datetime.date, datetime.time)):
            message = f"expected a string or a number, found the date or time `{shorten(text)}`"
            self.fault(Code.DATE, message, span, f'put the value in quotes: `"{shorten(text)}"`')
            scalar, damaged = text, True
        elif isinstance(value, str):
            scalar = text = value
        elif isinstance(value, (int, float)):
            try:
                finite = isinstance(value, bool) or float(value) - float(value) == 0.0
            except OverflowError:
                finite = False
            if not finite:
                self.fault(Code.NOT_FINITE, f"expected a finite number, found `{shorten(text)}`", span)
            scalar, damaged = value if finite else 0, not finite
        else:
            scalar = None
        return ScalarNode(value=scalar, text=text, span=span, damaged=damaged)


def _too_large(source: Source, syntax: TomlSyntax, report: Report) -> bool:
    """Return whether the brackets or dotted keys are nested too deeply, or the document has too many values. The problem is reported.

    The check uses a loop instead of recursion, so that deep nesting does not exceed Python's recursion limit.
    """
    remaining = [(syntax.root, 0)]
    values = 0
    while remaining:
        node, level = remaining.pop()
        values += 1
        level += node.type in ("array", "inline_table", "dotted_key", "ERROR")
        many = values > 2 * MAX_NODES  # nodes of a pair: statement, key, words, value; of a table: statement, header, words
        if many or level > MAX_LEVELS:
            limit = f"{MAX_NODES} values" if many else f"{MAX_LEVELS} levels of nesting"
            start = syntax.range(node)[0]
            report.add(Code.TOO_LARGE, f"the document has more than {limit}", source.span(start, start + 1))
            return True
        remaining.extend((child, level) for child in reversed(node.named_children))
    return False


_POSITION = re.compile(r"\s*\(at (?:line (\d+), column (\d+)|end of document)\)$")
_DUPLICATE_KEY_WORDS = ("overwrite", "twice", "mutate", "Duplicate", "namespace")


def _report_error(error: Exception, source: Source, syntax: TomlSyntax, report: Report) -> None:
    """Report a syntax error from tomllib, with its position in the document and a hint about the syntax that the user probably intended."""
    if isinstance(error, RecursionError):
        start = _first_excess_bracket(source.text)
        report.add(Code.TOO_LARGE, f"the document has more than {MAX_LEVELS} levels of nesting", source.span(start, start + 1))
        return
    match = _POSITION.search(str(error))
    message_text = str(error)[: match.start()] if match else str(error)
    index = len(source.text.rstrip())
    if match and match.group(1):
        index = min(source.starts[int(match.group(1)) - 1] + int(match.group(2)) - 1, len(source.text))
    if any(word in message_text for word in _DUPLICATE_KEY_WORDS):
        before = len(report.diagnostics)
        _Statements(source, syntax, report).read()
        if len(report.diagnostics) > before:
            return
    unquoted = _find_unquoted(source, index) if message_text.startswith(("Invalid value", "Expected newline", "Unclosed")) else None
    if unquoted is not None:
        start, end, key = unquoted
        text = source.text[start:end]
        quoted = f'{key} = "{text}"' if key else f'"{text}"'
        report.add(
            Code.SYNTAX, f"`{shorten(text)}` is not a TOML value", source.span(start, end),
            help=f"put strings and quantities in quotes: `{shorten(quoted)}`",
        )
        return
    message, help = _translate_message(message_text)
    end = index + 1 if index < len(source.text) and source.text[index] not in "\r\n" else index
    report.add(Code.SYNTAX, message, source.span(index, end), help=help)


def _first_excess_bracket(text: str) -> int:
    """Return the index of the first bracket that exceeds the maximum nesting depth. Brackets inside strings also count."""
    level = 0
    for index, character in enumerate(text):
        level += character in "[{"
        level -= character in "]}"
        if level > MAX_LEVELS:
            return index
    return 0


def _find_unquoted(source: Source, index: int) -> tuple[int, int, str] | None:
    """Find an unquoted string or quantity at or before `index`. Return its start, its end and its key ("" in a list), or None."""
    number = source.line_at(min(index, max(0, len(source.text) - 1)))
    line, begin = source.line(number), source.starts[number]
    start = max(line.rfind(mark, 0, max(0, index - begin)) for mark in "=[,{") + 1
    match = re.compile(r"\s*([^\s\"'\[\]{}=,#][^\"'\[\]{}=,#]*?)\s*(?=[,\]}#]|$)").match(line, start)
    if match is None or re.fullmatch(r"[-+]?[0-9_.]+(?:[eE][-+]?[0-9]+)?|true|false", match.group(1)):
        return None
    key = re.search(r"([\w.-]+)\s*=\s*$", line[:start])
    return begin + match.start(1), begin + match.end(1), key.group(1) if key else ""


def _translate_message(message: str) -> tuple[str, str | None]:
    """Convert an error message of tomllib to a message and a hint of thingc."""
    if message.startswith("Expected '=' after a key"):
        return "expected `=` after the key", "write `key = value`"
    if message == "Invalid value":
        return "expected a value", "put strings and quantities in quotes"
    if message.startswith("Expected newline or end of document"):
        return "expected the end of the line", "write one `key = value` per line"
    if message.startswith("Expected ']'"):
        return "the `[` of a table is not closed", "add `]`"
    if "Unterminated string" in message or "Illegal character '\\n'" in message:
        return "the string is not closed", 'add the closing `"`'
    if "Unclosed array" in message:
        return "a list is not closed", "add `]`, or `,` between the items"
    if "Unclosed inline table" in message:
        return "an inline table is not closed", "add `}` on the same line, or `,` between the entries"
    if "integer string conversion" in message:
        return "a whole number with too many digits", None
    return f"not well-formed TOML: {message[:1].lower()}{message[1:]}", None

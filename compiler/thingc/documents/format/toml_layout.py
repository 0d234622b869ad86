"""Format a TOML document in the canonical layout."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from thingc.documents.format.flow_style import Inline, canonical_order, shape_below, shape_for
from thingc.documents.format.segments import EndComment, Item, Segment, UnsupportedStyle, alignments, append_comment, gap, tidy
from thingc.documents.load.toml_tree import TomlSyntax
from thingc.documents.spec.annotation_types import FieldType

if TYPE_CHECKING:
    from tree_sitter import Node as Syntax


@dataclass(slots=True, kw_only=True)
class _Statement:
    """A statement of a TOML document: a header `[a.b]`, for which `value` is None, or a pair `key = value`.

    `path` contains the elements of the dotted key. `pairs` contains the statements below a header. `leading` contains the comment lines
    above the statement, and `comment` the comment at the end of its line.
    """

    start: int
    end: int
    key: tuple[int, int]
    path: tuple[str, ...]
    value: Segment | None = None
    leading: list[str | None] = field(default_factory=list)
    comment: EndComment | None = None
    pairs: list[_Statement] = field(default_factory=list)


@dataclass(slots=True)
class _Names:
    """The keys of a table and of all tables inside it, in the order of their first occurrence.

    `tables` maps each key to the keys of its value. `set_ranks` sets the type `shape` of the table and the canonical position of each key.
    """

    tables: dict[str, _Names] = field(default_factory=dict)
    shape: FieldType | None = None
    ranks: dict[str, int] = field(default_factory=dict)

    def add(self, path: tuple[str, ...], value: Segment | None) -> None:
        table = self
        for key in path:
            table = table.tables.setdefault(key, _Names())
        if value is not None and value.kind == "map":
            for item in value.items:
                table.add((item.name,), item.value)

    def set_ranks(self, shape: FieldType | None) -> None:
        """Determine the type and the canonical position of each key. Call this method after all keys have been added."""
        self.shape = shape
        keys = list(self.tables)
        inner = shape_for(shape, dict.fromkeys(keys))
        self.ranks = {keys[index]: rank for rank, index in enumerate(canonical_order(keys, inner))}
        for key, table in self.tables.items():
            table.set_ranks(shape_below(inner, key))

    def rank(self, path: tuple[str, ...]) -> tuple[int, ...]:
        """Return the sort key of a dotted key: for each of its elements, the canonical position in the table that contains the element."""
        return tuple(self.table_at(path[:depth]).ranks[key] for depth, key in enumerate(path))

    def table_at(self, path: tuple[str, ...]) -> _Names:
        """Return the table that a dotted key selects."""
        table = self
        for key in path:
            table = table.tables[key]
        return table


def toml_layout(text: str, shape: FieldType | None) -> str:
    """Return the text of a TOML document in the canonical layout, with line feeds as line ends.

    Raises `UnsupportedStyle` for unsupported syntax.
    """
    sections, foot = _Cutter(text).sections()
    names = _Names()
    for section in sections:
        names.add(section.path, None)
        for pair in section.pairs:
            names.add((*section.path, *pair.path), pair.value)
    names.set_ranks(shape)
    lines = [line or "" for line in _head_comments(sections)]
    for section in sorted(sections, key=lambda section: names.rank(section.path)):
        lines.extend(_section(section, text, names, not any(lines)))
    lines.extend(line or "" for line in tidy(foot))
    return "\n".join(lines).rstrip("\n") + "\n"


def _head_comments(sections: list[_Statement]) -> list[str | None]:
    """Remove and return the comments at the top that describe the whole document instead of its first key.

    These are the comments before an empty line, and comments that configure an editor.
    """
    first_statement = next((s for section in sections for s in (section, *section.pairs) if s.end), None)
    if first_statement is None:
        return []
    lines = tidy(first_statement.leading, first=True)
    cut = max((index for index, line in enumerate(lines) if line is None or line.startswith("#:schema")), default=-1) + 1
    first_statement.leading = lines[cut:]
    return lines[:cut]


def _section(section: _Statement, text: str, names: _Names, first: bool) -> list[str]:
    """Return the lines of a section: its header, if any, and its pairs in canonical order."""
    lines: list[str] = []
    if section.end:
        lines.extend([] if first else [""])
        lines.extend(line or "" for line in tidy(section.leading, first=True))
        lines.append(append_comment(f"[{text[slice(*section.key)].strip()}]", section.comment))
    pairs = sorted(section.pairs, key=lambda pair: names.rank((*section.path, *pair.path)))
    inline = Inline(text, " = ")
    for index, (pair, spaces) in enumerate(zip(pairs, _alignment(pairs, text), strict=True)):
        lines.extend(line or "" for line in tidy(pair.leading, first=index == 0))
        assert pair.value is not None
        shape = names.table_at((*section.path, *pair.path)).shape
        pair_lines = f"{text[slice(*pair.key)]}{' ' * spaces}= {inline.value(pair.value, shape, 0)}".split("\n")
        pair_lines[-1] = append_comment(pair_lines[-1], pair.comment)
        lines.extend(pair_lines)
    return lines


def _alignment(pairs: list[_Statement], text: str) -> list[int]:
    """Return the number of spaces before the `=` of each pair."""
    spaces = [(pair, text[pair.key[1] : text.index("=", pair.key[1])]) for pair in pairs]
    return alignments([
        None if blank.strip(" ") else (max(1, len(blank)), pair.key[1] - pair.key[0] + max(1, len(blank))) for pair, blank in spaces
    ])


class _Cutter:
    """Converts the syntax tree of a TOML document, from tree-sitter, to statements."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.syntax = TomlSyntax(text)

    def sections(self) -> tuple[list[_Statement], list[str | None]]:
        """Return the sections of the document and the comments after its last statement. The first section does not have a header."""
        root = self.syntax.root
        if root.has_error:
            raise UnsupportedStyle
        sections = [_Statement(start=0, end=0, key=(0, 0), path=())]
        for node in root.named_children:
            if node.type == "pair":
                sections[0].pairs.append(self.pair(node))
            elif node.type == "table":
                sections.append(self.header(node))
            elif node.type != "comment":
                raise UnsupportedStyle  # arrays of tables, which documents do not use
        end = 0
        last: _Statement | None = None
        for statement in (s for section in sections for s in (section, *section.pairs) if s.end):
            trivia = gap(self.text, end, statement.start)
            self.comment(last, trivia.comment)
            statement.leading = [line and line[1] for line in trivia.lines]
            end, last = statement.end, statement
        foot = gap(self.text, end, len(self.text))
        self.comment(last, foot.comment)
        return sections, [line and line[1] for line in foot.lines]

    def comment(self, last: _Statement | None, comment: EndComment | None) -> None:
        if comment is not None:
            if last is None:
                raise UnsupportedStyle
            last.comment = comment

    def header(self, node: Syntax) -> _Statement:
        children = node.named_children
        key = self.syntax.range(children[0])
        end = self.text.index("]", key[1]) + 1
        return _Statement(
            start=self.syntax.range(node)[0], end=end, key=key, path=self.path(children[0]),
            pairs=[self.pair(child) for child in children[1:] if child.type == "pair"],
        )

    def pair(self, node: Syntax) -> _Statement:
        key, value = (child for child in node.named_children if child.type != "comment")
        piece = self.value(value)
        return _Statement(start=self.syntax.range(node)[0], end=piece.end, key=self.syntax.range(key), path=self.path(key), value=piece)

    def path(self, key: Syntax) -> tuple[str, ...]:
        return tuple(word for word, _ in self.syntax.split_key(key))

    def value(self, node: Syntax) -> Segment:
        start, end = self.syntax.range(node)
        children = [child for child in node.named_children if child.type != "comment"]
        if node.type == "array":
            items = [Item(value=self.value(child)) for child in children]
            return Segment(kind="list", start=start, end=end, body=start, flow=True, items=items)
        if node.type == "inline_table":
            pairs = [self.pair(child) for child in children if child.type == "pair"]
            items = [Item(key=pair.key, name=pair.path[0], value=pair.value) for pair in pairs if pair.value is not None]
            verbatim = any(len(pair.path) > 1 for pair in pairs)
            return Segment(kind="map", start=start, end=end, body=start, flow=True, items=items, verbatim=verbatim)
        return Segment(kind="scalar", start=start, end=end, body=start)

"""Format a TOML document in the canonical layout."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from thingc.documents.format.flow_style import Inline, canonical_order, shape_below, shape_for
from thingc.documents.format.segments import EndComment, Item, Segment, UnsupportedStyle, alignments, append_comment, first_lines, gap, tidy
from thingc.documents.load.toml_tree import TomlSyntax
from thingc.documents.spec.annotation_types import FieldType

if TYPE_CHECKING:
    from tree_sitter import Node as Syntax


@dataclass(slots=True, kw_only=True)
class _Statement:
    """A statement of a TOML document: a header `[a.b]`, for which `value` is None, or a pair `key = value`.

    The statement contains its position, the words of its key, and its comments.
    """

    start: int
    end: int
    key: tuple[int, int]
    words: tuple[str, ...]
    value: Segment | None = None
    leading: list[str | None] = field(default_factory=list)
    comment: EndComment | None = None
    pairs: list[_Statement] = field(default_factory=list)


@dataclass(slots=True)
class _Names:
    """The keys of each table of a document, in the order of their first occurrence.

    The method `settle` determines the types of the tables and the canonical positions of the keys.
    """

    below: dict[str, _Names] = field(default_factory=dict)
    shape: FieldType | None = None
    ranks: dict[str, int] = field(default_factory=dict)

    def add(self, words: tuple[str, ...], value: Segment | None) -> None:
        table = self
        for word in words:
            table = table.below.setdefault(word, _Names())
        if value is not None and value.kind == "map":
            for item in value.items:
                table.add((item.name,), item.value)

    def settle(self, shape: FieldType | None) -> None:
        """Determine the type and the canonical position of each key. Call this method after all keys have been added."""
        self.shape = shape
        known = list(self.below)
        inner = shape_for(shape, dict.fromkeys(known))
        self.ranks = {known[at]: rank for rank, at in enumerate(canonical_order(known, inner))}
        for word, table in self.below.items():
            table.settle(shape_below(inner, word))

    def rank(self, words: tuple[str, ...]) -> tuple[int, ...]:
        """Return the sort key of a dotted key: for each of its words, the canonical position in the table that contains the word."""
        return tuple(self.at(words[:depth]).ranks[word] for depth, word in enumerate(words))

    def at(self, words: tuple[str, ...]) -> _Names:
        """Return the table that a dotted key selects."""
        table = self
        for word in words:
            table = table.below[word]
        return table


def toml_layout(text: str, shape: FieldType | None) -> str:
    """Return the text of a TOML document in the canonical layout, with line feeds as line ends.

    Raises `UnsupportedStyle` for unsupported syntax.
    """
    sections, foot = _Cutter(text).sections()
    names = _Names()
    for section in sections:
        names.add(section.words, None)
        for pair in section.pairs:
            names.add((*section.words, *pair.words), pair.value)
    names.settle(shape)
    lines = [line or "" for line in _opening(sections)]
    for section in sorted(sections, key=lambda section: names.rank(section.words)):
        lines.extend(_section(section, text, names, not any(lines)))
    lines.extend(line or "" for line in tidy(foot))
    return "\n".join(lines).rstrip("\n") + "\n"


def _opening(sections: list[_Statement]) -> list[str | None]:
    """Return the comments at the top that describe the whole document and not its first key.

    The result contains comments before an empty line, and comments that configure an editor.
    """
    first = next((s for section in sections for s in (section, *section.pairs) if s.end), None)
    if first is None:
        return []
    lines = first_lines(first.leading)
    cut = max((at for at, line in enumerate(lines) if line is None or line.startswith("#:schema")), default=-1) + 1
    first.leading = lines[cut:]
    return lines[:cut]


def _section(section: _Statement, text: str, names: _Names, first: bool) -> list[str]:
    """Return the lines of a section: its header, if any, and its pairs in canonical order."""
    lines: list[str] = []
    if section.end:
        lines.extend([] if first else [""])
        lines.extend(line or "" for line in first_lines(section.leading))
        lines.append(append_comment(f"[{text[slice(*section.key)].strip()}]", section.comment))
    pairs = sorted(section.pairs, key=lambda pair: names.rank((*section.words, *pair.words)))
    inline = Inline(text, " = ")
    for at, (pair, spaces) in enumerate(zip(pairs, _alignment(pairs, text), strict=True)):
        lines.extend(line or "" for line in (tidy(pair.leading) if at else first_lines(pair.leading)))
        assert pair.value is not None
        below = names.at((*section.words, *pair.words)).shape
        written = f"{text[slice(*pair.key)]}{' ' * spaces}= {inline.value(pair.value, below, 0)}".split("\n")
        written[-1] = append_comment(written[-1], pair.comment)
        lines.extend(written)
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
        sections = [_Statement(start=0, end=0, key=(0, 0), words=())]
        for node in root.named_children:
            if node.type == "pair":
                sections[0].pairs.append(self.pair(node))
            elif node.type == "table":
                sections.append(self.header(node))
            elif node.type != "comment":
                raise UnsupportedStyle  # arrays of tables, which documents do not use
        at = 0
        last: _Statement | None = None
        for statement in (s for section in sections for s in (section, *section.pairs) if s.end):
            between = gap(self.text, at, statement.start)
            self.comment(last, between.comment)
            statement.leading = [line and line[1] for line in between.lines]
            at, last = statement.end, statement
        rest = gap(self.text, at, len(self.text))
        self.comment(last, rest.comment)
        return sections, [line and line[1] for line in rest.lines]

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
            start=self.syntax.range(node)[0], end=end, key=key, words=self.words(children[0]),
            pairs=[self.pair(child) for child in children[1:] if child.type == "pair"],
        )

    def pair(self, node: Syntax) -> _Statement:
        key, value = (child for child in node.named_children if child.type != "comment")
        piece = self.value(value)
        return _Statement(start=self.syntax.range(node)[0], end=piece.end, key=self.syntax.range(key), words=self.words(key), value=piece)

    def words(self, key: Syntax) -> tuple[str, ...]:
        return tuple(word for word, _ in self.syntax.words(key))

    def value(self, node: Syntax) -> Segment:
        start, end = self.syntax.range(node)
        children = [child for child in node.named_children if child.type != "comment"]
        if node.type == "array":
            items = [Item(value=self.value(child)) for child in children]
            return Segment(kind="list", start=start, end=end, body=start, flow=True, items=items)
        if node.type == "inline_table":
            pairs = [self.pair(child) for child in children if child.type == "pair"]
            items = [Item(key=pair.key, name=pair.words[0], value=pair.value) for pair in pairs if pair.value is not None]
            odd = any(len(pair.words) > 1 for pair in pairs)
            return Segment(kind="map", start=start, end=end, body=start, flow=True, items=items, odd=odd)
        return Segment(kind="scalar", start=start, end=end, body=start)

"""A document as it is written: its sections, what repeats make of its keys, and the place of every word."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache

from thingc.base.source import Document, MappingNode, Node, Path, ScalarNode, Span, node_at
from thingc.documents.names.occurrences import NameOccurrence, mentions_of

GLOB = re.compile(r"[*?\[]")
"""A character that makes a pattern of a word."""
SPECIAL = re.compile(r"[*?\[$]")
"""The same, or the index of a repeat."""
_ITEMS = 100
"""Items of a repeat that patterns are held against where its count is no plain number."""


@cache
def pattern_of(text: str, index: str) -> re.Pattern[str]:
    """What a word with `*`, `?`, `[...]` and the index of a repeat fits."""
    from fnmatch import translate

    if index:
        text = re.sub(rf"\$(?:\{{{index}\}}|{index}(?![A-Za-z0-9]))", "\0", text)
    return re.compile(translate(text).replace("\\\0", r"\d+").replace("\0", r"\d+"))


@dataclass(slots=True)
class DocumentNames:
    """A document, its lines and what is mentioned in it."""

    document: Document
    lines: list[str] = field(default_factory=list)
    mentions: tuple[NameOccurrence, ...] = ()

    def __post_init__(self) -> None:
        self.lines = re.split(r"\r\n|\r|\n", self.document.text)
        self.mentions = tuple(mentions_of(self.document))

    @property
    def path(self) -> str:
        """Its absolute path."""
        return self.document.path

    def section(self, name: str) -> Mapping[str, Node]:
        """The entries of a section, none where it has none."""
        node = self.document.tree.entries.get(name)
        return node.entries if isinstance(node, MappingNode) else {}

    def text(self, *path: str | int) -> str | None:
        """The text at a path."""
        node = node_at(self.document.tree, path)
        return node.value if isinstance(node, ScalarNode) and isinstance(node.value, str) else None

    def repeat(self, section: str, key: str) -> Mapping[str, Node] | None:
        """What is written under `repeat` of a component or joint, None where it is one alone."""
        node = node_at(self.document.tree, (section, key, "repeat"))
        return node.entries if isinstance(node, MappingNode) else None

    def index_of(self, path: Path) -> str:
        """What the index around a place is called, empty where nothing is repeated."""
        if len(path) < 2 or path[0] not in ("components", "joints") or self.repeat(str(path[0]), str(path[1])) is None:
            return ""
        return self.text(path[0], path[1], "repeat", "as") or "i"

    def items(self, section: str, key: str) -> list[str]:
        """The names of what is written under a key: of a repeat all of its items."""
        repeat = self.repeat(section, key)
        if repeat is None:
            return [key]
        count = repeat.get("count")
        number = count.value if isinstance(count, ScalarNode) and isinstance(count.value, int) else _ITEMS
        return [f"{key}_{one}" for one in range(min(number, 10 * _ITEMS))]

    def fitting(self, section: str, word: str, index: str = "") -> list[str]:
        """The keys of `components` or `joints` that a word of a reference means."""
        entries = self.section(section)
        if not SPECIAL.search(word):
            stem, _, number = word.rpartition("_")
            if word in entries and self.repeat(section, word) is None:
                return [word]
            return [stem] if number.isdigit() and stem in entries and self.repeat(section, stem) is not None else []
        pattern = pattern_of(word, index)
        return [key for key in entries if any(pattern.match(item) for item in self.items(section, key))]

    def stem(self, section: str, key: str, word: str) -> bool:
        """Whether a word that means a key begins with it."""
        rest = word[len(key):]
        return word.startswith(key) and (not rest or rest[0] in "*?[$" or (rest[0] == "_" and self.repeat(section, key) is not None))

    def around(self, mention: NameOccurrence) -> Span:
        """Where the key or the scalar of a mention stands."""
        return self.document.span(mention.path, key=mention.key)

    def place(self, span: Span, text: str, start: int, end: int) -> Span | None:
        """The place of characters of a text that stands at `span`; None where it is written with other characters than it has."""
        if span.file != self.path or span.line != span.end_line:
            return None
        begin = self.lines[span.line - 1][span.column - 1 : span.end_column - 1].find(text)
        if begin < 0:
            return None
        column = span.column + begin
        return Span(file=span.file, line=span.line, column=column + start, end_line=span.line, end_column=column + end)

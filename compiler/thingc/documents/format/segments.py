"""Split the text of a document into segments: the range of every key and value, with adjacent comments.

A segment contains only positions, not the values. Positions are indices into the text of the document, whose lines must end with a line
feed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import dropwhile

from thingc.base.frozen_struct import FrozenStruct

COMMENT_GAP = 2
"""Minimum number of spaces before a comment at the end of a line."""


class UnsupportedStyle(Exception):
    """Raised if a document contains syntax that the formatter does not support."""


@dataclass(slots=True, kw_only=True)
class EndComment:
    """A comment at the end of a line: its text, its column (from 0), and the spaces that precede it."""

    text: str
    column: int
    gap: int


def append_comment(line: str, comment: EndComment | None) -> str:
    """Append the comment, if any, to a formatted line.

    If the original line has more than `COMMENT_GAP` spaces before the comment, the comment stays in its column, if possible.
    """
    if comment is None:
        return line
    spaces = COMMENT_GAP if comment.gap <= COMMENT_GAP else max(COMMENT_GAP, comment.column - len(line))
    return line + " " * spaces + comment.text


@dataclass(slots=True, kw_only=True)
class Item:
    """An entry of a mapping, or an item of a list.

    For an entry of a mapping, `key` is the range of its key in the text, and `name` is the text of the key.

    `leading` contains the comment lines above the item, and None for each empty line. If the value begins on a later line, `key_comment` is
    the comment after the colon (or dash). `comment` is the comment after the value. If `verbatim` is True, the item is not reformatted.
    """

    value: Segment
    key: tuple[int, int] | None = None
    name: str = ""
    dash: int = 0
    leading: list[str | None] = field(default_factory=list)
    key_comment: EndComment | None = None
    comment: EndComment | None = None
    verbatim: bool = False

    @property
    def start(self) -> int:
        """The index of the first character of the item."""
        return self.key[0] if self.key is not None else self.value.start


@dataclass(slots=True, kw_only=True)
class Segment:
    """A value in the text of a document: a scalar, an alias, a mapping or a list. `flow` is True if the value is in braces or brackets.

    `body` is the index of the first character after the anchor of the value. `anchors` contains the YAML anchors of the value and of values
    inside it, and `aliases` the anchors to which aliases in the value refer. `trailing` contains the comments at the end of a block.
    `column` is the column (from 0) of the keys or dashes of a block. If `verbatim` is True, the value is not reformatted.
    """

    kind: str
    start: int
    end: int
    body: int
    flow: bool = False
    verbatim: bool = False
    column: int = 0
    items: list[Item] = field(default_factory=list)
    anchors: frozenset[str] = frozenset()
    aliases: frozenset[str] = frozenset()
    trailing: list[str | None] = field(default_factory=list)

    @property
    def block(self) -> bool:
        """Whether the entries of the value are on separate lines."""
        return self.kind != "scalar" and not self.flow


class Trivia(FrozenStruct):
    """The comments between two segments: a comment at the end of the line, and pairs (column, text) of the comment lines below.

    An empty line is represented by None.
    """

    comment: EndComment | None
    lines: list[tuple[int, str] | None]


def gap(text: str, start: int, end: int, *, compact: bool = False) -> Trivia:
    """Parse the comments and empty lines between two segments, from `start` to `end`.

    With `compact`, the next segment can be on the same line, as in `- key: value`. Raises `UnsupportedStyle` if there is other text between
    the segments.
    """
    lines = text[start:end].split("\n")
    comment: EndComment | None = None
    comment_lines: list[tuple[int, str] | None] = []
    begins_line = start == 0 or text[start - 1] == "\n"
    for number, line in enumerate(lines):
        stripped = line.strip(" \t")
        if stripped and not stripped.startswith("#"):
            raise UnsupportedStyle
        last = number == len(lines) - 1
        if last and end < len(text):  # indentation of the next segment
            if "\t" in line or (number == 0 and not begins_line and not compact):
                raise UnsupportedStyle
        elif number == 0 and not begins_line:
            if stripped:
                column = line.index("#")
                comment = EndComment(text=stripped, column=start + column - (text.rfind("\n", 0, start) + 1), gap=column)
        elif stripped:
            comment_lines.append((line.index("#"), stripped))
        else:
            comment_lines.append(None)
    if end == len(text) and comment_lines and comment_lines[-1] is None and text.endswith("\n"):
        comment_lines.pop()
    return Trivia(comment=comment, lines=comment_lines)


def tidy(lines: list[str | None], *, first: bool = False) -> list[str | None]:
    """Return comment lines with at most one empty line in succession. With `first`, empty lines at the beginning are omitted."""
    tidied = [line for index, line in enumerate(lines) if line is not None or index == 0 or lines[index - 1] is not None]
    return list(dropwhile(lambda line: line is None, tidied)) if first else tidied


def indent_rest(text: str, by: int) -> str:
    """Indent all lines of a string except the first by `by` additional columns.

    If `by` is negative, at most the leading spaces of a line are removed.
    """
    if by == 0 or "\n" not in text:
        return text
    first, *other_lines = text.split("\n")
    return "\n".join([first, *(_indent_line(line, by) for line in other_lines)])


def _indent_line(line: str, by: int) -> str:
    if not line:
        return line
    if by > 0:
        return " " * by + line
    spaces = len(line) - len(line.lstrip(" "))
    return line[min(spaces, -by) :]


def alignments(entries: Sequence[tuple[int, int] | None]) -> list[int]:
    """Return the number of spaces between the key and the value of each entry: 1, or more to keep values in one column.

    For each entry, `entries` contains the number of spaces in the document and the column after them, or None if the value is not on the
    same line. An entry keeps its spaces if the value of the previous or the next entry begins in the same column.
    """
    padded = [None, *entries, None]
    return [
        1 if own is None or all(other is None or other[1] != own[1] for other in (above, below)) else own[0]
        for above, own, below in zip(padded, entries, padded[2:], strict=False)
    ]

"""Convert text positions between thingc and the Language Server Protocol (LSP), and convert URIs to paths.

In thingc, lines and columns are numbered from 1, and columns count characters. In LSP, lines and columns are numbered from 0, and columns
count UTF-16 code units.
"""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from typing import Any
from urllib.parse import unquote, urlsplit
from urllib.request import url2pathname

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Span

_BREAK = re.compile(r"\r\n|\r|\n")


class TextPlace(FrozenStruct):
    """A position between two characters of a text, as in a `Span`. Line and column are numbered from 1."""

    line: int
    column: int


class TextLines:
    """A text with the offsets at which its lines start. Lines end only with line feeds or carriage returns."""

    __slots__ = ("starts", "text")

    def __init__(self, text: str) -> None:
        self.text = text
        self.starts = [0, *(match.end() for match in _BREAK.finditer(text))]

    def with_breaks(self) -> list[str]:
        """Return the lines of the text, including their line breaks."""
        return [self.text[start:end] for start, end in pairwise((*self.starts, len(self.text)))]

    def line(self, number: int) -> str:
        """Return a line, numbered from 1, without its line break. Return an empty string if the text does not have this line."""
        if not 0 < number <= len(self.starts):
            return ""
        end = self.starts[number] if number < len(self.starts) else len(self.text)
        return self.text[self.starts[number - 1] : end].rstrip("\r\n")

    def index(self, place: TextPlace) -> int:
        """Convert a position to an offset in characters. A position outside the text is replaced by the nearest position in the text."""
        if place.line < 1:
            return 0
        if place.line > len(self.starts):
            return len(self.text)
        return self.starts[place.line - 1] + max(0, min(place.column - 1, len(self.line(place.line))))

    def place(self, position: Any) -> TextPlace:
        """Convert an LSP position, such as `{"line": 0, "character": 0}`, to a line and a column inside the text."""
        number = max(0, min(position["line"], len(self.starts) - 1))
        before = self.line(number + 1).encode("utf-16-le", "surrogatepass")[: 2 * max(0, position["character"])]
        return TextPlace(line=number + 1, column=len(before.decode("utf-16-le", "replace")) + 1)

    def position(self, line: int, column: int) -> dict[str, int]:
        """Convert a line and a column, both numbered from 1, to an LSP position."""
        before = self.line(line)[: max(0, column - 1)]
        return {"line": max(0, line - 1), "character": len(before) + (0 if before.isascii() else sum(ord(one) > 0xFFFF for one in before))}

    def range(self, span: Span) -> dict[str, dict[str, int]]:
        """Convert a span in this text to an LSP range."""
        return {"start": self.position(span.line, span.column), "end": self.position(span.end_line, span.end_column)}

    def range_of(self, start: int, end: int) -> dict[str, dict[str, int]]:
        """Return the LSP range of the characters from the offset `start` up to, but not including, the offset `end`."""
        return {"start": self._position_at(start), "end": self._position_at(end)}

    def _position_at(self, index: int) -> dict[str, int]:
        line = bisect_right(self.starts, index)
        return self.position(line, index - self.starts[line - 1] + 1)


def path_of(uri: str) -> str | None:
    """Convert a URI to an absolute path. Return None if the URI does not refer to a file on this machine."""
    try:
        parts = urlsplit(uri)
        if parts.scheme != "file" or parts.netloc not in ("", "localhost"):
            return None
        path = url2pathname(parts.path) if os.name == "nt" else unquote(parts.path, errors="surrogateescape")
    except ValueError:
        return None
    return os.path.abspath(path) if path and "\0" not in path else None


def equal_ends(old: list[str], new: list[str]) -> tuple[int, int]:
    """Compare two texts line by line. Return the number of equal lines at the beginning, and the number of equal lines at the end.

    No line is counted twice.
    """
    top = len(os.path.commonprefix([old, new]))
    return top, len(os.path.commonprefix([old[top:][::-1], new[top:][::-1]]))


@lru_cache(maxsize=4)
def map_spans(before: str, after: str) -> Callable[[Span], Span | None]:
    """Return a function that converts spans in the text `before` to spans in the text `after`.

    The function returns None if a line of the span has changed.
    """
    if before == after:
        return lambda span: span
    old, new = before.splitlines(), after.splitlines()
    same, end = equal_ends(old, new)

    def line(number: int) -> int | None:
        return number if number <= same else number + len(new) - len(old) if number > len(old) - end else None

    def shift_span(span: Span) -> Span | None:
        first, last = line(span.line), line(span.end_line)
        return None if first is None or last is None else replace(span, line=first, end_line=last)

    return shift_span

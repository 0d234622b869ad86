"""Convert positions between thingc (line and column in characters, from 1) and LSP (in UTF-16 units, from 0), and URIs to paths."""

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
    """A position between two characters, as in a `Span`. Line and column start at 1."""

    line: int
    column: int


class TextLines:
    """A text with the offsets of its lines. Only line feeds and carriage returns end a line."""

    __slots__ = ("starts", "text")

    def __init__(self, text: str) -> None:
        self.text = text
        self.starts = [0, *(match.end() for match in _BREAK.finditer(text))]

    def with_breaks(self) -> list[str]:
        """Return the lines with their line breaks."""
        return [self.text[start:end] for start, end in pairwise((*self.starts, len(self.text)))]

    def line(self, number: int) -> str:
        """Return a line (from 1) without its line break, or an empty string outside the text."""
        if not 0 < number <= len(self.starts):
            return ""
        end = self.starts[number] if number < len(self.starts) else len(self.text)
        return self.text[self.starts[number - 1] : end].rstrip("\r\n")

    def index(self, place: TextPlace) -> int:
        """Return the offset of a position, clamped to the text."""
        if place.line < 1:
            return 0
        if place.line > len(self.starts):
            return len(self.text)
        return self.starts[place.line - 1] + max(0, min(place.column - 1, len(self.line(place.line))))

    def place(self, position: Any) -> TextPlace:
        """Convert an LSP position (`{"line": 0, "character": 0}`), clamped to the text."""
        number = max(0, min(position["line"], len(self.starts) - 1))
        before = self.line(number + 1).encode("utf-16-le", "surrogatepass")[: 2 * max(0, position["character"])]
        return TextPlace(line=number + 1, column=len(before.decode("utf-16-le", "replace")) + 1)

    def position(self, line: int, column: int) -> dict[str, int]:
        """Convert a line and a column (from 1) to an LSP position."""
        before = self.line(line)[: max(0, column - 1)]
        return {"line": max(0, line - 1), "character": len(before) + (0 if before.isascii() else sum(ord(one) > 0xFFFF for one in before))}

    def range(self, span: Span) -> dict[str, dict[str, int]]:
        """Convert a span in this text to an LSP range."""
        return {"start": self.position(span.line, span.column), "end": self.position(span.end_line, span.end_column)}

    def range_of(self, start: int, end: int) -> dict[str, dict[str, int]]:
        """Convert the offsets from `start` to before `end` to an LSP range."""
        return {"start": self._position_at(start), "end": self._position_at(end)}

    def _position_at(self, index: int) -> dict[str, int]:
        line = bisect_right(self.starts, index)
        return self.position(line, index - self.starts[line - 1] + 1)


def path_of(uri: str) -> str | None:
    """Return the absolute path of a URI, or None if it is not a file on this machine."""
    try:
        parts = urlsplit(uri)
        if parts.scheme != "file" or parts.netloc not in ("", "localhost"):
            return None
        path = url2pathname(parts.path) if os.name == "nt" else unquote(parts.path, errors="surrogateescape")
    except ValueError:
        return None
    return os.path.abspath(path) if path and "\0" not in path else None


def equal_ends(old: list[str], new: list[str]) -> tuple[int, int]:
    """Return the number of equal lines at the beginning of two texts, and the number of equal lines at the end of the remaining texts."""
    top = len(os.path.commonprefix([old, new]))
    return top, len(os.path.commonprefix([old[top:][::-1], new[top:][::-1]]))


@lru_cache(maxsize=4)
def steady(before: str, after: str) -> Callable[[Span], Span | None]:
    """Return a function that converts spans in `before` to spans in `after`, or to None if a line has changed."""
    if before == after:
        return lambda span: span
    old, new = before.splitlines(), after.splitlines()
    same, end = equal_ends(old, new)

    def line(number: int) -> int | None:
        return number if number <= same else number + len(new) - len(old) if number > len(old) - end else None

    def moved(span: Span) -> Span | None:
        first, last = line(span.line), line(span.end_line)
        return None if first is None or last is None else replace(span, line=first, end_line=last)

    return moved

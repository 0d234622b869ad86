"""Places in a text: thingc's (lines and columns from 1, in characters) and the protocol's (from 0, in UTF-16 units), and files as URIs."""

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
    """A place between two characters of a text, counted as a `Span` counts: line and column from 1."""

    line: int
    column: int


class TextLines:
    """A text and its lines, as both sides count them: broken at line feeds and carriage returns, and nowhere else."""

    __slots__ = ("starts", "text")

    def __init__(self, text: str) -> None:
        self.text = text
        self.starts = [0, *(match.end() for match in _BREAK.finditer(text))]

    def with_breaks(self) -> list[str]:
        """The lines with their breaks."""
        return [self.text[start:end] for start, end in pairwise((*self.starts, len(self.text)))]

    def line(self, number: int) -> str:
        """A line (from 1) without its break; empty outside of the text."""
        if not 0 < number <= len(self.starts):
            return ""
        end = self.starts[number] if number < len(self.starts) else len(self.text)
        return self.text[self.starts[number - 1] : end].rstrip("\r\n")

    def index(self, place: TextPlace) -> int:
        """The index into the text of a place; the nearest one where the text has no such place."""
        if place.line < 1:
            return 0
        if place.line > len(self.starts):
            return len(self.text)
        return self.starts[place.line - 1] + max(0, min(place.column - 1, len(self.line(place.line))))

    def place(self, position: Any) -> TextPlace:
        """The place of a protocol's position (`{"line": 0, "character": 0}`); within the text whatever is asked."""
        number = max(0, min(position["line"], len(self.starts) - 1))
        before = self.line(number + 1).encode("utf-16-le", "surrogatepass")[: 2 * max(0, position["character"])]
        return TextPlace(line=number + 1, column=len(before.decode("utf-16-le", "replace")) + 1)

    def position(self, line: int, column: int) -> dict[str, int]:
        """The protocol's position of a line and a column (from 1)."""
        before = self.line(line)[: max(0, column - 1)]
        return {"line": max(0, line - 1), "character": len(before) + (0 if before.isascii() else sum(ord(one) > 0xFFFF for one in before))}

    def range(self, span: Span) -> dict[str, dict[str, int]]:
        """The protocol's range of a span of this text."""
        return {"start": self.position(span.line, span.column), "end": self.position(span.end_line, span.end_column)}

    def range_of(self, start: int, end: int) -> dict[str, dict[str, int]]:
        """The protocol's range of the characters from `start` to before `end`."""
        return {"start": self._position_at(start), "end": self._position_at(end)}

    def _position_at(self, index: int) -> dict[str, int]:
        line = bisect_right(self.starts, index)
        return self.position(line, index - self.starts[line - 1] + 1)


def path_of(uri: str) -> str | None:
    """The absolute path that a URI names; None where it names no file of this machine."""
    try:
        parts = urlsplit(uri)
        if parts.scheme != "file" or parts.netloc not in ("", "localhost"):
            return None
        path = url2pathname(parts.path) if os.name == "nt" else unquote(parts.path, errors="surrogateescape")
    except ValueError:
        return None
    return os.path.abspath(path) if path and "\0" not in path else None


def equal_ends(old: list[str], new: list[str]) -> tuple[int, int]:
    """How many lines of two texts are equal: from the beginning on, and of the others from the end on."""
    top = len(os.path.commonprefix([old, new]))
    return top, len(os.path.commonprefix([old[top:][::-1], new[top:][::-1]]))


@lru_cache(maxsize=4)
def steady(before: str, after: str) -> Callable[[Span], Span | None]:
    """Gives the place in `after` of a place in `before`; None where a line of it has changed."""
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

"""What both languages of documents share when a text is read that may not parse at this moment.

Such a reading never fails. It keeps keys and scalars by their path as far as they can be told, and looks for one place, the cursor.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Path

MAX_LEVELS = 100
"""Brackets in brackets; what lies deeper is passed over."""

_LINE = re.compile(r"[^\r\n]*")
_SPACES = re.compile(r"[ \t]*")
_BLANK = re.compile(r"[ \t]*(?:#[^\r\n]*)?(?:\r\n|\r|\n)")


Role = Literal["key", "value"]


class Token(FrozenStruct):
    """A key, or a segment of one: its name, at the characters `start` to before `end`, inside of its `quote` if it has one."""

    name: str
    start: int
    end: int
    quote: str = ""


class CursorPlace(FrozenStruct):
    """Where the cursor was met: a `key` of the mapping at `path`, or the `value` there; the token that stands there already reaches
    from `start` to before `end` (equal: none). `either`: the first key of a mapping or a value on a line of its own; `quote`: the
    one that was opened; `flow`: inside brackets; `header`: in the header of a TOML table."""

    role: Role
    path: Path
    start: int = 0
    end: int = 0
    either: bool = False
    quote: str = ""
    flow: bool = False
    header: bool = False


@dataclass(slots=True)
class Scan(ABC):
    """One reading of a text, with the cursor before the character `target`.

    `keys` has those of every mapping with the place of each, `scalars` the text of every plain or quoted value; `place` is what
    was met at the cursor, None where nothing can be typed that means something (in a comment or a block of text).
    """

    text: str
    target: int
    keys: dict[Path, dict[str, int]] = field(default_factory=dict)
    scalars: dict[Path, str] = field(default_factory=dict)
    place: CursorPlace | None = None
    muted: bool = False
    depth: int = 0
    left: int | None = None
    """Where a bracket that is never closed was left: the beginning of a line that belongs to what holds it."""

    SEPARATOR: ClassVar[str]
    PLAIN: ClassVar[re.Pattern[str]]
    """A value without quotes inside brackets."""
    QUOTES_OVER_LINES: ClassVar[bool]
    """Whether a quote may be closed on a later line."""

    # --- what each language has of its own ----------------------------------------------------------------------------

    @abstractmethod
    def line(self, at: int) -> int:
        """Read what begins with the line at `at`; returns where the next line begins."""

    @abstractmethod
    def key_tokens(self, at: int) -> tuple[list[Token], int]:
        """The segments of the key at `at` inside brackets, and where it ends."""

    @abstractmethod
    def ends_flow(self, line: int, column: int) -> bool:
        """Whether the line that begins at `line` can be none of a bracket that belongs to a key in that column."""

    def run(self) -> None:
        """Read all of the text."""
        at = 0
        while at <= len(self.text):
            at = self.line(at)

    # --- what was met -------------------------------------------------------------------------------------------------

    def gap(self, low: int, high: int, role: Role, path: Path, *, either: bool = False, flow: bool = False) -> None:
        """Nothing stands from `low` to `high`, both included; a cursor there begins a key or a value at `path`."""
        if low <= self.target <= high and self.place is None:
            self.place = CursorPlace(role=role, path=path, start=self.target, end=self.target, either=either, flow=flow)

    def token(self, place: CursorPlace, high: int) -> None:
        """A token; spaces behind it, up to `high`, belong to what is typed."""
        if place.start <= self.target <= high:
            self.place = replace(place, end=max(place.end, self.target))

    def mute(self, start: int, end: int) -> None:
        """A comment or the like."""
        self.muted = self.muted or start < self.target <= end

    def add(self, path: Path, name: str, at: int) -> None:
        """A key of the mapping at `path`."""
        self.keys.setdefault(path, {}).setdefault(name, at)

    # --- small steps --------------------------------------------------------------------------------------------------

    def after(self, pattern: re.Pattern[str], at: int) -> int:
        """The end of what fits a pattern at `at`."""
        match = pattern.match(self.text, at)
        return at if match is None else match.end()

    def line_end(self, at: int) -> int:
        """The end of the line of `at`, before its break."""
        return self.after(_LINE, at)

    def after_break(self, end: int) -> int:
        """Where the line behind the end of one begins; behind the text where there is none."""
        return len(self.text) + 1 if end >= len(self.text) else end + (2 if self.text.startswith("\r\n", end) else 1)

    def spaces(self, at: int) -> int:
        """The first character from `at` on that is no space or tab."""
        return self.after(_SPACES, at)

    def comment(self, at: int) -> int:
        """The end of the comment that begins at `at`."""
        end = self.line_end(at)
        self.mute(at, end)
        return end

    def rest(self, at: int) -> int:
        """Read the rest of a line, from `at` on, which has nothing but a comment; returns where the next line begins."""
        end = self.line_end(at)
        comment = self.text.find("#", at, end)
        return self.after_break(end if comment < 0 else self.comment(comment))

    def behind_value(self, at: int) -> int:
        """Where it goes on behind a value that ends at `at`: with the next line, or where an open bracket was left."""
        if self.left is None:
            return self.rest(at)
        line, self.left = self.left, None
        return line

    # --- brackets -----------------------------------------------------------------------------------------------------

    def skip(self, at: int, column: int) -> int:
        """Over spaces, lines and comments inside brackets. Sets `left` where a line belongs to what holds them."""
        first: int | None = None
        while True:
            at = self.spaces(at)
            if at < len(self.text) and self.text[at] == "#":
                at = self.comment(at)
            if at >= len(self.text) or self.text[at] not in "\r\n":
                return at
            line = self.after_break(at)
            first = line if first is None else first
            blank = _BLANK.match(self.text, line)
            while blank is not None:
                self.mute(self.text.find("#", line, blank.end()), blank.end() - 1) if "#" in blank.group() else None
                line = blank.end()
                blank = _BLANK.match(self.text, line)
            if self.ends_flow(line, column):
                self.left = first
                return at
            at = line

    def brackets(self, at: int, path: Path, column: int) -> int:
        """Read `{...}` or `[...]` at `at`, the value of a key in that column of its line; returns where it ends."""
        mapping = self.text[at] == "{"
        index, here, fresh = 0, at + 1, True
        self.depth += 1
        while self.left is None:
            before = here
            here = self.skip(here, column)
            inner = path if mapping else (*path, index)
            high = here if self.left is None else self.line_end(before)
            self.gap(before, high, "key" if mapping else "value", inner, flow=True)
            if self.left is not None or here >= len(self.text):
                break
            character = self.text[here]
            if character in "}]":
                here += 1
                break
            if character == ",":
                index += 0 if fresh else 1
                here, fresh = here + 1, True
                continue
            fresh = False
            here = self.entry(here, path, column) if mapping else self.value_in(here, inner, column)
        self.depth -= 1
        return here

    def entry(self, at: int, path: Path, column: int) -> int:
        """One `key: value` in braces."""
        tokens, end = self.key_tokens(at)
        after = self.spaces(end)
        separated = self.text.startswith(self.SEPARATOR, after)
        path = self.segments(tokens, path, after, separated, flow=True)
        if not separated:
            return max(after, at + 1)
        before = after + 1
        here = self.skip(before, column)
        high = here if self.left is None else self.line_end(before)
        self.gap(before, high, "value", path, flow=True)
        ended = self.left is not None or here >= len(self.text) or self.text[here] in ",}]"
        return here if ended else self.value_in(here, path, column)

    def segments(self, tokens: list[Token], path: Path, high: int, separated: bool, *, flow: bool = False, header: bool = False) -> Path:
        """Keep the segments of a key, whose last one is sure where it is `separated` from what follows; returns the path of its value."""
        for token in tokens:
            last = token is tokens[-1]
            place = CursorPlace(role="key", path=path, start=token.start, end=token.end, quote=token.quote, flow=flow, header=header)
            self.token(place, high if last and not token.quote else token.end)
            if token.quote and self.target in (token.start - 1, token.end + 1):  # outside of the quotes: all of it
                self.place = CursorPlace(role="key", path=path, start=token.start - 1, end=token.end + 1, flow=flow, header=header)
            if separated or not last:
                self.add(path, token.name, token.start)
            path = (*path, token.name)
        return path

    def value_in(self, at: int, path: Path, column: int) -> int:
        """One value inside brackets; returns where it ends."""
        character = self.text[at]
        if character in "{[":
            return self.brackets(at, path, column) if self.depth < MAX_LEVELS else at + 1
        if character in "\"'":
            return self.quoted(at, path, column, flow=True)
        end = max(self.after(self.PLAIN, at), at + 1)
        written = self.text[at:end].rstrip(" \t")
        self.scalars[path] = written
        high = self.spaces(end)
        self.token(CursorPlace(role="value", path=path, start=at, end=at + len(written), flow=True), high)
        return high

    def quoted(self, at: int, path: Path, column: int, *, flow: bool = False) -> int:
        """A quoted value; returns where it ends."""
        start, end, after = self.quotes(at, column)
        self.scalars[path] = self.text[start:end]
        last = min(end, self.line_end(max(start, min(self.target, end))))
        if start <= self.target <= end:
            self.token(CursorPlace(role="value", path=path, start=start, end=last, quote=self.text[at:start], flow=flow), end)
        elif at <= self.target <= after:
            self.token(CursorPlace(role="value", path=path, start=at, end=after, flow=flow), after)
        return after

    def quotes(self, at: int, column: int) -> tuple[int, int, int]:
        """The characters inside the quotes that open at `at`, and where it goes on behind them. A quote that is never closed, or
        behind a line that belongs to something else, ends with its line."""
        quote = self.text[at]
        here = at + 1
        while True:
            here = self.after(_DOUBLE if quote == '"' else _SINGLE, here)
            if here < len(self.text) and self.text[here] == quote:
                return at + 1, here, here + 1
            line = self.after_break(here)
            if here >= len(self.text) or not self.QUOTES_OVER_LINES or self.ends_flow(line, column):
                end = self.line_end(at)
                return at + 1, end, end
            here = line


_DOUBLE = re.compile(r'(?:[^"\\\r\n]|\\[^\r\n])*\\?')
_SINGLE = re.compile(r"(?:[^'\r\n]|'')*")

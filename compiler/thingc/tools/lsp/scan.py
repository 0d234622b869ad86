"""The base class of the YAML scanner and the TOML scanner of the language server. The scanned text may be invalid.

A scanner does not raise errors, collects as many keys and scalars as possible, and finds the context of the cursor.
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
"""Maximum nesting depth of brackets. Brackets that are nested more deeply are skipped."""

_LINE = re.compile(r"[^\r\n]*")
_SPACES = re.compile(r"[ \t]*")
_BLANK = re.compile(r"[ \t]*(?:#[^\r\n]*)?(?:\r\n|\r|\n)")


Role = Literal["key", "value"]


class Token(FrozenStruct):
    """A key, or one segment of a dotted key.

    The name extends from the offset `start` up to, but not including, `end`, without quotes. `quote` is the quote character, or an empty
    string.
    """

    name: str
    start: int
    end: int
    quote: str = ""


class CursorPlace(FrozenStruct):
    """The context of the cursor in a document: the path of keys, and whether a key or a value is expected at the cursor.

    `role` is `key` for a key of the mapping at `path`, or `value` for the value at `path`. The existing token extends from `start` up to,
    but not including, `end`, and can be empty. If `either` is true, the position can contain the first key of a mapping or a value on its
    own line. `quote` is the opening quote. `flow` specifies whether the cursor is inside brackets, and `header` whether the cursor is in
    the header of a TOML table.
    """

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
    """Scans the text of a document to find its keys and values, and the context of a cursor at the offset `target`.

    `keys` contains the keys of every mapping with their offsets, and `scalars` the texts of all plain and quoted values. `place` is the
    context of the cursor, or None in comments and block scalars, in which completion is disabled.
    """

    text: str
    target: int
    keys: dict[Path, dict[str, int]] = field(default_factory=dict)
    scalars: dict[Path, str] = field(default_factory=dict)
    place: CursorPlace | None = None
    muted: bool = False
    depth: int = 0
    outer_line: int | None = None
    """Offset at which an unclosed bracket ended: the start of a line that belongs to an outer block."""

    SEPARATOR: ClassVar[str]
    PLAIN: ClassVar[re.Pattern[str]]
    """Regular expression of a plain value inside brackets."""
    QUOTES_OVER_LINES: ClassVar[bool]
    """Whether a quoted value can span several lines."""

    # --- methods of the languages -----------------------------------------------------------------------------------------

    @abstractmethod
    def line(self, at: int) -> int:
        """Scan the line that starts at the offset `at`. Return the offset of the next line."""

    @abstractmethod
    def key_tokens(self, at: int) -> tuple[list[Token], int]:
        """Return the segments of the key at the offset `at` inside brackets, and the offset where the key ends."""

    @abstractmethod
    def ends_flow(self, line: int, column: int) -> bool:
        """Return whether the line at the offset `line` ends the brackets that the value of a key at this column has opened."""

    def run(self) -> None:
        """Scan the whole text of the document, and store the keys, the scalars and the context of the cursor."""
        at = 0
        while at <= len(self.text):
            at = self.line(at)

    # --- results ----------------------------------------------------------------------------------------------------------

    def note_gap(self, low: int, high: int, role: Role, path: Path, *, either: bool = False, flow: bool = False) -> None:
        """Process a range of the text without a token, from the offset `low` to the offset `high`, inclusive.

        If the cursor is in this range, the user is about to type a key or a value at `path`.
        """
        if low <= self.target <= high and self.place is None:
            self.place = CursorPlace(role=role, path=path, start=self.target, end=self.target, either=either, flow=flow)

    def add_token(self, place: CursorPlace, high: int) -> None:
        """Process a key or a value of the document. Spaces after the token, up to the offset `high`, belong to the typed text."""
        if place.start <= self.target <= high:
            self.place = replace(place, end=max(place.end, self.target))

    def mute(self, start: int, end: int) -> None:
        """Disable completion in the text between two offsets, for example in a comment."""
        self.muted = self.muted or start < self.target <= end

    def add(self, path: Path, name: str, at: int) -> None:
        """Record that the mapping at `path` contains a key."""
        self.keys.setdefault(path, {}).setdefault(name, at)

    # --- helper methods ---------------------------------------------------------------------------------------------------

    def match_end(self, pattern: re.Pattern[str], at: int) -> int:
        """Match a pattern at the offset `at`, and return the end of the match. Return `at` if the pattern does not match."""
        match = pattern.match(self.text, at)
        return at if match is None else match.end()

    def line_end(self, at: int) -> int:
        """Return the offset of the end of the line that contains the offset `at`. The line does not include the line break."""
        return self.match_end(_LINE, at)

    def after_break(self, end: int) -> int:
        """Return the offset of the start of the next line. After the last line, return an offset beyond the end of the text."""
        return len(self.text) + 1 if end >= len(self.text) else end + (2 if self.text.startswith("\r\n", end) else 1)

    def spaces(self, at: int) -> int:
        """Return the offset of the first character at or after `at` that is not a space or tab."""
        return self.match_end(_SPACES, at)

    def comment(self, at: int) -> int:
        """Skip a comment, and return the offset of its end."""
        end = self.line_end(at)
        self.mute(at, end)
        return end

    def skip_line(self, at: int) -> int:
        """Skip the rest of a line, including a comment, and return the offset of the start of the next line."""
        end = self.line_end(at)
        comment = self.text.find("#", at, end)
        return self.after_break(end if comment < 0 else self.comment(comment))

    def after_value(self, at: int) -> int:
        """Return the offset at which the scan continues after a value: the start of the next line, or the end of an unclosed bracket."""
        if self.outer_line is None:
            return self.skip_line(at)
        line, self.outer_line = self.outer_line, None
        return line

    # --- brackets -----------------------------------------------------------------------------------------------------

    def skip(self, at: int, column: int) -> int:
        """Skip spaces, line breaks and comments inside brackets.

        If a line belongs to an outer block, store the offset of the line in `outer_line`.
        """
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
                self.outer_line = first
                return at
            at = line

    def scan_brackets(self, at: int, path: Path, column: int) -> int:
        """Scan the mapping `{...}` or list `[...]` that starts at the offset `at`. Return the offset of the end of the value.

        `column` is the column of the key.
        """
        mapping = self.text[at] == "{"
        index, here, fresh = 0, at + 1, True
        self.depth += 1
        while self.outer_line is None:
            before = here
            here = self.skip(here, column)
            inner = path if mapping else (*path, index)
            high = here if self.outer_line is None else self.line_end(before)
            self.note_gap(before, high, "key" if mapping else "value", inner, flow=True)
            if self.outer_line is not None or here >= len(self.text):
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
            here = self.scan_entry(here, path, column) if mapping else self.scan_value(here, inner, column)
        self.depth -= 1
        return here

    def scan_entry(self, at: int, path: Path, column: int) -> int:
        """Scan an entry `key: value` of a mapping in braces. Return the offset of the end of the entry."""
        tokens, end = self.key_tokens(at)
        after = self.spaces(end)
        separated = self.text.startswith(self.SEPARATOR, after)
        path = self.segments(tokens, path, after, separated, flow=True)
        if not separated:
            return max(after, at + 1)
        before = after + 1
        here = self.skip(before, column)
        high = here if self.outer_line is None else self.line_end(before)
        self.note_gap(before, high, "value", path, flow=True)
        ended = self.outer_line is not None or here >= len(self.text) or self.text[here] in ",}]"
        return here if ended else self.scan_value(here, path, column)

    def segments(self, tokens: list[Token], path: Path, high: int, separated: bool, *, flow: bool = False, header: bool = False) -> Path:
        """Record the segments of a dotted key, and return the path of its value.

        The last segment is recorded only if `:` or `=` follows the key (`separated`).
        """
        for token in tokens:
            last = token is tokens[-1]
            place = CursorPlace(role="key", path=path, start=token.start, end=token.end, quote=token.quote, flow=flow, header=header)
            self.add_token(place, high if last and not token.quote else token.end)
            if token.quote and self.target in (token.start - 1, token.end + 1):  # the cursor is next to the quotes: replace the quotes, too
                self.place = CursorPlace(role="key", path=path, start=token.start - 1, end=token.end + 1, flow=flow, header=header)
            if separated or not last:
                self.add(path, token.name, token.start)
            path = (*path, token.name)
        return path

    def scan_value(self, at: int, path: Path, column: int) -> int:
        """Scan a value inside brackets. Return the offset of the end of the value."""
        character = self.text[at]
        if character in "{[":
            return self.scan_brackets(at, path, column) if self.depth < MAX_LEVELS else at + 1
        if character in "\"'":
            return self.scan_quoted(at, path, column, flow=True)
        end = max(self.match_end(self.PLAIN, at), at + 1)
        written = self.text[at:end].rstrip(" \t")
        self.scalars[path] = written
        high = self.spaces(end)
        self.add_token(CursorPlace(role="value", path=path, start=at, end=at + len(written), flow=True), high)
        return high

    def scan_quoted(self, at: int, path: Path, column: int, *, flow: bool = False) -> int:
        """Scan a value in quotes. Return the offset of the end of the value."""
        start, end, after = self.quoted_range(at, column)
        self.scalars[path] = self.text[start:end]
        last = min(end, self.line_end(max(start, min(self.target, end))))
        if start <= self.target <= end:
            self.add_token(CursorPlace(role="value", path=path, start=start, end=last, quote=self.text[at:start], flow=flow), end)
        elif at <= self.target <= after:
            self.add_token(CursorPlace(role="value", path=path, start=at, end=after, flow=flow), after)
        return after

    def quoted_range(self, at: int, column: int) -> tuple[int, int, int]:
        """Return the start and the end of the text inside the quotes at the offset `at`, and the offset after the closing quote.

        If the closing quote is missing, or if a line of another entry precedes the closing quote, the value ends at the end of the line.
        """
        quote = self.text[at]
        here = at + 1
        while True:
            here = self.match_end(_DOUBLE if quote == '"' else _SINGLE, here)
            if here < len(self.text) and self.text[here] == quote:
                return at + 1, here, here + 1
            line = self.after_break(here)
            if here >= len(self.text) or not self.QUOTES_OVER_LINES or self.ends_flow(line, column):
                end = self.line_end(at)
                return at + 1, end, end
            here = line


_DOUBLE = re.compile(r'(?:[^"\\\r\n]|\\[^\r\n])*\\?')
_SINGLE = re.compile(r"(?:[^'\r\n]|'')*")

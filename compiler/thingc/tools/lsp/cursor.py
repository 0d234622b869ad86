"""Find the keys, the scalars and the context of the cursor in the text of a document, which does not have to be parsable.

The context of the cursor contains the path of keys, the expected kind of token (key or value), the typed text, and the characters that a
completion replaces. Keys and values can be incomplete, brackets and quotes can be unclosed, and lines can be empty. This module contains
the scanners for YAML and TOML. Their common base class is in `scan.py`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from thingc.base.source import Path
from thingc.tools.lsp.scan import CursorPlace, Scan, Token

_SEGMENT = re.compile(r"""[ \t]*(?:"([^"\r\n]*)"?|'([^'\r\n]*)'?|([A-Za-z0-9_-]*))""")
_BARE_ON_LINE = re.compile(r"[^\r\n#]*")
_LINE_OF_TABLE = re.compile(
    r"""[ \t]*(?:["']?[A-Za-z0-9_][\w."'-]*[ \t]*=|\[\[?[ \t]*["']?[A-Za-z][\w."'-]*[ \t]*\]\]?[ \t]*(?:#|\r|\n|$))""",
)


@dataclass(slots=True)
class TomlScan(Scan):
    """Scans TOML text, which may be invalid. The scanner reads table headers and lines `key = value`, and skips other text."""

    table: Path = ()
    counts: dict[Path, int] = field(default_factory=dict)

    SEPARATOR = "="
    PLAIN = re.compile(r"[^,\[\]{}\r\n#=]*")
    QUOTES_OVER_LINES = False

    def line(self, at: int) -> int:
        """Scan the line that starts at an offset, as `Scan.line` specifies. Return the offset of the next line."""
        here = self.spaces(at)
        if here >= self.line_end(at) or self.text[here] == "#":
            self.note_gap(at, here, "key", self.table)
            return self.skip_line(here)
        if self.text[here] == "[":
            return self._header(here)
        self.note_gap(at, here - 1, "key", self.table)
        tokens, after = self.key_tokens(here)
        after = self.spaces(after)
        separated = self.text.startswith("=", after)
        path = self.segments(tokens, self.table, after, separated)
        return self._value(after + 1, path) if separated else self.skip_line(after)

    def _header(self, here: int) -> int:
        several = self.text.startswith("[[", here)
        tokens, after = self.key_tokens(here + (2 if several else 1))
        closed = self.text.startswith("]", self.spaces(after))
        path: Path = ()
        for token in tokens:
            last = token is tokens[-1]
            path = self.segments([token], path, token.end, closed or not last, header=True)
            if last and several:
                self.counts[path] = self.counts.get(path, -1) + 1
            if path in self.counts:
                path = (*path, self.counts[path])
        self.table = path
        return self.skip_line(after)

    def _value(self, at: int, path: Path) -> int:
        here = self.spaces(at)
        self.note_gap(at, here, "value", path)
        if here >= self.line_end(at) or self.text[here] == "#":
            return self.skip_line(here)
        if self.text[here] in "{[":
            after = self.scan_brackets(here, path, 0)
        elif self.text[here] in "\"'":
            after = self.scan_quoted(here, path, 0)
        else:
            after = self.match_end(_BARE_ON_LINE, here)
            written = self.text[here:after].rstrip(" \t")
            self.scalars[path] = written
            self.add_token(CursorPlace(role="value", path=path, start=here, end=here + len(written)), after)
        return self.after_value(after)

    # --- brackets and quotes ------------------------------------------------------------------------------------------

    def key_tokens(self, at: int) -> tuple[list[Token], int]:
        """Return the segments of the dotted key at the offset `at`, and the offset where the key ends."""
        tokens: list[Token] = []
        while True:
            match = _SEGMENT.match(self.text, at)
            if match is None:
                return tokens, at
            group = match.lastindex or 0
            quote = {1: '"', 2: "'"}.get(group, "")
            tokens.append(Token(name=match.group(group), start=match.start(group), end=match.end(group), quote=quote))
            at = self.spaces(match.end())
            if not self.text.startswith(".", at):
                return tokens, match.end()
            at += 1

    def ends_flow(self, line: int, column: int) -> bool:
        """Return whether the line at the offset `line` contains a table header or a key. Such a line is not inside an open bracket."""
        return _LINE_OF_TABLE.match(self.text, line) is not None

    def quoted_range(self, at: int, column: int) -> tuple[int, int, int]:
        """Return the range of a quoted text, as `Scan.quoted_range`. In TOML, only values in triple quotes can span several lines."""
        quote = self.text[at]
        if self.text.startswith(quote * 3, at):
            close = self.text.find(quote * 3, at + 3)
            end = self.line_end(at) if close < 0 else close
            return at + 3, end, end if close < 0 else end + 3
        return Scan.quoted_range(self, at, column)


_KEY = re.compile(
    r"""(?:"(?P<double>(?:[^"\\\r\n]|\\[^\r\n])*)"|'(?P<single>(?:[^'\r\n]|'')*)'|(?P<plain>(?=:)|[^\s:#{}\[\],&!|>'"%@`-][^\r\n]*?|-[^\s][^\r\n]*?))"""
    r"""[ \t]*:(?=[ \t\r\n]|$)""",
)
_COMMENTED = re.compile(r"[ \t]#")
_TEXT_BLOCK = re.compile(r"[|>][-+0-9]*[ \t]*(?:#[^\r\n]*)?$")
_PROPERTY = re.compile(r"[&!][^\s,{}\[\]]*")
_LINE_OF_BLOCK = re.compile(
    r"""([ ]*)(?:-[ \t\r\n]|[^\s#{}\[\],"'][^\s#{}\[\],"']*[ ]*:(?:[ \t\r\n]|$)|["'][^"'\r\n]*["']:(?:[ \t\r\n]|$))""",
)
_PLAIN_KEY_IN_FLOW = re.compile(r"(?:[^,{}\[\]\r\n:# \t]|:(?![\s,{}\[\]]|$)|[ \t]+(?![#:])|(?<![ \t])#)*")


@dataclass(slots=True)
class _Frame:
    """A YAML block mapping or block sequence that contains the current line of the scan.

    `column` is the column of the keys or dashes, `path` is the path of keys to the block, and `last` is the last key or index. `state`
    describes the last entry: `open` (no value yet), `scalar` (a plain value, which may continue on the next line), or `done`.
    """

    column: int
    path: Path
    sequence: bool
    last: str | int | None = None
    state: str = "done"

    def inner(self) -> Path:
        """Return the path of keys to the value of the last entry."""
        return self.path if self.last is None else (*self.path, self.last)


@dataclass(slots=True)
class YamlScan(Scan):
    """Scans YAML text, which may be invalid. The scanner finds nested blocks by indentation, and skips text that it cannot parse."""

    stack: list[_Frame] = field(default_factory=lambda: [_Frame(0, (), False)])

    SEPARATOR = ":"
    PLAIN = re.compile(r"(?:[^,{}\[\]\r\n:# \t]|:(?![ \t])|[ \t]+(?!#)|(?<![ \t])#)*")
    QUOTES_OVER_LINES = True

    # --- blocks -------------------------------------------------------------------------------------------------------

    def line(self, at: int) -> int:
        """Scan the line that starts at an offset, as `Scan.line` specifies. Return the offset of the next line."""
        end = self.line_end(at)
        here = self.spaces(at)
        if here >= end or self.text[here] == "#":
            if at <= self.target <= here:
                self._blank(self.target - at)
            return self.skip_line(here)
        if here == at and self.text.startswith(("---", "...", "%"), at):
            return self.after_break(end)
        column = here - at
        dash = self._dash(here, end)
        while len(self.stack) > 1 and (
            self.stack[-1].column > column or (self.stack[-1].column == column and self.stack[-1].sequence and not dash)
        ):
            self.stack.pop()
        if column > 0 and self.stack[0].last is None:
            self.stack[0].column = column
        return self._content(at, here, end)

    def _dash(self, here: int, end: int) -> bool:
        return self.text[here] == "-" and (here + 1 >= end or self.text[here + 1] in " \t")

    def _blank(self, column: int) -> None:
        """Find the context of a cursor on an empty line or in the indentation of a line."""
        top = self.stack[-1]
        if top.state == "open" and (column > top.column or (top.sequence and column >= top.column)):
            self.place = CursorPlace(role="key", path=top.inner(), start=self.target, end=self.target, either=True)
            return
        fitting = [frame for frame in self.stack if frame.column <= column]
        if fitting and not fitting[-1].sequence:
            self.place = CursorPlace(role="key", path=fitting[-1].path, start=self.target, end=self.target)

    def _content(self, line: int, here: int, end: int) -> int:
        column = here - line
        while self._dash(here, end):
            top = self.stack[-1]
            if not (top.sequence and top.column == column):
                path, top.state = top.inner(), "done"
                top = _Frame(column, path, True)
                self.stack.append(top)
            top.last = top.last + 1 if isinstance(top.last, int) else 0
            top.state = "open"
            before, here = here + 1, self.spaces(here + 1)
            self.note_gap(before, here, "key", top.inner(), either=True)
            if here >= end or self.text[here] == "#":
                return self.skip_line(here)
            column = here - line
        top = self.stack[-1]
        key = _KEY.match(self.text, here, end)
        if key is not None and (key["plain"] is None or _COMMENTED.search(key["plain"]) is None):
            if top.sequence or top.column < column:
                path, top.state = top.inner(), "done"
                top = _Frame(column, path, False)
                self.stack.append(top)
            kind = str(key.lastgroup)
            name = key[kind]
            quote = {"plain": "", "double": '"', "single": "'"}[kind]
            token = Token(name=name, start=key.start(kind), end=key.end(kind), quote=quote)
            path = self.segments([token], top.path, key.end() - 1, True)
            top.last = name
            return self._value(key.end(), end, path, top)
        if top.column == column and not top.sequence and self.text[here] not in "{[":
            return self._word(here, end, top.path)
        if top.state == "open" and self.text[here] not in "{[\"'&!*|>=":
            self.scalars[top.inner()] = self._text_until(here, end)
            after = self._word(here, end, top.inner(), either=True)
            top.state = "scalar"
            return after
        if top.state == "done" and top.last is not None and not top.sequence:
            return self._word(here, end, top.path)
        return self._value(here, end, top.inner(), top)

    def _text_until(self, here: int, end: int) -> str:
        comment = _COMMENTED.search(self.text, here, end)
        return self.text[here : end if comment is None else comment.start()].rstrip(" \t")

    def _word(self, here: int, end: int, path: Path, *, either: bool = False) -> int:
        """Process the text from the offset `here`, which is not yet an entry of the mapping at a path."""
        quote = self.text[here] if self.text[here] in "\"'" else ""
        start, stop = here + len(quote), here + len(self._text_until(here, end))
        comment = self.text.find("#", stop, end)
        place = CursorPlace(role="key", path=path, start=start, end=max(start, stop), either=either, quote=quote)
        self.add_token(place, end if comment < 0 else comment)
        return self.skip_line(stop)

    def _value(self, at: int, end: int, path: Path, frame: _Frame) -> int:
        here = self.spaces(at)
        while here < end and self.text[here] in "&!":
            here = self.spaces(self.match_end(_PROPERTY, here))
        self.note_gap(at, here, "value", path)
        if here >= end or (self.text[here] == "#" and here > at):
            frame.state = "open"
            return self.skip_line(here)
        character = self.text[here]
        if character in "|>" and _TEXT_BLOCK.match(self.text, here, end):
            return self._text_block(end, frame)
        if character in "{[":
            frame.state = "done"
            after = self.scan_brackets(here, path, frame.column)
        elif character in "\"'":
            frame.state = "done"
            after = self.scan_quoted(here, path, frame.column)
        else:
            written = self._text_until(here, end)
            joined = frame.state == "scalar" and path in self.scalars
            self.scalars[path] = f"{self.scalars[path]} {written}" if joined else written
            frame.state = "scalar"
            after = here + len(written)
            comment = _COMMENTED.search(self.text, after, end)
            self.add_token(CursorPlace(role="value", path=path, start=here, end=after), end if comment is None else comment.start() + 1)
        return self.after_value(after)

    def _text_block(self, end: int, frame: _Frame) -> int:
        """Skip the lines of a block scalar after `|` or `>`: empty lines, and lines that are indented more than the key.

        Return the start of the next line.
        """
        frame.state = "done"
        at = self.after_break(end)
        while at <= len(self.text):
            stop = self.line_end(at)
            here = self.spaces(at)
            if here < stop and here - at <= frame.column:
                break
            if at <= self.target <= stop and self.target - at > frame.column:
                self.muted = True
            at = self.after_break(stop)
        return at

    # --- brackets -----------------------------------------------------------------------------------------------------

    def key_tokens(self, at: int) -> tuple[list[Token], int]:
        """Return the key at the offset `at` as a single token, and the offset where the key ends."""
        if self.text[at] in "\"'":
            start, end, after = self.quoted_range(at, 0)
            return [Token(name=self.text[start:end], start=start, end=end, quote=self.text[at])], after
        end = self.match_end(_PLAIN_KEY_IN_FLOW, at)
        name = self.text[at:end].rstrip(" \t")
        return [Token(name=name, start=at, end=at + len(name))], end

    def ends_flow(self, line: int, column: int) -> bool:
        """Return whether the line at the offset `line` starts an entry of an outer block, and is therefore not inside an open bracket."""
        match = _LINE_OF_BLOCK.match(self.text, line)
        return match is not None and len(match.group(1)) <= column


class Cursor(CursorPlace):
    """The position of the cursor in a document, and the token at the cursor. Positions are offsets in characters.

    `typed` is the text from `start` to the cursor. A completion replaces the text from `start` up to, but not including, `end` on the same
    line. `separated` specifies whether `:` or `=` already follows the key. `toml` specifies whether the language is TOML instead of YAML.

    `keys` contains the keys of every mapping in the text, except the key at the cursor. `scalars` contains the text of every scalar.
    """

    typed: str
    separated: bool
    toml: bool
    keys: Mapping[Path, tuple[str, ...]]
    scalars: Mapping[Path, str]


def cursor_at(text: str, offset: int, *, toml: bool) -> Cursor | None:
    """Find the context of a cursor at the given offset of the text.

    Return None in comments and multi-line strings, in which completion is disabled.
    """
    scan: Scan = (TomlScan if toml else YamlScan)(text, offset)
    scan.run()
    place = scan.place
    if place is None or scan.muted:
        return None
    end = min(place.end, scan.line_end(offset))
    start = max(place.start, text.rfind("\n", 0, offset) + 1, text.rfind("\r", 0, offset) + 1)
    keys_at_cursor = scan.keys.get(place.path, {})
    after = scan.spaces(end + len(place.quote) if text.startswith(place.quote, end) else end)
    return Cursor(
        role=place.role, path=place.path, typed=text[start:offset], start=start, end=end, either=place.either, quote=place.quote,
        flow=place.flow, header=place.header, separated=place.role == "key" and text.startswith(scan.SEPARATOR, after), toml=toml,
        keys={
            path: tuple(name for name, at in names.items() if not (names is keys_at_cursor and place.role == "key" and at == place.start))
            for path, names in scan.keys.items()
        },
        scalars=scan.scalars,
    )

"""TOML that may not parse: tables by their headers, lines of `key = value`, and whatever can be told of the rest."""

from __future__ import annotations

import re

from thingc.base.source import Path
from thingc.tools.lsp.scan import CursorPlace, Scan, Token

_SEGMENT = re.compile(r"""[ \t]*(?:"([^"\r\n]*)"?|'([^'\r\n]*)'?|([A-Za-z0-9_-]*))""")
_BARE = re.compile(r"[^,\[\]{}\r\n#=]*")
_BARE_ON_LINE = re.compile(r"[^\r\n#]*")
_LINE_OF_TABLE = re.compile(
    r"""[ \t]*(?:["']?[A-Za-z0-9_][\w."'-]*[ \t]*=|\[\[?[ \t]*["']?[A-Za-z][\w."'-]*[ \t]*\]\]?[ \t]*(?:#|\r|\n|$))""",
)


class TomlScan(Scan):
    """One reading of a TOML text, see `Scan`."""

    SEPARATOR = "="

    def run(self) -> None:
        """Read all of it."""
        self.table: Path = ()
        self.counts: dict[Path, int] = {}
        at = 0
        while at <= len(self.text):
            at = self._line(at)

    def _line(self, at: int) -> int:
        end, here = self.line_end(at), self.spaces(at)
        if here >= end or self.text[here] == "#":
            self.gap(at, here, CursorPlace(role="key", path=self.table, start=here, end=here))
            self.mute(here, end)
            return self.after_break(end)
        if self.text[here] == "[":
            return self._header(here, end)
        self.gap(at, here - 1, CursorPlace(role="key", path=self.table, start=here, end=here))
        tokens, after = self.key_tokens(here)
        after = self.spaces(after)
        separated = self.text.startswith("=", after)
        path = self.segments(tokens, self.table, after, separated)
        return self._value(after + 1, end, path) if separated else self._rest(after, end)

    def _rest(self, at: int, end: int) -> int:
        comment = self.text.find("#", at, end)
        if comment >= 0:
            self.mute(comment, end)
        return self.after_break(end)

    def _header(self, here: int, end: int) -> int:
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
        return self._rest(after, end)

    def _value(self, at: int, end: int, path: Path) -> int:
        here = self.spaces(at)
        self.gap(at, here, CursorPlace(role="value", path=path, start=here, end=here))
        if here >= end or self.text[here] == "#":
            return self._rest(here, end)
        if self.text[here] in "{[":
            after = self.brackets(here, path, 0)
        elif self.text[here] in "\"'":
            after = self.quoted(here, path, 0)
        else:
            match = _BARE_ON_LINE.match(self.text, here)
            high = here if match is None else match.end()
            written = self.text[here:high].rstrip(" \t")
            self.scalars[path] = written
            self.token(CursorPlace(role="value", path=path, start=here, end=here + len(written)), high)
            after = high
        if self.left is not None:
            line, self.left = self.left, None
            return line
        return self._rest(after, self.line_end(after))

    # --- brackets and quotes ------------------------------------------------------------------------------------------

    def key_tokens(self, at: int) -> tuple[list[Token], int]:
        """See `Scan`: the segments of a dotted key."""
        tokens: list[Token] = []
        while True:
            match = _SEGMENT.match(self.text, at)
            if match is None:
                return tokens, at
            group, quote = next(((number, mark) for number, mark in ((1, '"'), (2, "'")) if match.group(number) is not None), (3, ""))
            tokens.append(Token(name=match.group(group), start=match.start(group), end=match.end(group), quote=quote))
            at = self.spaces(match.end())
            if not self.text.startswith(".", at):
                return tokens, match.end()
            at += 1

    def plain_end(self, at: int) -> int:
        """See `Scan`."""
        match = _BARE.match(self.text, at)
        return at if match is None else match.end()

    def ends_flow(self, line: int, column: int) -> bool:
        """See `Scan`: a line with a key of its own, or a header."""
        return _LINE_OF_TABLE.match(self.text, line) is not None

    def quotes(self, at: int, column: int) -> tuple[int, int, int]:
        """See `Scan`; three quotes hold lines, one ends with its line."""
        quote = self.text[at]
        if self.text.startswith(quote * 3, at):
            close = self.text.find(quote * 3, at + 3)
            end = self.line_end(at) if close < 0 else close
            return at + 3, end, end if close < 0 else end + 3
        return Scan.quotes(self, at, column)

    def quote_goes_on(self, line: int, column: int) -> bool:
        """See `Scan`."""
        return False

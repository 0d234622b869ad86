"""YAML that may not parse: blocks by their columns, and whatever can be told of the rest."""

from __future__ import annotations

import re
from dataclasses import dataclass

from thingc.base.source import Path
from thingc.tools.lsp.scan import CursorPlace, Scan, Token

_KEY = re.compile(
    r"""(?:"(?P<double>(?:[^"\\\r\n]|\\[^\r\n])*)"|'(?P<single>(?:[^'\r\n]|'')*)'|(?P<plain>(?=:)|[^\s:#{}\[\],&!|>'"%@`-][^\r\n]*?|-[^\s][^\r\n]*?))"""
    r"""(?P<spaces>[ \t]*):(?=[ \t\r\n]|$)""",
)
_COMMENTED = re.compile(r"[ \t]#")
_TEXT_BLOCK = re.compile(r"[|>][-+0-9]*[ \t]*(?:#[^\r\n]*)?$")
_PROPERTY = re.compile(r"[&!][^\s,{}\[\]]*")
_LINE_OF_BLOCK = re.compile(
    r"""([ ]*)(?:-[ \t\r\n]|[^\s#{}\[\],"'][^\s#{}\[\],"']*[ ]*:(?:[ \t\r\n]|$)|["'][^"'\r\n]*["']:(?:[ \t\r\n]|$))""",
)
_PLAIN_IN_FLOW = re.compile(r"(?:[^,{}\[\]\r\n:# \t]|:(?![ \t])|[ \t]+(?!#)|(?<![ \t])#)*")
_PLAIN_KEY_IN_FLOW = re.compile(r"(?:[^,{}\[\]\r\n:# \t]|:(?![\s,{}\[\]]|$)|[ \t]+(?![#:])|(?<![ \t])#)*")


@dataclass(slots=True)
class _Frame:
    """A block mapping or list that is not over yet: the column of its keys or dashes, its path, and its last key or index.

    `state` of the last entry: `open` (nothing yet), `scalar` (a plain value, which may go on), `done`.
    """

    column: int
    path: Path
    sequence: bool
    last: str | int | None = None
    state: str = "done"

    def inner(self) -> Path:
        """The path of the last entry's value."""
        return self.path if self.last is None else (*self.path, self.last)


class YamlScan(Scan):
    """One reading of a YAML text, see `Scan`."""

    def run(self) -> None:
        """Read all of it."""
        self.stack = [_Frame(0, (), False)]
        at = 0
        while at <= len(self.text):
            at = self._line(at)

    # --- blocks -------------------------------------------------------------------------------------------------------

    def _line(self, at: int) -> int:
        end = self.line_end(at)
        here = self.spaces(at)
        if here >= end or self.text[here] == "#":
            if at <= self.target <= here:
                self._blank(self.target - at)
            if here < end:
                self.mute(here, end)
            return self.after_break(end)
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
        """The cursor stands on an empty line, or before its text."""
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
            self.gap(before, here, CursorPlace(role="key", path=top.inner(), start=here, end=here, either=True))
            if here >= end or self.text[here] == "#":
                self.mute(here, end)
                return self.after_break(end)
            column = here - line
        top = self.stack[-1]
        key = _KEY.match(self.text, here, end)
        if key is not None and (key["plain"] is None or _COMMENTED.search(key["plain"]) is None):
            if top.sequence or top.column < column:
                path, top.state = top.inner(), "done"
                top = _Frame(column, path, False)
                self.stack.append(top)
            kind = "plain" if key["plain"] is not None else "double" if key["double"] is not None else "single"
            name = key[kind]
            quote = {"plain": "", "double": '"', "single": "'"}[kind]
            token = Token(name=name, start=key.start(kind), end=key.end(kind), quote=quote)
            path = self.segments([token], top.path, key.end() - 1, True)
            top.last = name
            return self._value(key.end(), end, path, top)
        if top.column == column and not top.sequence and self.text[here] not in "{[":
            return self._word(here, end, CursorPlace(role="key", path=top.path, start=here, end=here))
        if top.state == "open" and self.text[here] not in "{[\"'&!*|>=":
            self.scalars[top.inner()] = self._written(here, end)
            after = self._word(here, end, CursorPlace(role="key", path=top.inner(), start=here, end=here, either=True))
            top.state = "scalar"
            return after
        if top.state == "done" and top.last is not None and not top.sequence:
            return self._word(here, end, CursorPlace(role="key", path=top.path, start=here, end=here))
        return self._value(here, end, top.inner(), top)

    def _written(self, here: int, end: int) -> str:
        comment = _COMMENTED.search(self.text, here, end)
        return self.text[here : end if comment is None else comment.start()].rstrip(" \t")

    def _word(self, here: int, end: int, place: CursorPlace) -> int:
        """A line, from `here` on, that is no entry of a mapping yet."""
        quote = self.text[here] if self.text[here] in "\"'" else ""
        place.start, place.quote = here + len(quote), quote
        written = self._written(here, end)
        place.end = max(place.start, here + len(written))
        comment = self.text.find("#", here + len(written), end)
        self.token(place, end if comment < 0 else comment)
        if comment >= 0:
            self.mute(comment, end)
        return self.after_break(end)

    def _value(self, at: int, end: int, path: Path, frame: _Frame) -> int:
        here = self.spaces(at)
        while here < end and self.text[here] in "&!":
            match = _PROPERTY.match(self.text, here)
            here = self.spaces(here + 1 if match is None else match.end())
        self.gap(at, here, CursorPlace(role="value", path=path, start=here, end=here))
        if here >= end or (self.text[here] == "#" and here > at):
            frame.state = "open"
            if here < end:
                self.mute(here, end)
            return self.after_break(end)
        character = self.text[here]
        if character in "|>" and _TEXT_BLOCK.match(self.text, here, end):
            return self._text_block(end, frame)
        if character in "{[":
            frame.state = "done"
            after = self.brackets(here, path, frame.column)
        elif character in "\"'":
            frame.state = "done"
            after = self.quoted(here, path, frame.column)
        else:
            written = self._written(here, end)
            joined = frame.state == "scalar" and path in self.scalars
            self.scalars[path] = f"{self.scalars[path]} {written}" if joined else written
            frame.state = "scalar"
            after = here + len(written)
            comment = _COMMENTED.search(self.text, after, end)
            self.token(CursorPlace(role="value", path=path, start=here, end=after), end if comment is None else comment.start() + 1)
        if self.left is not None:
            line, self.left = self.left, None
            return line
        end = self.line_end(after)
        comment_at = self.text.find("#", after, end)
        if comment_at >= 0:
            self.mute(comment_at, end)
        return self.after_break(end)

    def _text_block(self, end: int, frame: _Frame) -> int:
        """The lines of a text after `|` or `>`: those that are indented further than its key, and empty ones."""
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
        """See `Scan`."""
        if self.text[at] in "\"'":
            start, end, after = self.quotes(at, 0)
            return [Token(name=self.text[start:end], start=start, end=end, quote=self.text[at])], after
        match = _PLAIN_KEY_IN_FLOW.match(self.text, at)
        end = at if match is None else match.end()
        name = self.text[at:end].rstrip(" \t")
        return [Token(name=name, start=at, end=at + len(name))], end

    def plain_end(self, at: int) -> int:
        """See `Scan`."""
        match = _PLAIN_IN_FLOW.match(self.text, at)
        return at if match is None else match.end()

    def ends_flow(self, line: int, column: int) -> bool:
        """See `Scan`: a line that is no further indented than the key, and begins an entry of a block."""
        match = _LINE_OF_BLOCK.match(self.text, line)
        return match is not None and len(match.group(1)) <= column

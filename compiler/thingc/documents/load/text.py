"""Decode files, and convert positions to spans."""

from __future__ import annotations

import re
from bisect import bisect_right

from thingc.base.diagnostics import Code, Report
from thingc.base.source import Span, line_of

MAX_BYTES = 10_000_000
MAX_ALL_BYTES = 40_000_000
"""Maximum total size [bytes] of a document and all documents that it references."""
MAX_LEVELS = 100
MAX_ALIAS_NODES = 10_000
MAX_NODES = 300_000
"""Maximum number of values in a document. Without this limit, ten megabytes of `{}` would need a gigabyte of memory."""
MAX_FAULTS = 200
"""Maximum number of errors reported per document. A malformed file of ten megabytes can contain a million errors."""

_BREAK = re.compile(r"\r\n|\r|\n")
_FORBIDDEN_ASCII = "[^\t\n\r\x20-\x7e]"
_FORBIDDEN = "[^\t\n\r\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]"
"""Regular expression of the characters that documents must not contain.

Forbidden characters are control characters (unsafe in terminals), NEL, line and paragraph separators (which editors and parsers count
differently), surrogates, and a byte order mark that is not at the start. The expression is compiled when it is first needed, because
compilation takes as long as reading a short document.
"""

_CHARACTER_NAMES = {
    "\ufeff": "a byte order mark", "\u2028": "a line separator", "\u2029": "a paragraph separator",
    "\x85": "a next-line character", "\x00": "a zero byte",
}


class Source:
    """The text of a file without its byte order mark, with the start index of each line."""

    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self.text = text
        self.starts = [0, *(match.end() for match in _BREAK.finditer(text))]

    def span(self, start: int, end: int) -> Span:
        """Convert a range of indices into `text`, from `start` to `end` (exclusive), to a span with line and column numbers."""
        line = bisect_right(self.starts, start)
        on_one = end <= start or line == len(self.starts) or end < self.starts[line]
        last = line if on_one else bisect_right(self.starts, end)
        return Span(
            file=self.file, line=line, column=start - self.starts[line - 1] + 1,
            end_line=last, end_column=max(end, start) - self.starts[last - 1] + 1,
        )

    def range(self, span: Span) -> tuple[int, int]:
        """Convert a span to a range of indices into `text`, with an exclusive end."""
        return self.starts[span.line - 1] + span.column - 1, self.starts[span.end_line - 1] + span.end_column - 1

    def line_at(self, index: int) -> int:
        """Return the index of the line (from 0) that contains the character at `index`."""
        return bisect_right(self.starts, index) - 1

    def line(self, number: int) -> str:
        """Return the text of a line (from 0), without its line break."""
        end = self.starts[number + 1] if number + 1 < len(self.starts) else len(self.text)
        return self.text[self.starts[number] : end].rstrip("\r\n")


def narrow_span(span: Span, line: str, text: str, start: int, end: int) -> Span | None:
    """Return the span of the characters from `start` to `end` (exclusive) in the string `text` at `span`, which is on one line.

    `line` is the text of the line. Return None if the string contains escapes, so that the span cannot be determined.
    """
    begin = line[span.column - 1 : span.end_column - 1].find(text)
    if begin < 0:
        return None
    column = span.column + begin
    return Span(file=span.file, line=span.line, column=column + start, end_line=span.line, end_column=column + end)


def decode(file: str, data: bytes, report: Report) -> Source | None:
    """Decode the bytes of a file as UTF-8.

    A byte order mark and CRLF line ends are accepted. If the file is invalid, report the error and return None.
    """
    top = line_of(file)
    if len(data) > MAX_BYTES:
        report.add(Code.TOO_LARGE, f"the file has more than {MAX_BYTES} bytes", top, help="split the document")
        return None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        report.add(Code.NOT_UTF8, "expected UTF-8, found UTF-16", top, help="save the file as UTF-8")
        return None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = Source(file, data[: error.start].decode("utf-8-sig", errors="replace"))
        end = len(before.text)
        report.add(
            Code.NOT_UTF8, f"expected UTF-8, found the byte 0x{data[error.start]:02x}", before.span(end, end),
            help="save the file as UTF-8",
        )
        return None
    source = Source(file, text)
    forbidden = find_forbidden(text)
    if forbidden is not None:
        index, message = forbidden
        report.add(Code.SYNTAX, message, source.span(index, index + 1), help="delete the invisible character")
        return None
    return source


def find_forbidden(text: str) -> tuple[int, str] | None:
    """Find the first character that is not allowed in documents.

    Return its index and a description, or None if there is no such character.
    """
    match = re.search(_FORBIDDEN_ASCII if text.isascii() else _FORBIDDEN, text)
    if match is None:
        return None
    character = match.group()
    name = _CHARACTER_NAMES.get(character, "half of a surrogate pair" if "\ud800" <= character <= "\udfff" else "a control character")
    return match.start(), f"{name} (U+{ord(character):04X}) is not allowed in a document"

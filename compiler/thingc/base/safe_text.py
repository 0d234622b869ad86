"""Escape untrusted text, such as names and values from documents, before it is printed or written into tables, pictures and HTML pages.

Documents, output of parts, lock files, file names, environment variables and the command line can contain any characters. Examples are
escape sequences of terminals, bidirectional control characters, invisible characters, line breaks, and names of a million characters. All
text that thingc prints passes through one of the functions of this module.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from json.encoder import encode_basestring_ascii

from thingc.base.numeric import Recorded, formatter

LONGEST_QUOTE = 160
"""Maximum number of characters of a quotation in a message."""
LONGEST = 4000
"""Maximum number of characters of a message, or of a cell of a table."""

_QUOTE = re.compile(f"`([^`]{{{LONGEST_QUOTE + 1},}})`")
_UNSEEN = frozenset(map(chr, (
    0x34F, 0x115F, 0x1160, 0x17B4, 0x17B5, *range(0x180B, 0x1810), 0x3164, *range(0xFE00, 0xFE10), 0xFFA0, *range(0xE0100, 0xE01F0),
)))
"""Characters that Unicode ignores by default (`Default_Ignorable_Code_Point`) and Python considers printable."""


def escape_control(text: str, *, limit: int = LONGEST) -> str:
    """Return `text` in one line. Control characters and invisible characters are replaced by Python escapes such as `\\x1b` or `\\n`.

    Lone surrogates (`\\ud800`), such as undecodable bytes of file names, are also escaped. Printable characters of any script are
    unchanged. Strings with more than `limit` characters are abbreviated in the middle.
    """
    text = _cut(text, limit)
    return text if _is_printable(text) else "".join(map(_escape, text))


def html_text(text: str) -> str:
    """Escape text for HTML and SVG, including control characters and invisible characters."""
    from html import escape

    return escape(escape_control(text))


def shown_line(line: str) -> str:
    """Escape the control characters and invisible characters of a source line for display.

    Tabs remain, and long lines are not abbreviated.
    """
    return "\t".join(escape_control(piece, limit=len(piece)) for piece in line.split("\t"))


def abbreviate(message: str) -> str:
    """Abbreviate a message if it is too long: first its long quotations between backquotes, and then the whole message.

    Characters in the middle of a quotation or message are omitted.
    """
    if len(message) <= LONGEST_QUOTE:
        return message
    return _cut(_QUOTE.sub(lambda quote: f"`{_cut(quote[1], LONGEST_QUOTE)}`", message), LONGEST)


def some(texts: Sequence[str], limit: int, *, separator: str = ", ") -> str:
    """Join the first `limit` strings of a list, and append the number of the remaining strings: `a, b and 3 more`."""
    first = separator.join(texts[:limit])
    return f"{first} and {len(texts) - limit} more" if len(texts) > limit else first


def quote_names(names: Sequence[str], limit: int) -> str:
    """Put the first `limit` names in backquotes and join them, and append the number of the remaining names."""
    return some([f"`{name}`" for name in names], limit)


def find_invisible(name: str) -> str:
    """Return the invisible characters in a name. Names with such characters are rejected, because they cannot be displayed.

    Invisible characters are control characters, line ends, bidirectional marks, zero-width characters, and undecodable bytes of file names.
    """
    if _is_printable(name):
        return ""
    from unicodedata import category

    return "".join(character for character in name if not _is_printable(character) and category(character) != "Zs")


def is_text(name: str) -> bool:
    """Return whether a name is valid Unicode text. Names with lone surrogates, such as undecodable bytes of a file name, are not valid."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def json_text(text: str) -> str:
    """Escape control characters and invisible characters in JSON text, so that the text can be printed safely.

    The characters are replaced by JSON escapes such as `\\u202e`. A JSON parser therefore returns the same values as for the original text.
    """
    if _is_printable(text.replace("\n", "")):
        return text
    return "\n".join(line if _is_printable(line) else "".join(map(_json_escaped, line)) for line in text.split("\n"))


def _is_printable(text: str) -> bool:
    return text.isprintable() and (text.isascii() or _UNSEEN.isdisjoint(text))


def _escape(character: str) -> str:
    if _is_printable(character):
        return character
    return character.encode("unicode_escape").decode("ascii")


def _json_escaped(character: str) -> str:
    return character if _is_printable(character) else encode_basestring_ascii(character)[1:-1]


def _cut(text: str, limit: int) -> str:
    """Replace the middle of a string by its length if it has more than `limit` characters: `abc... (5000 characters) ...xyz`."""
    if len(text) <= limit:
        return text
    tail = limit // 4
    return f"{text[: limit - tail]}... ({len(text)} characters) ...{text[len(text) - tail :]}"


_ESCAPED = {ord("<"): "\\u003c", ord(">"): "\\u003e", ord("&"): "\\u0026"}
"""JSON escapes of characters that could end a `<script>`."""


def pieces(frame: str) -> list[str]:
    """Split a template at its placeholders, such as `@TITLE@`, and return the pieces, including the placeholders.

    The template is split before values are inserted, so a value that looks like a placeholder is not replaced.
    """
    return re.split("(@[A-Z]+@)", frame)


def in_script(value: object) -> str:
    """Serialize a value as JSON that is safe inside a `<script>` element. Raises `ValueError` for NaN and infinite numbers."""
    return json_text(json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)).translate(_ESCAPED)


_FORMULA = re.compile(r"\s*[=+\-@\uff0b\uff0d\uff1d\uff20]")
"""Start of a cell that a spreadsheet interprets as a formula, including full-width characters (OWASP, "CSV Injection")."""
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|[+-]?inf")


def format_cell(value: object) -> str:
    """Format a value as a cell of a CSV file: numbers with all digits, booleans as `true` and `false`, and None as an empty cell.

    Text is escaped to a single line (see `escape_control`). Text that a spreadsheet would evaluate as a formula is prefixed with `'`,
    unless it is a number.
    """
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float | Recorded):
        return _number(value)
    text = escape_control(str(value))
    return f"'{text}" if _FORMULA.match(text) and not _NUMBER.fullmatch(text) else text


@formatter("csv")
def _number(value: float) -> str:
    return repr(value)

"""How text that somebody else wrote is shown: names, file names and values in messages, tables, cells of CSV, pictures and
scripts of pages.

A document may hold anything, and so may whatever a part says, a lock, a file name, the environment or the command line: escape
sequences that a terminal obeys, marks that turn the direction of the text after them, characters that are not seen at all, line
ends that begin a line of their own choice, a name of a million characters. Everything that is printed goes through one of the
functions here.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from json.encoder import encode_basestring_ascii

from thingc.base.numeric import Recorded, formatter

LONGEST_QUOTE = 160
"""Characters of one quotation in a message."""
LONGEST = 4000
"""Characters of a whole message, or of one cell of a table."""

_QUOTE = re.compile(f"`([^`]{{{LONGEST_QUOTE + 1},}})`")
_UNSEEN = re.compile("[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef]")
"""What Unicode calls ignorable by default (`Default_Ignorable_Code_Point`) among what Python calls printable."""


def escape_control(text: str, *, most: int = LONGEST) -> str:
    """`text` on one line, for people: what a reader could not see, or a terminal would obey, is written as Python would escape it.

    `\\x1b`, `\\n`, `\\u202e`, `\\ud800` (half a character, or a byte of a file name that is no text). Printable characters of any script
    stay. Of more than `most` characters the beginning and the end are left.
    """
    text = _cut(text, most)
    return text if _is_printable(text) else "".join(map(_escaped, text))


def shown_line(line: str) -> str:
    """A line of a document or a part file as `escape_control` has it, however long, but for tabs, which indent."""
    return "\t".join(escape_control(piece, most=len(piece)) for piece in line.split("\t"))


def shortened(message: str) -> str:
    """A message without what nobody reads: of long quotations between backquotes, and of the whole, the beginning and the end."""
    if len(message) <= LONGEST_QUOTE:
        return message
    return _cut(_QUOTE.sub(lambda quote: f"`{_cut(quote[1], LONGEST_QUOTE)}`", message), LONGEST)


def some(words: Sequence[str], most: int, *, between: str = ", ") -> str:
    """The first ones, and how many there are besides: `a, b and 3 more`."""
    first = between.join(words[:most])
    return f"{first} and {len(words) - most} more" if len(words) > most else first


def quoted(names: Sequence[str], most: int) -> str:
    """`some` names in backquotes."""
    return some([f"`{name}`" for name in names], most)


def unseen(name: str) -> str:
    """Those characters of a name that are no letters, signs or spaces: controls, line ends, marks of direction, what has no width,
    and bytes of a file name that are no UTF-8. A name that has any cannot be told in words, or kept on a line."""
    if _is_printable(name):
        return ""
    from unicodedata import category

    return "".join(character for character in name if not _is_printable(character) and category(character) != "Zs")


def is_text(name: str) -> bool:
    """Whether all of a name is Unicode text: no byte of a file name that is no UTF-8, no half of a character."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def json_text(text: str) -> str:
    """JSON with the same values, in which what `escape_control` escapes is escaped as JSON does: no information is lost."""
    if _is_printable(text.replace("\n", "")):
        return text
    return "\n".join(line if _is_printable(line) else "".join(map(_json_escaped, line)) for line in text.split("\n"))


def _is_printable(text: str) -> bool:
    return text.isprintable() and (text.isascii() or _UNSEEN.search(text) is None)


def _escaped(character: str) -> str:
    if _is_printable(character):
        return character
    return character.encode("unicode_escape").decode("ascii")


def _json_escaped(character: str) -> str:
    return character if _is_printable(character) else encode_basestring_ascii(character)[1:-1]


def _cut(text: str, most: int) -> str:
    """At most about `most` characters of a text: its beginning, how long it is, and its end."""
    if len(text) <= most:
        return text
    tail = most // 4
    return f"{text[: most - tail]}... ({len(text)} characters) ...{text[len(text) - tail :]}"


_ESCAPED = {ord("<"): "\\u003c", ord(">"): "\\u003e", ord("&"): "\\u0026"}
"""What could end a `<script>`, as JSON writes it instead."""


def pieces(frame: str) -> list[str]:
    """A frame cut at its places (`@TITLE@`), which are pieces, too. It is cut before anything is put in: a name may hold the word for a
    place."""
    return re.split("(@[A-Z]+@)", frame)


def in_script(value: object) -> str:
    """JSON that can stand in a `<script>` whatever names and messages say. Raises ValueError for a number that is not finite."""
    return json_text(json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)).translate(_ESCAPED)


_FORMULA = re.compile(r"\s*[=+\-@\uff0b\uff0d\uff1d\uff20]")
"""How a cell begins that a spreadsheet computes, also in the wide forms of East Asian input (OWASP, "CSV Injection")."""
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|[+-]?inf")


def format_cell(value: object) -> str:
    """A value as CSV has it: numbers with all of their digits, flags as `true` and `false`, None as nothing.

    Text is on one line, with what nobody sees written out (see `escape_control`); where a spreadsheet would take it for a formula and it is
    no number, a `'` stands before it, which spreadsheets show as text.
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

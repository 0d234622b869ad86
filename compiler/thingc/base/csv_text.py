"""Cells of the tables that are written as CSV: read by spreadsheets, which take some texts for programs."""

from __future__ import annotations

import re

from thingc.base.numeric import Recorded, formatter
from thingc.base.safe_text import escape_control

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

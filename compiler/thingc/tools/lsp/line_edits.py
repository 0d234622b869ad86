"""From one text to another in edits of lines, so that the cursor and what did not change stay where they are."""

from __future__ import annotations

import difflib
from typing import Any

from thingc.base.diagnostics import Report
from thingc.documents.format.formatting import format_document
from thingc.tools.lsp.analysis import Analysis
from thingc.tools.lsp.positions import TextLines, TextPlace

MOST_LINES = 3000
"""Lines between the first and the last that differ that are compared one by one; of more there is one edit."""


def edits(before: TextLines, after: str) -> list[dict[str, Any]]:
    """The protocol's edits that make one text of another; none where they are equal."""
    old, new = _split(before), _split(TextLines(after))
    top = 0
    while top < min(len(old), len(new)) and old[top] == new[top]:
        top += 1
    end = 0
    while end < min(len(old), len(new)) - top and old[-1 - end] == new[-1 - end]:
        end += 1
    old_middle, new_middle = old[top : len(old) - end], new[top : len(new) - end]
    if not (old_middle or new_middle):
        return []
    spans = [(0, len(old_middle), 0, len(new_middle))]
    if len(old_middle) + len(new_middle) <= MOST_LINES:
        compared = difflib.SequenceMatcher(None, old_middle, new_middle, autojunk=False)
        spans = [(i1, i2, j1, j2) for kind, i1, i2, j1, j2 in compared.get_opcodes() if kind != "equal"]
    return [
        {"range": before.range_of(_start(before, top + i1), _start(before, top + i2)), "newText": "".join(new_middle[j1:j2])}
        for i1, i2, j1, j2 in spans
    ]


def _split(lines: TextLines) -> list[str]:
    ends = [*lines.starts[1:], len(lines.text)]
    return [lines.text[start:end] for start, end in zip(lines.starts, ends)]


def _start(lines: TextLines, number: int) -> int:
    """Where a line (from 0) begins; behind the last one the end of the text."""
    return lines.starts[number] if number < len(lines.starts) else len(lines.text)


def formatted(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """The edits that bring a document into canonical layout; None where it is not well-formed, or none of ours."""
    after = format_document(analysis.path, text.encode(errors="surrogatepass"), Report()) if analysis.documents is not None else None
    return None if after is None else edits(analysis.lines(), after.decode())

"""Format diagnostics for the terminal, with the source lines that they refer to, and as JSON for `--format json`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from thingc.base.diagnostics import Diagnostic, Severity, shown_path
from thingc.base.one_line_repr import format_count
from thingc.base.safe_text import escape_control, shown_line
from thingc.base.source import SET, Span

OPTIONS = ("-p ", SET, "set ")
"""Prefixes of the `path` of diagnostics about values from the command line."""


def as_json(diagnostics: Sequence[Diagnostic]) -> list[dict[str, object]]:
    """Convert each diagnostic to a dictionary that can be serialized as JSON, as for `--format json`.

    The documentation in `docs/` describes the keys.
    """

    def place(span: Span | None) -> dict[str, object]:
        if span is None:
            return {"file": None, "line": None, "column": None}
        return {"file": shown_path(span.file), "line": span.line, "column": span.column}

    return [{
        "code": d.code.code, "severity": d.severity.value, "message": d.message, **place(d.span), "path": d.path, "help": d.advice,
        "notes": [{"message": note.message, **place(note.span)} for note in d.notes],
        "fixes": [{
            **place(edit.span), "end_line": edit.span.end_line, "end_column": edit.span.end_column, "written": edit.written,
            "replacement": edit.replacement,
        } for edit in d.fixes],
    } for d in diagnostics]


def as_text(diagnostics: Sequence[Diagnostic], *, color: bool = False, debug: bool = False, texts: Mapping[str, str] | None = None) -> str:
    """Format diagnostics as text for a terminal. Each diagnostic shows its location, the source line with carets, its notes and its help.

    Source lines are read from files. `texts` maps file names to contents for documents that do not exist as files.
    """
    lines: list[str] = []
    sources = {file: re.split("\r\n|\r|\n", text) for file, text in (texts or {}).items()}
    for d in diagnostics:
        tint = {"error": "1;31", "warning": "1;33", "note": "1;36"}[d.severity.value]
        head = _paint(f"{d.severity.value}[{d.code.code}]", tint, color)
        lines.append(f"{head}: {_paint(escape_control(d.message), '1', color)}")
        if d.span is not None:
            lines.extend(_frame(d.span, sources, tint, color))
        elif d.path is not None and d.path.startswith(OPTIONS):
            lines.append(f"   --> {escape_control(d.path)}")
        for n in d.notes:
            lines.append(f"  {_paint('note', '1;36', color)}: {escape_control(n.message)}")
            if n.span is not None:
                lines.extend(_frame(n.span, sources, "1;36", color))
        if d.advice:
            lines.append(f"  {_paint('help', '1;32', color)}: {escape_control(d.advice)}")
        if debug and d.detail:
            lines.extend("  | " + escape_control(text) for text in d.detail.rstrip().split("\n"))
        lines.append("")
    return "\n".join(lines)


def summary(diagnostics: Sequence[Diagnostic]) -> str:
    """Return the number of errors and warnings, such as `2 errors, 1 warning`.

    Return an empty string if there are no errors and no warnings.
    """
    parts: list[str] = []
    for severity in (Severity.ERROR, Severity.WARNING):
        count = sum(1 for d in diagnostics if d.severity is severity)
        if count:
            parts.append(format_count(count, severity.value))
    return ", ".join(parts)


def _paint(text: str, style: str, color: bool) -> str:
    return f"\x1b[{style}m{text}\x1b[0m" if color else text


def _frame(span: Span, sources: dict[str, list[str]], tint: str, color: bool) -> list[str]:
    if span.file not in sources:
        try:
            with open(span.file, encoding="utf-8-sig", errors="replace", newline=None) as stream:
                sources[span.file] = stream.read(10_000_001).split("\n")
        except (OSError, ValueError):  # an invalid file name raises a ValueError
            sources[span.file] = []
    place = f"{escape_control(shown_path(span.file))}:{span.line}:{span.column}"
    text = sources[span.file][span.line - 1] if span.line <= len(sources[span.file]) else ""
    first, last = span.column, span.end_column if span.end_line == span.line else len(text) + 1
    if first == last == 1 and text.startswith(" "):  # the span covers a whole line of a part file
        first, last = len(text) - len(text.lstrip()) + 1, len(text.rstrip()) + 1
    offset = max(0, first - 60) if len(text) > 120 else 0
    start, end = first - 1, max(first, last) - 1
    before, marked, after = (shown_line(text[a:b]) for a, b in ((offset, start), (start, min(end, offset + 120)), (end, offset + 120)))
    pad = "".join("\t" if character == "\t" else " " for character in before)
    gutter = " " * len(str(span.line))
    return [
        f"  {gutter}--> {place}",
        f"  {span.line} | {before}{marked}{after}",
        f"  {gutter} | {pad}{_paint('^' * max(1, len(marked)), tint, color)}",
    ]

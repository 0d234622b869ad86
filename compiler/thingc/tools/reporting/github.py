"""Workflow commands of GitHub Actions: each diagnostic becomes an annotation on its line of a pull request.

The format is that of "Workflow commands for GitHub Actions" (`::error file=...,line=...::message`), with the escapes of
its toolkit: `%`, CR and LF in messages, `:` and `,` in properties too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from thingc.base.diagnostics import Diagnostic, Note, Severity
from thingc.base.safe_text import escape_control
from thingc.base.source import Span
from thingc.tools.reporting.repository_paths import within

_COMMANDS: Mapping[Severity, str] = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.NOTE: "notice"}


def as_github(diagnostics: Sequence[Diagnostic], *, base: str) -> str:
    """One line for each diagnostic, files relative to the repository's folder `base`; an empty text for none."""
    return "".join(_command(d, base) + "\n" for d in diagnostics)


def _command(d: Diagnostic, base: str) -> str:
    properties = {} if d.span is None else _annotation_location(d.span, base)
    properties["title"] = d.code.code
    written = ",".join(f"{key}={_property(value)}" for key, value in properties.items())
    return f"::{_COMMANDS[d.severity]} {written}::{_data(_annotation_text(d, base))}"


def _annotation_location(span: Span, base: str) -> dict[str, str]:
    place = {"file": escape_control(within(span.file, base) or span.file), "line": str(span.line)}
    if span.line == span.end_line and span.column != span.end_column:
        place["col"] = str(span.column)
    place["endLine"] = str(span.end_line)
    if "col" in place:  # never on several lines: GitHub drops such annotations
        place["endColumn"] = str(span.end_column)
    return place


def _annotation_text(d: Diagnostic, base: str) -> str:
    """The message, the second places and the help, a line each: an annotation has one place only. Whatever they quote stays on
    its line."""
    lines = [escape_control(d.message), *(f"note: {_note(note, base)}" for note in d.notes)]
    if d.help:
        lines.append(f"help: {escape_control(d.help)}")
    return "\n".join(lines)


def _note(note: Note, base: str) -> str:
    if note.span is None:
        return escape_control(note.message)
    file = within(note.span.file, base) or note.span.file
    return escape_control(f"{note.message} ({file}:{note.span.line}:{note.span.column})")


def _data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")

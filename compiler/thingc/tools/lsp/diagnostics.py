"""Findings as the protocol has them, each in the file that it is about."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from thingc.base.diagnostics import Diagnostic, Severity
from thingc.base.source import Span
from thingc.tools.lsp.analysis import Analysis

_SEVERITY: Mapping[Severity, int] = {Severity.ERROR: 1, Severity.WARNING: 2, Severity.NOTE: 3}
_TOP = {"start": {"line": 0, "character": 0}, "end": {"line": 0, "character": 0}}


def by_file(analysis: Analysis) -> dict[str, list[dict[str, Any]]]:
    """What an analysis found, as the protocol has it, by absolute path of the file that it is about; of what has no place in a file that is
    there (a lock that is missing), the analysed document. That one is there also where nothing was found."""
    said: dict[str, list[dict[str, Any]]] = analysis.once("said", lambda: _by_file(analysis))
    return said


def _by_file(analysis: Analysis) -> dict[str, list[dict[str, Any]]]:
    said: dict[str, list[dict[str, Any]]] = {analysis.path: []}
    for one in analysis.findings:
        span = one.span if one.span is not None and (one.span.file in analysis.open or os.path.isfile(one.span.file)) else None
        said.setdefault(analysis.path if span is None else span.file, []).append(as_protocol(one, span, analysis))
    return said


def as_protocol(diagnostic: Diagnostic, span: Span | None, analysis: Analysis) -> dict[str, Any]:
    """One finding at a place (None: at the top): what to type next stands in a line of its own, second places are related information."""
    loose = [note.message for note in diagnostic.notes if note.span is None]
    words = [diagnostic.message, *([] if diagnostic.help is None else [diagnostic.help]), *loose]
    shown: dict[str, Any] = {
        "range": _TOP if span is None else analysis.lines(span.file).range(span),
        "severity": _SEVERITY[diagnostic.severity], "code": diagnostic.code.code, "source": "thingc", "message": "\n".join(words),
    }
    related = [
        {
            "location": {"uri": analysis.uri(note.span.file), "range": analysis.lines(note.span.file).range(note.span)},
            "message": note.message,
        }
        for note in diagnostic.notes if note.span is not None
    ]
    if related:
        shown["relatedInformation"] = related
    return shown

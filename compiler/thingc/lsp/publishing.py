"""Findings as the protocol has them, each in the file that it is about."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from thingc.diagnostics import Diagnostic, Severity
from thingc.lsp.analysis import Analysis

_SEVERITY = {Severity.ERROR: 1, Severity.WARNING: 2, Severity.NOTE: 3}
_TOP = {"start": {"line": 0, "character": 0}, "end": {"line": 0, "character": 0}}


def diagnostics_by_file(analyses: Iterable[Analysis]) -> dict[str, list[dict[str, Any]]]:
    """The protocol's diagnostics of what all these analyses found, each once, by absolute path of the file that they are about; of what
    has no place, the analysed document. The documents themselves are there also where nothing was found."""
    said: dict[str, list[dict[str, Any]]] = {}
    for analysis in analyses:
        said.setdefault(analysis.path, [])
        for one in analysis.findings:
            file = analysis.path if one.span is None else one.span.file
            shown = as_protocol(one, analysis)
            of_file = said.setdefault(file, [])
            if shown not in of_file:
                of_file.append(shown)
    return said


def as_protocol(found: Diagnostic, analysis: Analysis) -> dict[str, Any]:
    """One finding: what to type next stands in a line of its own, second places are related information."""
    words = found.message if found.help is None else f"{found.message}\n{found.help}"
    loose = [note.message for note in found.notes if note.span is None]
    shown: dict[str, Any] = {
        "range": _TOP if found.span is None else analysis.lines(found.span.file).range(found.span),
        "severity": _SEVERITY[found.severity], "code": found.code.code, "source": "thingc", "message": "\n".join([words, *loose]),
    }
    related = [
        {
            "location": {"uri": analysis.uri(note.span.file), "range": analysis.lines(note.span.file).range(note.span)},
            "message": note.message,
        }
        for note in found.notes if note.span is not None
    ]
    if related:
        shown["relatedInformation"] = related
    return shown

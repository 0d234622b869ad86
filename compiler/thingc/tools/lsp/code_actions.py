"""Convert diagnostics to the format of LSP, and compute edits: quick fixes as in `thingc check --fix`, missing components, and formatting.
"""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Iterator, Mapping
from typing import Any

from thingc.base.diagnostics import Code, Diagnostic, Report, Severity
from thingc.base.source import Span, entries_of
from thingc.documents.format.autofix import CheckResult, TextEdit, locate_edit, safe_edits
from thingc.documents.format.formatting import format_document
from thingc.documents.format.value_edits import CannotSetValue, set_values
from thingc.documents.load.text import Source
from thingc.tools.lsp.analysis import Analysis, is_document_path
from thingc.tools.lsp.positions import TextLines, TextPlace, equal_ends

MOST_LINES = 3000
"""Maximum number of changed lines for which separate edits are computed. For more lines, the result is one edit."""


def edits(before: TextLines, after: str) -> list[dict[str, Any]]:
    """Return the LSP text edits that change the text `before` to the text `after`. Return an empty list if the texts are equal."""
    old, new = before.with_breaks(), TextLines(after).with_breaks()
    top, end = equal_ends(old, new)
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


def _start(lines: TextLines, number: int) -> int:
    """Return the offset at which a line, numbered from 0, starts. For a line after the last line, return the length of the text."""
    return lines.starts[number] if number < len(lines.starts) else len(lines.text)


def format_text(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """Return the edits that format a document, or None if the text is not a well-formed document."""
    formatted = format_document(analysis.path, text.encode(errors="surrogatepass"), Report()) if analysis.documents is not None else None
    return None if formatted is None else edits(analysis.lines(), formatted.decode())


_SEVERITY: Mapping[Severity, int] = {Severity.ERROR: 1, Severity.WARNING: 2, Severity.NOTE: 3}
_TOP = {"start": {"line": 0, "character": 0}, "end": {"line": 0, "character": 0}}


def by_file(analysis: Analysis) -> dict[str, list[dict[str, Any]]]:
    """Convert diagnostics to the format of LSP, and group them by the absolute path of their file.

    If the file of a diagnostic does not exist, such as a missing lock file, the diagnostic is assigned to the document. The result always
    contains the path of the document.
    """
    return analysis.compute_once("diagnostics", lambda: _by_file(analysis))


def _by_file(analysis: Analysis) -> dict[str, list[dict[str, Any]]]:
    diagnostics_of: dict[str, list[dict[str, Any]]] = {analysis.path: []}
    for finding in analysis.findings:
        span = finding.span
        if span is not None and not (span.file in analysis.open or os.path.isfile(span.file)):
            span = None
        diagnostics_of.setdefault(analysis.path if span is None else span.file, []).append(as_protocol(finding, span, analysis))
    return diagnostics_of


def as_protocol(diagnostic: Diagnostic, span: Span | None, analysis: Analysis) -> dict[str, Any]:
    """Convert a diagnostic to the format of LSP. If `span` is None, the diagnostic is located at the beginning of the file.

    The help text is a separate line of the message. Notes with a source location become related information.
    """
    notes = [note.message for note in diagnostic.notes if note.span is None]
    lines = [diagnostic.message, *([] if diagnostic.advice is None else [diagnostic.advice]), *notes]
    related = [
        {
            "location": {"uri": analysis.uri(note.span.file), "range": analysis.lines(note.span.file).range(note.span)},
            "message": note.message,
        }
        for note in diagnostic.notes if note.span is not None
    ]
    return {
        "range": _TOP if span is None else analysis.lines(span.file).range(span),
        "severity": _SEVERITY[diagnostic.severity], "code": diagnostic.code.code, "source": "thingc", "message": "\n".join(lines),
        **({"relatedInformation": related} if related else {}),
    }


KIND = "quickfix"


def actions(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """Return the quick fixes for the diagnostics in a range of the text. The only possible fix for a diagnostic is marked as preferred."""
    kinds = params["context"].get("only")
    if kinds and not any(kind == KIND or KIND.startswith(f"{kind}.") or kind == "" for kind in kinds):
        return []
    start, end = (analysis.lines().place(params["range"][side]) for side in ("start", "end"))
    fitting = [
        one for one in analysis.findings
        if (span := one.span) is not None and span.file == analysis.path
        and (span.line, span.column) <= (end.line, end.column) and (start.line, start.column) <= (span.end_line, span.end_column)
    ]
    return [action for one in fitting for action in (*_fixes(one, analysis), *_missing_component(one, analysis))]


def _fixes(diagnostic: Diagnostic, analysis: Analysis) -> Iterator[dict[str, Any]]:
    for fix in diagnostic.fixes:
        file = fix.span.file
        edit_range = locate_edit(fix, analysis.text_of(file)) if is_document_path(file) else None
        if edit_range is not None:
            edit = {"range": analysis.lines(file).range_of(*edit_range), "newText": fix.replacement}
            is_safe = any((one.file, one.start, one.end) == (file, *edit_range) for one in _safe_fixes(diagnostic, analysis))
            yield _action(f"replace `{fix.written}` with `{fix.replacement}`", diagnostic, analysis, file, [edit], preferred=is_safe)


def _safe_fixes(diagnostic: Diagnostic, analysis: Analysis) -> list[TextEdit]:
    """Return the edits with which `thingc check --fix` would fix a diagnostic."""
    documents = () if analysis.documents is None else tuple(analysis.documents.by_path.values())
    return safe_edits(
        CheckResult(found=[diagnostic], documents=documents), {}, is_document_path,
        lambda file: analysis.text_of(file).encode(errors="surrogatepass"),
    )


def _missing_component(diagnostic: Diagnostic, analysis: Analysis) -> Iterator[dict[str, Any]]:
    """Yield a quick fix that adds a missing component to which the document refers.

    If a part class has this name, the component uses this part. Otherwise, the component is a frame with the mounts to which the document
    refers.
    """
    document = None if analysis.documents is None else analysis.documents.root
    if diagnostic.code is not Code.UNKNOWN_COMPONENT or diagnostic.span is None or document is None or document.text != analysis.text:
        return
    lines = analysis.lines()
    start, end = Source(document.path, document.text).range(diagnostic.span)
    name = re.match(r"[\"']?([A-Za-z]\w*)(?![\w*?\[])", document.text[start:end])
    if name is None or name[1] in entries_of(document.tree.entries.get("components")):
        return  # the missing name is in another document
    part = next((one for one in analysis.schemas if _as_name(one.partition(":")[2]) == re.sub(r"_?\d+$", "", name[1])), None)
    if part is not None:
        value: dict[str, Any] = {"part": part}
    else:
        mounts = dict.fromkeys(re.findall(rf"(?<![\w./]){name[1]}[./]([A-Za-z]\w*)(?![\w./])", lines.text))
        mounts.pop("origin", None)
        value = {"frame": "true", **({"mounts": {mount: {} for mount in mounts}} if mounts else {})}
    try:
        new = set_values(document, {("components", name[1]): value})
    except CannotSetValue:
        return
    kind = f"`{part}`" if part is not None else "a frame"
    yield _action(f"add the component `{name[1]}`, {kind}", diagnostic, analysis, analysis.path, edits(lines, new.text), preferred=False)


def _as_name(text: str) -> str:
    """Convert the name of a class to the name of a component in snake case: `RotorBrace` becomes `rotor_brace`."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", text).lower()


def _action(
    title: str, diagnostic: Diagnostic, analysis: Analysis, file: str, changes: list[dict[str, Any]], *, preferred: bool,
) -> dict[str, Any]:
    return {
        "title": title, "kind": KIND, "isPreferred": preferred, "diagnostics": [as_protocol(diagnostic, diagnostic.span, analysis)],
        "edit": {"changes": {analysis.uri(file): changes}},
    }

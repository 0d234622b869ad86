"""Format results for continuous integration: diagnostics as SARIF 2.1.0 (OASIS) or as GitHub Actions annotations, and tests as JUnit.

In SARIF, diagnostics with a source location become results. Diagnostics without a source location become notifications of the invocation,
because programs that read SARIF reject results without a location.

Annotations have the format of GitHub's "Workflow commands for GitHub Actions": `::error file=...,line=...::message`. As in GitHub's
toolkit, `%`, CR and LF are escaped in messages and properties. In properties, `:` and `,` are escaped, too. Each diagnostic becomes one
annotation.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote
from xml.etree import ElementTree

from thingc.base.diagnostic_output import as_text
from thingc.base.diagnostics import Code, Diagnostic, Note, Severity
from thingc.base.safe_text import escape_control, json_text
from thingc.base.source import Span
from thingc.driver.testing.outcomes import Result

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
ROOT = "%SRCROOT%"
"""SARIF name of the folder to which file paths are relative: the repository."""
FINGERPRINT = "documentPathAndMessage/v1"
_COMMANDS: Mapping[Severity, str] = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.NOTE: "notice"}
"""Workflow commands of GitHub Actions, by severity of the diagnostic."""


def repository(folder: str) -> str:
    """Return the absolute path of the git repository that contains `folder`.

    If there is no repository, return the path of `folder` itself.
    """
    start = Path(os.path.abspath(folder))
    return str(next((above for above in (start, *start.parents) if (above / ".git").exists()), start))


def within(file: str, base: str) -> str | None:
    """Return the path of a file relative to the folder `base`, with `/` as separator. Return None if the file is outside the folder."""
    try:
        relative = os.path.relpath(file, base)
    except ValueError:  # the file is on another drive
        return None
    words = relative.split(os.sep)
    return None if words[0] == os.pardir else "/".join(words)


def as_sarif(diagnostics: Sequence[Diagnostic], *, base: str, version: str, documentation: str | None = None) -> str:
    """Format diagnostics as a SARIF log that contains one run.

    File paths are relative to the folder `base`. `version` is the version of thingc. `documentation` is the URL of the folder with the
    pages about diagnostic codes, such as `TC302.md`, if known.
    """
    placed = [d for d in diagnostics if d.span is not None]
    homeless = [d for d in diagnostics if d.span is None]
    rules = sorted({d.code for d in placed}, key=lambda code: code.code)
    notices = sorted({d.code for d in homeless}, key=lambda code: code.code)
    driver: dict[str, Any] = {"name": "thingc", "version": version, "rules": [_descriptor(code, documentation) for code in rules]}
    invocation: dict[str, Any] = {"executionSuccessful": not any(d.severity is Severity.ERROR for d in homeless)}
    if notices:
        driver["notifications"] = [_descriptor(code, documentation) for code in notices]
        for d in sorted(homeless, key=lambda d: d.code is not Code.INTERNAL):
            kind = "toolExecutionNotifications" if d.code is Code.INTERNAL else "toolConfigurationNotifications"
            invocation.setdefault(kind, []).append(_notification(d, notices))
    run = {
        "tool": {"driver": driver},
        "invocations": [invocation],
        "originalUriBaseIds": {ROOT: {"description": {"text": "The repository, or the working folder if there is no repository."}}},
        "columnKind": "unicodeCodePoints",
        "results": _results(placed, rules, base),
    }
    return json_text(json.dumps({"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}, indent=2, ensure_ascii=False)) + "\n"


def _descriptor(code: Code, documentation: str | None) -> dict[str, Any]:
    """Convert a diagnostic code to a SARIF reporting descriptor."""
    descriptor: dict[str, Any] = {
        "id": code.code, "name": "".join(word.capitalize() for word in code.name.split("_")),
        "shortDescription": {"text": code.title[0].upper() + code.title[1:]},
        "fullDescription": {"text": code.cure},
        "help": {"text": f"{code.cure} `thingc explain {code.code}` shows an example."},
    }
    if documentation is not None:
        descriptor["helpUri"] = f"{documentation.rstrip('/')}/{code.code}.md"
    return descriptor


def _results(placed: Iterable[Diagnostic], rules: Sequence[Code], base: str) -> list[dict[str, Any]]:
    met: Counter[str] = Counter()
    results = []
    for d in placed:
        assert d.span is not None
        result: dict[str, Any] = {
            "ruleId": d.code.code, "ruleIndex": rules.index(d.code), "level": d.severity.value, "message": {"text": _message_text(d)},
            "locations": [{"physicalLocation": _physical(d.span, base)}],
        }
        related = [
            {"id": number, "message": {"text": escape_control(note.message)}, "physicalLocation": _physical(note.span, base)}
            for number, note in enumerate((note for note in d.notes if note.span is not None), 1)
            if note.span is not None
        ]
        if related:
            result["relatedLocations"] = related
        digest = _fingerprint(d, base)
        met[digest] += 1
        result["partialFingerprints"] = {FINGERPRINT: f"{digest}:{met[digest]}"}
        results.append(result)
    return results


def _message_text(d: Diagnostic, notes: Iterable[str] | None = None) -> str:
    """Return the message, the notes and the help of a diagnostic, one per line. Control characters are escaped.

    By default, the result contains only notes without a source location.
    """
    if notes is None:
        notes = (note.message for note in d.notes if note.span is None)
    lines = [d.message, *(f"note: {note}" for note in notes), *([f"help: {d.advice}"] if d.advice else [])]
    return "\n".join(map(escape_control, lines))


def _fingerprint(d: Diagnostic, base: str) -> str:
    """Return a hash that identifies the same diagnostic in several runs of thingc.

    The hash does not depend on the line number, and so does not change when the user adds lines above.
    """
    assert d.span is not None
    identity = [d.code.code, within(d.span.file, base) or os.path.basename(d.span.file), d.path or "", d.message]
    return hashlib.sha256(json.dumps(identity).encode()).hexdigest()[:32]


def _notification(d: Diagnostic, notices: Sequence[Code]) -> dict[str, Any]:
    descriptor = {"id": d.code.code, "index": notices.index(d.code)}
    return {"descriptor": descriptor, "level": d.severity.value, "message": {"text": _message_text(d)}}


def _physical(span: Span, base: str) -> dict[str, Any]:
    relative = within(span.file, base)
    if relative is None:
        artifact = {"uri": "file://" + _encode_path(span.file.replace(os.sep, "/"))}
    else:
        artifact = {"uri": _encode_path(relative), "uriBaseId": ROOT}
    region = {"startLine": span.line}
    if (span.line, span.column) != (span.end_line, span.end_column):
        region |= {"startColumn": span.column, "endLine": span.end_line, "endColumn": span.end_column}
    return {"artifactLocation": artifact, "region": region}


def _encode_path(path: str) -> str:
    """Encode a path as a relative URI. The character `:` is also encoded, because text before a `:` could be parsed as a URI scheme."""
    return quote(os.fsencode(path), safe="/")


def as_github(diagnostics: Sequence[Diagnostic], *, base: str) -> str:
    """Format diagnostics as GitHub Actions annotations, one per line. File paths are relative to the folder `base`."""
    return "".join(_command(d, base) + "\n" for d in diagnostics)


def _command(d: Diagnostic, base: str) -> str:
    properties = {} if d.span is None else _annotation_location(d.span, base)
    properties["title"] = d.code.code
    properties_text = ",".join(f"{key}={_data(value).replace(':', '%3A').replace(',', '%2C')}" for key, value in properties.items())
    return f"::{_COMMANDS[d.severity]} {properties_text}::{_data(_message_text(d, [_note(note, base) for note in d.notes]))}"


def _annotation_location(span: Span, base: str) -> dict[str, str]:
    has_columns = span.line == span.end_line and span.column != span.end_column  # GitHub ignores the columns of multi-line annotations
    return {
        "file": escape_control(within(span.file, base) or span.file), "line": str(span.line),
        **({"col": str(span.column)} if has_columns else {}), "endLine": str(span.end_line),
        **({"endColumn": str(span.end_column)} if has_columns else {}),
    }


def _note(note: Note, base: str) -> str:
    """Format a note and its source location as text, because an annotation can have only one location."""
    if note.span is None:
        return note.message
    return f"{note.message} ({within(note.span.file, base) or note.span.file}:{note.span.line}:{note.span.column})"


def _data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def as_junit(name: str, results: Sequence[Result], others: Sequence[Diagnostic]) -> str:
    """Create a JUnit report in XML format.

    The report contains one suite with the name of the robot, and a test case for each combination of test, mode and pose. The text of a
    failed test case is the diagnostic that the command line prints. `others` contains errors that do not belong to a test, such as errors
    that prevented the tests from running. The errors in `others` are combined into a single error of the suite.
    """
    root = ElementTree.Element("testsuites")
    suite = ElementTree.SubElement(root, "testsuite", {
        "name": name, "tests": str(len(results) + bool(others)), "failures": str(sum(1 for r in results if not r.passed)),
        "errors": str(int(bool(others))), "skipped": "0", "time": f"{sum(r.seconds for r in results):.3f}",
    })
    if others:
        case = ElementTree.SubElement(suite, "testcase", {"name": "document", "classname": name, "time": "0.000"})
        _add_diagnostics(ElementTree.SubElement(case, "error"), others)
    for result in results:
        words = f"{result.name} [{result.where}]" if result.where else result.name
        case = ElementTree.SubElement(suite, "testcase", {
            "name": words, "classname": f"{name}.{result.kind}", "time": f"{result.seconds:.3f}",
        })
        if result.diagnostic is not None:
            _add_diagnostics(ElementTree.SubElement(case, "failure"), [result.diagnostic])
        ElementTree.SubElement(case, "system-out").text = escape_control(result.outcome.summary)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _add_diagnostics(element: ElementTree.Element, diagnostics: Sequence[Diagnostic]) -> None:
    element.set("message", escape_control(diagnostics[0].message))
    element.set("type", diagnostics[0].code.code)
    element.text = as_text(diagnostics)

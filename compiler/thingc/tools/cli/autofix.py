"""Implementation of `thingc check --fix`, which fixes each error that has only one possible fix, and reports the other errors."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache

from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic, Report, shown_path
from thingc.base.one_line_repr import format_count
from thingc.base.replacement import replace_files
from thingc.documents.format.autofix import CheckResult, TextEdit, autofix
from thingc.documents.load.paths import DOCUMENT_SUFFIXES
from thingc.documents.workspace import Workspace
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.tools.cli import console

ReportOf = Callable[[Environment, Compilation], Report]


def run_fix(arguments: argparse.Namespace, documents: Sequence[str], options: Options, report_of: ReportOf) -> int:
    """Fix errors in documents, and return the exit code, which is 0 if all errors were fixed (with `--diff`: can be fixed).

    The function `report_of` checks one document and returns its report.
    """
    try:
        if not arguments.fix:
            raise console.WrongCommandLine("--diff requires --fix", "write `thingc check --fix --diff`")
        if arguments.no_code:
            raise console.WrongCommandLine("--fix cannot be combined with --no-code", "remove one of the two options")
    except console.WrongCommandLine as fault:
        return _say(arguments, [fault.diagnostic], [])
    read = cache(_read)  # each file is read only once
    texts: dict[str, bytes] = {}
    mended: list[TextEdit] = []
    diagnostics: list[Diagnostic] = []
    for document in console.present(documents, diagnostics):
        done, texts, left = _autofix(document, replace(options, lock=True), texts, read, report_of, strict=arguments.strict)
        mended += done
        diagnostics.extend(d for d in left if d not in diagnostics)
    if not arguments.diff:
        replace_files({file: (read(file), data) for file, data in sorted(texts.items())})
    elif arguments.format == "text":
        for file, data in sorted(texts.items()):
            console.say_diff(shown_path(file), *(one.decode("utf-8-sig") for one in (read(file) or b"", data)))
        places = format_count(len(mended), "place")
        console.say(f"would fix {places}, {format_count(len(diagnostics), 'diagnostic')} would remain")
        return console.exit_code(diagnostics)
    return _say(arguments, diagnostics, mended)


def _autofix(
    document: str, options: Options, texts: Mapping[str, bytes], read: Callable[[str], bytes | None], report_of: ReportOf, *, strict: bool,
) -> tuple[list[TextEdit], dict[str, bytes], Sequence[Diagnostic]]:
    spaces: list[Workspace] = []

    def look(contents: Mapping[str, bytes]) -> CheckResult:
        with Environment(document, replace(options, texts=contents)) as environment:
            compilation = pipeline.check(environment)
            report = report_of(environment, compilation)
        if environment.workspace is not None:
            spaces.append(environment.workspace)
        documents = () if compilation.documents is None else tuple(compilation.documents.by_path.values())
        return CheckResult(found=console.final(report, strict=strict), documents=documents)

    def is_allowed(file: str) -> bool:
        return file.lower().endswith(DOCUMENT_SUFFIXES) and bool(spaces) and spaces[-1].contains(file)

    return autofix(look, texts, is_allowed, read)


def _read(file: str) -> bytes | None:
    """Return the bytes of a file, or None if the file cannot be read."""
    with contextlib.suppress(OSError), open(file, "rb") as stream:
        return stream.read()
    return None


def _say(arguments: argparse.Namespace, diagnostics: Sequence[Diagnostic], mended: Sequence[TextEdit]) -> int:
    rows = [{"file": shown_path(one.file), "line": one.line, "written": one.written, "replacement": one.replacement} for one in mended]
    if arguments.format == "text":
        for one in mended:
            console.say(f"{shown_path(one.file)}:{one.line}: fixed `{one.written}` -> `{one.replacement}`")
        if not mended and any(d.fixes for d in diagnostics):
            console.say("no fixes applied: no unambiguous fix reduces the number of errors")
        if diagnostics and (mended or any(d.fixes for d in diagnostics)):
            console.say("")
    console.print_found(diagnostics, arguments.format, stream=sys.stdout, debug=arguments.debug, mended=rows)
    if arguments.format == "text" and not diagnostics:
        console.say(f"{format_count(len(mended), 'place')} fixed, no diagnostics remain")
    return console.exit_code(diagnostics)

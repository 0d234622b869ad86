"""Implementation of `thingc check`, which reports all errors and warnings in documents.

Checks every key, name, unit, reference, limit and mass of a document and of the documents that it uses, in every mode.
Parts are read from the cache. Missing parts are built first, in a worker process.

  thingc check                                           check every document below the working folder
  thingc check assemblies                                check every document below a folder
  thingc check robot.urdf                                check a robot file of another format
  thingc check robot.yaml --fix                          fix misspelt names, units and similar errors
  thingc check robot.yaml --format json | jq '.diagnostics[].message'
  thingc check assemblies/*.yaml --format github         annotate a pull request
  thingc check assemblies/*.yaml --format sarif > thingc.sarif

Run `thingc explain CODE` for an explanation of a code.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report, Severity, shown_path
from thingc.base.one_line_repr import format_count
from thingc.driver import pipeline, up_to_date
from thingc.driver.environment import Environment, Options, store_of, with_environment
from thingc.driver.pipeline import Compilation
from thingc.tools.cli import console, robot_files
from thingc.tools.importing.import_request import changed_robots, select_robot_files


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc check` to the parser."""
    parser.set_defaults(stdout_errors=True)
    add = parser.add_argument
    add(
        "document", metavar="DOC", nargs="*",
        help="document, robot file (.urdf, .xacro, .sdf, .xml) or folder of documents (default: the working folder)",
    )
    add("--touched", action="store_true", help="treat the arguments as changed files, and check the documents they affect")
    console.add_no_code(parser)
    add("--time-limit", metavar="TIME", default="5 s", help="CPU time limit for each document (with --no-code; default: %(default)s)")
    add("--fix", action="store_true", help="apply unambiguous fixes")
    add("--diff", action="store_true", help="show the fixes without writing them (requires --fix)")
    robot_files.configure(parser)
    console.add_format(parser, console.FINDINGS)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc check`, and return the exit code, which is 0 if no document has errors."""
    options, source, strict = console.options_of(arguments), robot_files.import_request(arguments), arguments.strict
    if not arguments.document and arguments.touched:
        raise console.WrongCommandLine("--touched requires changed files", "pass the output of `git diff --name-only main...`")
    words = arguments.document or ["."]
    robots = (changed_robots if arguments.touched else select_robot_files)(words)
    documents = [word for word in words if word not in robots]
    if arguments.touched and not arguments.no_code:
        from thingc.tools.cli.touched import documents as touched

        documents = [shown_path(path) for path in touched(words, store=arguments.store)]
    folders = not arguments.touched and any(os.path.isdir(word) for word in words)
    if folders:
        documents = console.expand_paths(documents)
    if arguments.fix or arguments.diff:
        from thingc.tools.cli.autofix import run_fix

        if arguments.fix and robots and not arguments.touched:
            raise console.WrongCommandLine(f"--fix changes only documents, not `{robots[0]}`", "omit --fix, or this file")
        return run_fix(arguments, documents, options, report_of)
    of = len(documents) + len(robots) if folders else None
    check_document: Callable[[str], list[Diagnostic]] = partial(check, options=options, strict=strict)
    check_robot = partial(robot_files.check_robot, options=options, source=source, strict=strict)
    if arguments.no_code:  # check each file of the untrusted workspace in a sandboxed process
        from thingc.tools.cli.sandboxed_check import run_confined

        console.refuse_modules_of_others()
        seconds = console.time_of("--time-limit", arguments.time_limit)
        if arguments.touched:
            names = run_confined(partial(_affected_without_code, words), seconds)
            if isinstance(names, Diagnostic):
                return _answer(arguments, [names], [])
            documents = names
        check_document = partial(_check_confined, options=options, strict=strict, seconds=seconds)
        check_robot = partial(robot_files.check_confined, options=options, source=source, strict=strict, seconds=seconds)
    diagnostics = list[Diagnostic]()
    diagnostics_of = {document: check_document(document) for document in console.present(documents, diagnostics)}
    diagnostics_of |= {robot: check_robot(robot) for robot in robots}
    return _answer(arguments, *_merge(diagnostics_of, diagnostics), of=of)


def _check_confined(document: str, options: Options, *, strict: bool, seconds: float) -> list[Diagnostic]:
    """Check a document of an untrusted workspace in a sandboxed process."""
    from thingc.tools.cli.sandboxed_check import diagnose_confined

    return diagnose_confined(document, partial(without_code, document, options, strict=strict), seconds)


def _merge(found: Mapping[str, list[Diagnostic]], diagnostics: list[Diagnostic]) -> tuple[list[Diagnostic], list[str]]:
    """Append the diagnostics of all documents to `diagnostics`.

    Return all diagnostics, and the paths of the documents without warnings and errors. An allowance (the key `allow`) is reported as unused
    only if no checked document needs it.
    """
    needed = {d.span for listed in found.values() for d in listed if d.code is Code.UNNEEDED and d.severity is Severity.NOTE}
    good: list[str] = []
    for document, listed in found.items():
        remaining = [d for d in listed if d.code is not Code.UNNEEDED or d.span not in needed]
        diagnostics.extend(d for d in remaining if d not in diagnostics)
        if all(d.severity is Severity.NOTE for d in remaining):
            good.append(document)
    return diagnostics, good


def findings(environment: Environment, compilation: Compilation, *, strict: bool) -> list[Diagnostic]:
    """Check one document and return its diagnostics.

    The result includes a note for each allowance that the document needs. The function `_merge` removes these notes.
    """
    report = report_of(environment, compilation)
    needed = sorted((allowance.where for allowance in report.needed), key=lambda where: (where.file, where.line, where.column))
    notes = [Diagnostic(code=Code.UNNEEDED, severity=Severity.NOTE, message="is required", span=where) for where in needed]
    return [*console.final(report, strict=strict), *notes]


def _affected_without_code(files: Sequence[str]) -> list[str]:
    from thingc.tools.affected.dependents import affected_documents

    return [shown_path(path) for path in affected_documents([os.path.abspath(file) for file in files], os.getcwd(), None).documents]


def without_code(document: str, options: Options, *, strict: bool) -> list[Diagnostic]:
    """Check one document without running part code of its workspace. The caller must limit the time and the memory of the check."""
    with Environment(document, replace(options, lock=True, code=False)) as environment:
        return findings(environment, pipeline.check(environment), strict=strict)


def _answer(arguments: argparse.Namespace, diagnostics: list[Diagnostic], good: list[str], of: int | None = None) -> int:
    """Print the diagnostics in the requested format, and return the exit code.

    If the command line contains folders, `of` is the number of checked documents.
    """
    console.print_found(diagnostics, arguments.format, stream=sys.stdout, debug=arguments.debug)
    if arguments.format == "text":
        for document in good:
            console.say(f"{document}: ok")
        if of is not None:
            console.say(f"{format_count(of, 'document')} checked, {'all' if len(good) == of else len(good)} ok")
    return console.exit_code(diagnostics)


def check(document: str, options: Options, *, strict: bool = False) -> list[Diagnostic]:
    """Check one document and return its diagnostics. If no input has changed since an earlier check, return the cached diagnostics."""
    store = store_of(options)
    key = up_to_date.key_of("check", document, {"parameters": dict(options.parameters), "choices": dict(options.choices), "strict": strict})
    earlier = up_to_date.load(store, key)
    if earlier is not None:
        return earlier[0]

    def work(environment: Environment) -> list[Diagnostic]:
        compilation = pipeline.check(environment)
        diagnostics = findings(environment, compilation, strict=strict)
        if not compilation.report.failed and compilation.documents is not None and compilation.documents.root.kind != "variants":
            up_to_date.save(store, key, up_to_date.inputs(environment, compilation), diagnostics, {})
        return diagnostics

    return with_environment(document, replace(options, lock=True), work)


def report_of(environment: Environment, compilation: Compilation) -> Report:
    """Check one document and return its report. For a variants document, also check the variants."""
    if compilation.documents is None or compilation.documents.root.kind != "variants":
        return compilation.report
    from thingc.batch.variants_document import read_plan

    report = Report()
    read_plan(environment.document, environment.options, report)
    return report

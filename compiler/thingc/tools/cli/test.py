"""Implementation of `thingc test`, which runs the tests in a document.

Runs the tests of the document, but not the tests of nested documents. A failed test is reported as an error at the violated
value. The exit code is 0 if all tests pass.

  thingc test assemblies/arm.yaml
  thingc test assemblies/arm.yaml --only weight --only 'holds_*'
  thingc test assemblies/arm.yaml --mode bench -p 'reach=120 mm'
  thingc test assemblies/arm.yaml --format junit > arm.xml
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from thingc.base.diagnostics import Diagnostic, Severity, Stage, UserError, shown_path
from thingc.base.one_line_repr import format_count
from thingc.base.suggestions import did_you_mean
from thingc.driver import pipeline
from thingc.driver.environment import Environment
from thingc.driver.pipeline import Compilation, UnknownChoice
from thingc.tools.cli import console

if TYPE_CHECKING:
    from thingc.driver.testing.outcomes import Result
    from thingc.driver.testing.test_runner import Selection
    from thingc.model.assembly.types import Assembly


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc test` to the parser."""
    console.add_document(parser)
    parser.add_argument(
        "--only", metavar="NAME", action="append", default=[], help="run only tests with this name or pattern (may be repeated)",
    )
    parser.add_argument(
        "--mode", metavar="M", action="append", default=[],
        help="run tests only in this mode (may be repeated; default: the modes of each test)",
    )
    console.add_format(parser, ("text", "json", "junit"))
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc test`, and return the exit code, which is 0 if all selected tests pass."""
    results: list[Result] = []
    name = None
    try:
        diagnostics, name = console.compile_document(arguments, partial(_run, arguments, results))
    except UserError as fault:
        diagnostics = [fault.diagnostic]
    _tell(arguments, name or "thingc", results, diagnostics)
    return console.exit_code(diagnostics)


def _run(
    arguments: argparse.Namespace, results: list[Result], environment: Environment, compilation: Compilation, assembly: Assembly,
) -> str:
    """Run the tests of the document, and add their results to `results`. Return the name of the robot. Raises `UnknownChoice`."""
    results.clear()
    from thingc.driver.testing.test_runner import run as run_tests

    selection = _selection(arguments, assembly)
    width = max((len(linked.test.name) for linked in assembly.tests if selection.includes(linked)), default=0)

    def on_result(result: Result) -> None:
        results.append(result)
        if arguments.format == "text":
            console.say(_line(result, width))

    run_tests(pipeline.request_of(environment, compilation), selection, on_result)
    if not selection.only and not selection.modes:
        pipeline.report_unneeded(compilation, [Stage.CHECK, Stage.TEST])
    return assembly.name


def _selection(arguments: argparse.Namespace, assembly: Assembly) -> Selection:
    """Return the tests and modes that the command-line options select. Raises `UnknownChoice` for an unknown test or mode."""
    from thingc.driver.testing.test_runner import Selection

    selection = Selection(only=tuple(arguments.only), modes=tuple(arguments.mode))
    names, modes = [linked.test.name for linked in assembly.tests], [mode.name for mode in assembly.modes]
    document = shown_path(arguments.document)
    for text in selection.only:
        if not any(Selection(only=(text,)).includes(linked) for linked in assembly.tests):
            raise UnknownChoice(f"`{document}` has no test `{text}`", did_you_mean(text, names, what="tests"))
    for mode in selection.modes:
        if mode not in modes:
            raise UnknownChoice(f"`{document}` has no mode `{mode}`", did_you_mean(mode, modes, what="modes"))
    return selection


def _line(result: Result, width: int) -> str:
    """Format a test result as a line of text."""
    where = f"[{result.where}] " if result.where else ""
    verdict = "passed" if result.passed else "FAILED"
    return f"{verdict}  {result.name.ljust(width)}  {where}{result.outcome.summary}  {result.seconds:.2f} s"


def _tell(arguments: argparse.Namespace, name: str, results: Sequence[Result], diagnostics: Sequence[Diagnostic]) -> None:
    """Print the test results in the requested output format.

    The function does not repeat lines that were already printed during the tests.
    """
    if arguments.format == "json":
        console.print_json(diagnostics, tests=[_data(result) for result in results])
        return
    if arguments.format == "junit":
        from thingc.tools.reporting.ci_formats import as_junit

        failures = [result.diagnostic for result in results]
        others = [d for d in diagnostics if d.severity is Severity.ERROR and d not in failures]
        console.write_raw(as_junit(name, results, others))
        return
    if results:
        console.say("")
    console.print_text(diagnostics, stream=sys.stdout, debug=arguments.debug)
    passed = sum(1 for result in results if result.passed)
    if results:
        console.say(f"{format_count(len(results), 'test')}: {passed} passed, {len(results) - passed} failed")
    elif not console.exit_code(list(diagnostics)):
        chosen = " in the selected modes" if arguments.mode else ""
        console.say(f"{shown_path(arguments.document)}: no tests{chosen}")


def _data(result: Result) -> dict[str, object]:
    """Return the result of one test for the JSON output. Numbers are in SI units."""
    return {
        "name": result.name, "kind": result.kind, "mode": result.mode, "pose": result.pose, "passed": result.passed,
        "measured": dict(result.outcome.measured), "expected": dict(result.outcome.expected), "said": result.outcome.summary,
        "seconds": round(result.seconds, 3),
    }

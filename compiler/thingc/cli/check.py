"""`thingc check`: everything that is wrong, in one run."""

from __future__ import annotations

import argparse
import sys

from thingc import stamp
from thingc.cli import common
from thingc.diagnostics import Diagnostic
from thingc.pipeline import Compilation, Options

EPILOG = """\
Every key, name, unit, reference, limit and mass of the document and of those it uses, for every mode. Parts are looked
up in the store; those that are not there are modelled first (in a worker of its own).

  thingc check assemblies/*.yaml
  thingc check robot.yaml --format json | jq '.diagnostics[].message'
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `check`."""
    parser.epilog = EPILOG
    common.add_document(parser, many=True)
    common.add_format(parser)
    common.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Exit code 0 when nothing is wrong with any of the documents."""
    found: list[Diagnostic] = []
    good: list[str] = []
    try:
        options = common.options_of(arguments)
    except common.WrongCommandLine as fault:
        return _answer(arguments, [fault.diagnostic], [])
    for document in arguments.document:
        try:
            common.require_document(document)
        except common.WrongCommandLine as fault:
            found.append(fault.diagnostic)
            continue
        said = check(document, options, strict=arguments.strict)
        found.extend(d for d in said if d not in found)
        if not said:
            good.append(document)
    return _answer(arguments, found, good)


def _answer(arguments: argparse.Namespace, found: list[Diagnostic], good: list[str]) -> int:
    if arguments.format == "json":
        common.print_json(found)
    else:
        common.print_text(found, stream=sys.stdout, debug=arguments.debug)
        for document in good:
            print(f"{document}: ok")
    return common.exit_code(found)


def check(document: str, options: Options, *, strict: bool = False) -> list[Diagnostic]:
    """What there is to say about one document; from the stamp of an earlier run where nothing has changed."""
    with Compilation(document, options) as compilation:
        key = stamp.key_of("check", document, {"parameters": dict(options.parameters), "strict": strict})
        earlier = stamp.load(compilation.store, key)
        if earlier is not None:
            return earlier[0]
        compilation.run(kinds=("assembly", "materials"))
        found = common.final(compilation.report, strict=strict)
        if not compilation.report.failed:
            stamp.save(compilation.store, key, compilation.inputs(), found, {})
        return found

"""`thingc hag`: the assembly graph on standard output."""

from __future__ import annotations

import argparse
import sys

from thingc.driver.environment import attempted
from thingc.driver.pipeline import compile
from thingc.tools.cli import console

EPILOG = """\
Nodes are definitions (a part with its parameters, a document with its parameters): what is used twice is one node. Edges say
"is a subcomponent of", with the mounts that meet and the joint, if one moves.

  thingc hag assemblies/arm.yaml
  thingc hag assemblies/arm.yaml --format mermaid >> README.md
  thingc hag assemblies/arm.yaml --format svg > arm.svg
  thingc hag assemblies/arm.yaml --format graphml > arm.graphml
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `hag`."""
    parser.epilog = EPILOG
    console.add_document(parser)
    console.add_format(parser, ("text", "dot", "mermaid", "svg", "graphml", "json"))
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Prints the graph; diagnostics go to standard error."""
    try:
        console.require_document(arguments.document)
        options = console.options_of(arguments)
    except console.WrongCommandLine as fault:
        return console.print_text([fault.diagnostic], stream=sys.stderr, debug=False)
    compilation = attempted(arguments.document, options, compile)
    diagnostics = console.final(compilation.report, strict=arguments.strict)
    code = console.print_text(diagnostics, stream=sys.stderr, debug=arguments.debug)
    if code == 0 and compilation.assembly is not None:
        from thingc.targets.hag import emit as hag

        console.say(*getattr(hag, arguments.format)(compilation.assembly.hag).rstrip("\n").split("\n"))
    return code

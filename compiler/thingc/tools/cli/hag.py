"""Implementation of `thingc hag`, which prints the assembly graph (HAG) of a robot.

Each node is a definition: a part or a document with its parameters. A definition that is used twice is one node. Each edge connects
an assembly with a component. The label of an edge shows the mated mounts, and the joint, if any.

  thingc hag assemblies/arm.yaml
  thingc hag assemblies/arm.yaml --format mermaid >> README.md
  thingc hag assemblies/arm.yaml --format svg > arm.svg
  thingc hag assemblies/arm.yaml --format graphml > arm.graphml
"""

from __future__ import annotations

import argparse
import sys

from thingc.tools.cli import console


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc hag` to the parser."""
    console.add_document(parser)
    console.add_format(parser, ("text", "dot", "mermaid", "svg", "graphml", "json"))
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc hag`. The command prints the graph to standard output, and diagnostics to standard error."""
    try:
        diagnostics, graph = console.compile_document(arguments, lambda environment, compilation, assembly: assembly.hag)
    except console.WrongCommandLine as fault:
        diagnostics, graph = [fault.diagnostic], None
    if graph is not None:
        from thingc.targets.hag import emit as hag

        console.say(*getattr(hag, arguments.format)(graph).rstrip("\n").split("\n"))
    return console.print_text(diagnostics, stream=sys.stderr, debug=arguments.debug)

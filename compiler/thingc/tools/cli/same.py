"""Implementation of `thingc same`, which checks whether two robots are the same mechanism.

Compares axes of joints, masses, inertias and couplings. Root, names, link frames, joint zeros and joint signs may differ; the output is the
map between the robots. Limits, efforts, damping and other properties of joints are shown if both robots specify them and they differ, but
do not change the result. Meshes, contacts, gains of drives and tendons are not compared.

  thingc same old.urdf new.urdf                     two files: documents, URDF, xacro, MJCF, SDF
  thingc same arm.yaml build/arm                    a document and a build folder
  thingc same main..HEAD -- assemblies/arm.yaml     two revisions of a file

Exit code: 0 if the robots are the same mechanism, 1 if they differ or have errors, 2 for an invalid command line.
"""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack

from msgspec import to_builtins

from thingc.tools.cli import console, robot_files
from thingc.tools.diff.arguments import parse_sides
from thingc.tools.diff.checkouts import BrokenSide, laid_out
from thingc.tools.same.comparison import TOLERANCE, MechanismComparison, compare_mechanisms
from thingc.tools.same.sides import mechanisms
from thingc.tools.same.text_report import as_text


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc same` to the parser."""
    parser.set_defaults(behind=[])
    add = parser.add_argument
    add("side", metavar="SIDE", nargs="+", help="document, robot file, build folder or Git revision to compare")
    add(
        "--tolerance", metavar="T", type=console.number_in(1e-12, 0.1, "a number from 1e-12 to 0.1", float), default=TOLERANCE,
        help="largest allowed difference between values (default: %(default)g)",
    )
    robot_files.configure(parser, meshes=False)
    console.add_format(parser)
    console.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc same`, and return the exit code: 0 if all compared robots are the same mechanism, otherwise 1."""
    options = console.options_of(arguments)
    results: list[tuple[str, MechanismComparison]] = []
    request = parse_sides(arguments.side, arguments.behind)
    names = (request.old.name, request.new.name)
    try:
        with ExitStack() as stack:
            for pair in laid_out(request, stack, code=options.code):
                both = mechanisms(pair, names, options, robot_files.import_request(arguments))
                results.append((pair.name, compare_mechanisms(*both, arguments.tolerance)))
    except BrokenSide as broken:
        console.print_found(broken.diagnostics, arguments.format, stream=sys.stdout, debug=arguments.debug, texts=broken.texts)
        return 1
    if arguments.format == "json":
        console.print_data({"old": names[0], "new": names[1], "comparisons": [
            {"document": name, **to_builtins(result)} for name, result in results
        ]})
    else:
        if not results:
            console.say(f"{names[0]} -> {names[1]}: nothing to compare: no document and no robot file changed")
        for name, result in results:
            head, *lines = as_text(result, names)
            console.say(f"{name}: {head}", *lines)
    return 0 if all(result.same for _, result in results) else 1

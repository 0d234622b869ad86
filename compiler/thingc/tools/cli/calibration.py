"""Implementation of `thingc calibration`, which checks the calibration of a physical robot and converts it for other programs.

Without --emit, the command only checks the calibration.

  thingc calibration arm.yaml left.calibration.yaml                      check the file against the robot
  thingc calibration arm.yaml left.calibration.yaml --emit lerobot -o left.json
  thingc calibration arm.yaml left.calibration.yaml --emit ros2_control  print the <ros2_control> block of the first mode
"""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial

from thingc.base.diagnostics import Code
from thingc.base.filesystem import write_whole
from thingc.base.one_line_repr import format_count
from thingc.driver.environment import Environment
from thingc.driver.pipeline import Compilation
from thingc.model.assembly.types import Assembly
from thingc.tools.calibration.calibration import read_calibration
from thingc.tools.calibration.exports import EXPORTS, ExportRefused, warn_reversed
from thingc.tools.cli import console


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc calibration` to the parser."""
    parser.add_argument("document", metavar="ROBOT", help="an assembly document (YAML or TOML)")
    parser.add_argument("calibration", metavar="FILE", help="a calibration document (YAML or TOML)")
    parser.add_argument("--emit", choices=[*EXPORTS], help="format of the converted calibration")
    parser.add_argument("-o", "--output", metavar="OUT", help="output file (default: standard output)")
    console.add_format(parser)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc calibration`, and return the exit code, which is 0 if the calibration has no errors."""
    console.require_document(arguments.document)
    console.require_document(arguments.calibration)
    _check_output(arguments)
    found, _ = console.compile_document(arguments, partial(_convert, arguments))
    return console.print_found(found, arguments.format, stream=sys.stderr, debug=arguments.debug)


def _check_output(arguments: argparse.Namespace) -> None:
    """Raise `WrongCommandLine` if the option -o has no format, or names an input file."""
    if arguments.output is not None and arguments.emit is None:
        raise console.WrongCommandLine("-o requires --emit", "add, for example, --emit python")
    inputs = [os.path.realpath(path) for path in (arguments.document, arguments.calibration)]
    if arguments.output is not None and os.path.realpath(arguments.output) in inputs:
        raise console.WrongCommandLine(f"-o: `{arguments.output}` is an input file", "choose another file with -o", Code.OUTPUT)


def _convert(arguments: argparse.Namespace, _: Environment, compilation: Compilation, assembly: Assembly) -> None:
    """Check the calibration, and write the output. Raises `WrongCommandLine`."""
    calibration = read_calibration(arguments.calibration, assembly, compilation.report)
    if calibration is not None and arguments.emit in ("lerobot", "lerobot_motors"):
        warn_reversed(calibration, arguments.document, compilation.report)
    if calibration is None or console.exit_code(console.final(compilation.report, strict=arguments.strict)):
        return
    if arguments.emit is None:
        if arguments.format == "text":
            console.say(f"{arguments.calibration}: ok, {format_count(len(calibration.joints), 'motor')}")
        return
    try:
        text = EXPORTS[arguments.emit](calibration.joints, compilation.robots[0])
    except ExportRefused as fault:
        raise console.WrongCommandLine(f"--emit {arguments.emit}: {fault}", fault.diagnostic.help) from fault
    with console.writing(arguments.output, "choose another file with -o"):
        if arguments.output is None:
            console.write_raw(text)
        else:
            write_whole(os.path.abspath(arguments.output), text.encode())

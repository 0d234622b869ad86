"""Implementation of `thingc rezero`, which moves zeros of joints and reverses joints in a document.

The coordinate of a joint changes by `q_new = q_old + ZERO`, with --flip by `q_new = ZERO - q_old`. `thingc same OLD NEW` prints these
equations. Limits, poses, start positions, mimics, tendons, springs, tests and the given calibrations are changed accordingly, and the
geometry stays the same. Comments and layout are preserved.

  thingc rezero arm.yaml 'elbow=90 deg'                     q_new = q_old + 90 deg
  thingc rezero arm.yaml 'elbow=90 deg' 'slide=-5 mm' --flip elbow
  thingc rezero arm.yaml --flip elbow --diff                show the change, write nothing
"""

from __future__ import annotations

import argparse

from thingc.base.primitives import FARTHEST
from thingc.base.units import UnitError
from thingc.tools.cli import console
from thingc.tools.cli.set import report_edit
from thingc.tools.rezero.quantity_text import ExactQuantity, read_quantity
from thingc.tools.rezero.rezero import rezero
from thingc.tools.rezero.shift_edits import JointShift


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc rezero` to the parser."""
    parser.set_defaults(stdout_errors=True)
    parser.add_argument("document", metavar="DOC", help="an assembly document (YAML or TOML)")
    parser.add_argument("zero", metavar="JOINT=ZERO", nargs="*", help="new value of a joint at its current zero position")
    parser.add_argument("--flip", metavar="JOINT", action="append", default=[], help="reverse the direction of a joint (may be repeated)")
    parser.add_argument(
        "--calibration", metavar="FILE", action="append", default=[],
        help="calibration document to update (may be repeated)",
    )
    console.add_editing(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc rezero`, and return the exit code, which is 0 if the document was changed (with `--diff`: can be changed)."""
    for document in (arguments.document, *arguments.calibration):
        console.require_document(document)
    options, shifts = console.options_of(arguments), _shifts(arguments)
    calibrations, strict, dry = arguments.calibration, arguments.strict, arguments.diff
    result = rezero(arguments.document, shifts, options, calibrations=calibrations, strict=strict, dry=dry)
    if arguments.format == "text" and not result.done and not console.exit_code(result.found):
        console.say("nothing changes: all zeros and directions stay the same")
    return report_edit(result, arguments, diff=dry)


def _shifts(arguments: argparse.Namespace) -> list[JointShift]:
    """Parse the joints on the command line. Raises `WrongCommandLine`."""
    zeros = {name: _zero(name, text) for name, text in console.paths(
        arguments.zero, "JOINT=ZERO", "'elbow=90 deg'", "joint `{}` is set twice",
    ).items()}
    if not zeros and not arguments.flip:
        raise console.WrongCommandLine("expected a joint", "write, for example, 'elbow=90 deg', or --flip elbow")
    twice = next((name for name in arguments.flip if arguments.flip.count(name) > 1), None)
    if twice is not None:
        raise console.WrongCommandLine(f"--flip: joint `{twice}` is reversed twice", "keep only one of the two options")
    return [
        JointShift(joint=name, sign=-1 if name in arguments.flip else 1, zero=zeros.get(name, ExactQuantity()))
        for name in dict.fromkeys((*zeros, *arguments.flip))
    ]


def _zero(name: str, text: str) -> ExactQuantity:
    try:
        zero = read_quantity(text)
    except UnitError as fault:
        raise console.WrongCommandLine(f"`{name}={text}`: {fault}", fault.help or f"write, for example, '{name}=90 deg'") from fault
    if zero.expression or abs(zero.value) > FARTHEST:
        message = f"`{name}={text}`: expected a number with a unit, at most {FARTHEST:g} rad or m"
        raise console.WrongCommandLine(message, f"write, for example, '{name}=90 deg'")
    return zero

"""Implementation of `thingc joints`, which proposes joints between parts that touch, and writes accepted joints into the document.

A joint is proposed where a shaft is in a hole, where faces enclose a part around one direction, and at bolt circles. A proposal is
ambiguous if the geometry also fits another connection; --write accepts it only if you specify its name. The geometry does not determine
limits: rotating joints become `continuous`, and sliding joints get half the length of their faces.

  thingc joints robot/robot.yaml                          list the proposals
  thingc joints robot/robot.yaml --write                  accept all unambiguous proposals
  thingc joints robot/robot.yaml base_to_arm --write      accept a proposal by its name
"""

from __future__ import annotations

import argparse
import sys

from thingc.tools.cli import console
from thingc.tools.cli.set import report_edit
from thingc.tools.joints.joints import JointProposals, propose_joints, write_joints
from thingc.tools.joints.proposals import JointProposal


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc joints` to the parser."""
    parser.set_defaults(stdout_errors=True)
    parser.add_argument("document", metavar="DOC", help="an assembly document (YAML or TOML)")
    parser.add_argument("name", metavar="JOINT", nargs="*", help="proposed joint to accept (default: all unambiguous proposals)")
    parser.add_argument("--write", action="store_true", help="write the accepted joints into the document")
    parser.add_argument("--diff", action="store_true", help="show the changes of --write without writing them")
    console.add_format(parser)
    parser.add_argument("--strict", action="store_true", help="treat warnings as errors")
    console.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc joints`, and return the exit code, which is 0 if the document has no errors."""
    console.require_document(arguments.document)
    if arguments.name and not (arguments.write or arguments.diff):
        raise console.WrongCommandLine("names of proposals require --write", "add --write, or remove the names")
    options = console.options_of(arguments)
    proposed = propose_joints(arguments.document, options, strict=arguments.strict)
    if proposed.document is not None and (arguments.write or arguments.diff):
        outcome = write_joints(proposed, arguments.name, options, strict=arguments.strict, dry=not arguments.write or arguments.diff)
        if not outcome.found and not outcome.done and arguments.format == "text":
            console.say("no unambiguous proposals")
        return report_edit(outcome, arguments, diff=arguments.diff)
    if arguments.format == "text" and proposed.document is not None:
        console.say(*_lines(proposed))
    return console.print_found(
        proposed.found, arguments.format, stream=sys.stdout, debug=arguments.debug, proposals=[*map(_as_data, proposed.proposals)],
    )


def _lines(proposed: JointProposals) -> list[str]:
    """Format the proposals as a table."""
    if not proposed.proposals:
        return ["no joints found"]
    rows = []
    for one in proposed.proposals:
        at = " ".join(f"{round(1000.0 * value, 6) + 0.0:.6g}" for value in one.line.point)
        axis = " ".join(f"{round(value, 6) + 0.0:g}" for value in one.line.axis)
        rows.append((one.name, one.kind, f"axis {axis} at {at} mm", "" if one.doubt is None else f"doubt: {one.doubt}"))
    return console.table(rows)


def _as_data(one: JointProposal) -> dict[str, object]:
    """Convert a proposal to JSON data. Lengths are in metres."""
    return {
        "name": one.name, "type": one.kind, "parent": one.parent, "child": one.child, "point": one.line.point, "axis": one.line.axis,
        "doubt": one.doubt,
    }

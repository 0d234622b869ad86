"""Implementation of `thingc limits`, which finds the intervals of joints in which no parts touch.

One joint moves at a time, and all other joints stay in the pose. A rotation is searched over a full turn, a translation between its
limits. To prove combinations of joints, use a `no_collision` test with `certify: true`.

  thingc limits assemblies/arm.yaml                      all joints, in the start pose of the first mode
  thingc limits assemblies/arm.yaml elbow --pose folded --resolution '0.05 deg'
  thingc limits assemblies/arm.yaml --pairs              also all pairs of joints, between their limits
  thingc limits assemblies/arm.yaml elbow --write        write the limits of the elbow to the document
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING

from msgspec.structs import asdict

from thingc.base.units import ANGLE, LENGTH, UnitError, parse_quantity
from thingc.driver import pipeline
from thingc.driver.environment import Environment
from thingc.driver.pipeline import Compilation, UnknownChoice
from thingc.tools.cli import console

if TYPE_CHECKING:
    from thingc.model.assembly.types import Assembly
    from thingc.tools.limits.joint_limits import JointLimits, PairLimits


_NONE = "no parts compared"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc limits` to the parser."""
    console.add_document(parser)
    parser.add_argument("joint", metavar="JOINT", nargs="*", help="joint name or pattern (default: all joints with one coordinate)")
    parser.add_argument("--mode", metavar="M", help="mode of the robot (default: the first mode)")
    parser.add_argument("--pose", metavar="P", help="start pose of the search (default: the pose of the mode)")
    parser.add_argument("--pairs", action="store_true", help="also move pairs of joints")
    parser.add_argument(
        "--resolution", metavar="SIZE", action="append", default=[],
        help="accuracy of the limits (may be repeated; default: 0.25 deg and 0.1 mm)",
    )
    parser.add_argument("--write", action="store_true", help="write the limits to the document")
    console.add_format(parser)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc limits`, and return the exit code, which is 0 if the joints could be searched and, with `--write`, the limits written."""
    search = partial(_search, arguments, _widths(arguments.resolution))
    diagnostics, answer = console.compile_document(arguments, search, arguments.mode)
    found, pairs = answer or ([], [])
    if arguments.format == "json" and not (arguments.write and found):
        console.print_json(diagnostics, joints=list(map(_as_data, found)), pairs=[asdict(one) for one in pairs])
        return console.exit_code(diagnostics)
    code = console.print_text(diagnostics, stream=sys.stderr, debug=arguments.debug)
    if arguments.format == "text" and found:
        console.say(*as_text(found, pairs))
    if code or not arguments.write:
        return code
    from thingc.tools.cli import set as set_command

    values = {path: text for one in found for path, text in _values(one).items()}
    if nested := ", ".join(f"`{one.joint.name}`" for one in found if "." in one.joint.name and any(one.contacts)):
        console.say(f"note: the limits of joints in nested documents are not written ({nested})", stream=sys.stderr)
    return set_command.write(arguments.document, values, console.options_of(arguments), arguments) if values else code


def _widths(texts: Sequence[str]) -> dict[object, float]:
    """Parse the option `--resolution`. Return the resolutions by physical dimension. Raises `WrongCommandLine`."""
    widths: dict[object, float] = {ANGLE: math.radians(0.25), LENGTH: 1e-4}
    for text in texts:
        try:
            quantity = parse_quantity(text, (ANGLE, LENGTH))
        except UnitError as fault:
            raise console.WrongCommandLine(f"--resolution: {fault}", fault.help or "write, for example, '0.1 deg'") from fault
        if quantity.dimension not in widths or not 1e-6 <= quantity.value <= 1.0:
            message = f"--resolution: expected an angle or a length from 1e-6 to 1 rad or m, found `{text}`"
            raise console.WrongCommandLine(message, "write, for example, '0.1 deg'")
        widths[quantity.dimension] = quantity.value
    return widths


def _search(
    arguments: argparse.Namespace, widths: dict[object, float], environment: Environment, compilation: Compilation, _: Assembly,
) -> tuple[list[JointLimits], list[PairLimits]]:
    """Return the limits of the joints, and the pairs of joints. Raises `UnknownChoice`."""
    from thingc.driver.testing.collisions import collisions_of
    from thingc.tools.limits.joint_limits import LimitSearch, movable_joints, posed_robot

    robot, frame = posed_robot(compilation.robots[0], arguments.pose)
    joints = movable_joints(robot, arguments.joint)
    for text in arguments.resolution:
        if (dimension := parse_quantity(text, (ANGLE, LENGTH)).dimension) not in [one.twist.coordinate for one in joints]:
            expected = "a length" if dimension == ANGLE else "an angle"
            raise UnknownChoice(f"--resolution: expected {expected}, found `{text}`", f"write {expected}, or remove the option")
    search = LimitSearch(robot, frame, collisions_of(pipeline.request_of(environment, compilation)))
    pairs = combinations(joints, 2) if arguments.pairs else ()
    return [search.joint(one, widths[one.twist.coordinate]) for one in joints], [search.pair(*pair) for pair in pairs]


def as_text(found: Sequence[JointLimits], pairs: Sequence[PairLimits]) -> list[str]:
    """Format the free intervals as a table, and the pairs of joints as another table."""
    from thingc.driver.testing.collisions import skipped_text

    rows = [("joint", "limits", "free of contact", "first contacts", "")]
    for one in found:
        limit, show = one.joint.limit, one.joint.twist.format
        more = len(one.intervals) - (one.own is not None)
        rows.append((
            one.joint.name, " to ".join("unlimited" if end is None else show(end) for end in (limit.lower, limit.upper)),
            (" to ".join(map(show, one.own)) if one.own is not None else "touches in the pose") + (f" ({more} more)" if more else ""),
            "; ".join(dict.fromkeys(contact for contact in one.contacts if contact is not None)) or "none",
            f"proved to {show(one.width)}" if one.proved
            else skipped_text(one.skipped).removeprefix(", ") or ("sampled" if one.compared else _NONE),
        ))
    others = [(
        " and ".join(one.joints), one.verdict, f"{one.contact} at {one.where}" if one.contact else "",
        "proved" if one.proved or one.verdict == "touches"
        else skipped_text(one.skipped).removeprefix(", ") or ("sampled" if one.compared else _NONE),
    ) for one in pairs]
    return [*console.table(rows), *(["", *console.table([("joints", "between their limits", "", ""), *others])] if others else [])]


def _as_data(one: JointLimits) -> dict[str, object]:
    """Return the limits of a joint for the JSON output, in SI units."""
    return {
        "joint": one.joint.name, "lower": one.joint.limit.lower, "upper": one.joint.limit.upper, "free": one.own,
        "intervals": one.intervals, "contacts": one.contacts, "resolution": one.width, "proved": one.proved,
        "compared": one.compared, "skipped": one.skipped,
    }


def _values(one: JointLimits) -> dict[str, str]:
    """Return the values to write for the limits of a joint, by path.

    Ends without a contact, ends beyond the limits of the document, and joints of nested documents are omitted.
    """
    if one.own is None or one.joint.name.number is not None or "." in one.joint.name:
        return {}
    scale, unit = (math.degrees(1.0), "deg") if one.joint.twist.turns else (1000.0, "mm")
    rounded = math.ceil(scale * one.own[0] * 100.0) / 100.0, math.floor(scale * one.own[1] * 100.0) / 100.0
    lower, upper = one.joint.limit.lower, one.joint.limit.upper
    is_narrower = lower is None or one.own[0] > lower, upper is None or one.own[1] < upper
    ends = zip(("lower", "upper"), rounded, one.contacts, is_narrower, strict=True)
    written = {key: f"{value:g} {unit}" for key, value, contact, narrower in ends if contact is not None and narrower}
    return {f"joints.{one.joint.name}.limit.{key}": text for key, text in (written and {**written, "source": "geometry"}).items()}

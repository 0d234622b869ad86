"""Implementation of `thingc limits`, which finds the intervals of joints in which no parts touch."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from fnmatch import fnmatchcase
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING

from msgspec.structs import asdict

from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import did_you_mean
from thingc.base.units import ANGLE, LENGTH, UnitError, parse_quantity
from thingc.driver import pipeline
from thingc.driver.environment import Environment, attempted
from thingc.driver.pipeline import UnknownChoice
from thingc.tools.cli import console

if TYPE_CHECKING:
    from thingc.model.assembly.types import JointEdge
    from thingc.model.resolve.types import JointRange
    from thingc.model.robot.types import Keyframe, Robot
    from thingc.tools.limits.free_intervals import FreeIntervals

EPILOG = """\
One joint moves at a time, and all other joints stay in the pose. A rotation is searched over a full turn, a translation between its
limits. The document's test `no_collision` with `certify: true` proves combinations of joints.

  thingc limits assemblies/arm.yaml                      all joints, in the start pose of the first mode
  thingc limits assemblies/arm.yaml elbow --pose folded --resolution '0.05 deg'
  thingc limits assemblies/arm.yaml --pairs              also all pairs of joints, between their limits
  thingc limits assemblies/arm.yaml elbow --write        write the limits of the elbow to the document
"""
TURN = math.pi
"""Half of the range [rad] in which a rotation is searched."""


class JointLimits(FrozenStruct):
    """The free intervals of a joint, the interval that contains the pose (None: parts touch in the pose), and its ends.

    `contacts` contains, for each end, the pair of parts that touches beyond the end. An end without a contact is the end of the search.
    """

    joint: JointEdge
    free: FreeIntervals
    own: tuple[float, float] | None
    contacts: tuple[str | None, str | None]
    width: float


class PairLimits(FrozenStruct):
    """The result for two joints that move between their limits: the pair of parts that touches or may touch (None: none), and where."""

    joints: tuple[str, str]
    verdict: str
    contact: str | None
    where: str
    proved: bool


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc limits` to the parser."""
    parser.epilog = EPILOG
    console.add_document(parser)
    parser.add_argument("joint", metavar="JOINT", nargs="*", help="joints or patterns (default: all joints with one coordinate)")
    parser.add_argument("--mode", metavar="M", help="mode of the robot (default: the first)")
    parser.add_argument("--pose", metavar="P", help="pose of the other joints (default: pose of the mode)")
    parser.add_argument("--pairs", action="store_true", help="also check all pairs of these joints between their limits")
    parser.add_argument(
        "--resolution", metavar="SIZE", action="append", default=[], help="largest error of an end of an interval, an angle or a length "
        "(default: 0.25 deg and 0.1 mm; may be repeated)",
    )
    parser.add_argument("--write", action="store_true", help="write the limits to the document, and preserve comments and layout")
    console.add_format(parser)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc limits`, and return the exit code, which is 0 if the joints could be searched and, with `--write`, the limits written."""
    console.require_document(arguments.document)
    widths = _widths(arguments.resolution)
    found: list[JointLimits] = []
    pairs: list[PairLimits] = []
    options = console.options_of(arguments)
    try:
        diagnostics = attempted(arguments.document, options, partial(_search, arguments, widths, found, pairs))
    except UnknownChoice as fault:
        diagnostics = [console.of_exception(fault)]
    if arguments.format == "json" and not (arguments.write and found):
        console.print_json(diagnostics, joints=list(map(_as_data, found)), pairs=[asdict(one) for one in pairs])
        return console.exit_code(diagnostics)
    code = console.print_text(diagnostics, stream=sys.stderr, debug=arguments.debug)
    if arguments.format == "text" and found:
        console.say(*as_text(found, pairs))
    if code or not arguments.write:
        return code
    from thingc.tools.cli import set as set_command

    given = {path: text for one in found for path, text in _values(one).items()}
    return set_command.write(arguments.document, given, options, arguments) if given else code


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
    arguments: argparse.Namespace, widths: dict[object, float], found: list[JointLimits], pairs: list[PairLimits], environment: Environment,
) -> list[Diagnostic]:
    """Compile the document, and add the free intervals of the joints to `found`, and the checked pairs of joints to `pairs`.

    Return the diagnostics. Raises `UnknownChoice`.
    """
    from thingc.driver.testing.collisions import collisions_of, names_of
    from thingc.driver.testing.poses import joints_text
    from thingc.model.solids.clearance import prove
    from thingc.tools.limits.free_intervals import free_intervals

    found.clear()
    pairs.clear()
    compilation = pipeline.compile(environment, [arguments.mode] if arguments.mode is not None else [])
    diagnostics = console.final(compilation.report, strict=arguments.strict)
    if console.exit_code(diagnostics) or compilation.assembly is None:
        return diagnostics
    assembly, (robot, frame) = compilation.assembly, _placed(compilation.robots[0], arguments.pose)
    joints = _chosen(robot, arguments.joint)
    collisions = collisions_of(pipeline.request_of(environment, compilation))
    for joint in joints:
        q, width = frame.q[joint.path], widths[joint.twist.coordinate]
        free = free_intervals(*collisions.moving_pairs(robot, frame, [_range(joint, q)], 0.0), width)
        own = free.around(q, width)
        ends = [free.contact(end, width) for end in own] if own is not None else [free.contact(q, width)] * 2
        lower, upper = (None if pair is None else names_of(assembly, pair.one, pair.other) for pair in ends)
        found.append(JointLimits(joint=joint, free=free, own=own, contacts=(lower, upper), width=width))
    for one, other in combinations(joints, 2) if arguments.pairs else ():
        sweep, moving = collisions.moving_pairs(robot, frame, [_range(each, 0.0, limited=True) for each in (one, other)], 0.0)
        prove(sweep, moving)
        worst = next((pair for verdict in ("touches", "undecided") for pair in moving if pair.verdict == verdict), None)
        pairs.append(PairLimits(
            joints=(one.name, other.name), verdict="clear" if worst is None else worst.verdict,
            contact=None if worst is None else names_of(assembly, worst.one, worst.other),
            where=joints_text(assembly, {each.path: worst.q[each.path] for each in (one, other)}) if worst is not None and worst.q else "",
            proved=all(pair.method == "proved" and pair.verdict != "contact" for pair in moving),
        ))
    return diagnostics


def _placed(robot: Robot, wanted: str | None) -> tuple[Robot, Keyframe]:
    """Return the robot and its keyframe for the pose on the command line, by default the start pose of the mode. Raises `UnknownChoice`."""
    from thingc.driver.testing.poses import keyframe, posed, starting_pose

    poses = {pose.name: pose for pose in robot.assembly.poses}
    if wanted is not None and wanted not in poses:
        raise UnknownChoice(f"there is no pose `{wanted}`", did_you_mean(wanted, list(poses), what="poses"))
    pose = poses[wanted] if wanted is not None else starting_pose(robot.assembly, robot.mode)
    placed = posed(robot.assembly, robot.mode, [pose])
    frame = keyframe(placed, pose) if placed is not None else None
    if placed is None or frame is None:
        raise UnknownChoice(f"the loops of mode `{robot.mode.name}` do not close in pose `{pose.name}`", "choose another pose with --pose")
    return placed, frame


def _chosen(robot: Robot, words: Sequence[str]) -> list[JointEdge]:
    """Return the joints that match the names and patterns on the command line. Raises `UnknownChoice`."""
    from thingc.model.assembly.kinematics import joints_of

    movable = {str(joint.name): joint for joint in joints_of(robot.assembly) if joint.mimic is None and not joint.kind.at_once}
    for word in words:
        if not any(fnmatchcase(name, word) or name == word for name in movable):
            raise UnknownChoice(f"there is no joint `{word}` that can be moved", did_you_mean(word, list(movable), what="joints"))
    chosen = {name: one for name, one in movable.items() if not words or any(fnmatchcase(name, word) or name == word for word in words)}
    for name, joint in chosen.items():
        if not joint.twist.turns and (joint.limit.lower is None or joint.limit.upper is None):
            raise UnknownChoice(f"joint `{name}` slides without limits", f"add `limit` to joint `{name}`, or name other joints")
    return list(chosen.values())


def _range(joint: JointEdge, q: float, *, limited: bool = False) -> JointRange:
    """Return the range in which a joint is searched: one turn around `q`, or the range between its limits."""
    from thingc.model.resolve.types import JointRange

    lower, upper = joint.limit.lower, joint.limit.upper
    if joint.twist.turns and (not limited or lower is None or upper is None):
        lower, upper = q - TURN, q + TURN
    assert lower is not None and upper is not None
    return JointRange(joint=joint.path, lower=lower, upper=upper)


def as_text(found: Sequence[JointLimits], pairs: Sequence[PairLimits]) -> list[str]:
    """Format the free intervals as a table, and the pairs of joints as another table."""
    rows = [("joint", "limits", "free of contact", "first contacts", "")]
    for one in found:
        limit, show = one.joint.limit, one.joint.twist.shown
        more = len(one.free.intervals) - (one.own is not None)
        rows.append((
            one.joint.name, " to ".join("unlimited" if end is None else show(end) for end in (limit.lower, limit.upper)),
            (" to ".join(map(show, one.own)) if one.own is not None else "touches in the pose") + (f" ({more} more)" if more else ""),
            "; ".join(dict.fromkeys(contact for contact in one.contacts if contact is not None)) or "none",
            f"{'proved' if one.free.proved else 'sampled'} to {show(one.width)}",
        ))
    others = [(
        " and ".join(one.joints), one.verdict, f"{one.contact} at {one.where}" if one.contact else "",
        "proved" if one.proved or one.verdict == "touches" else "sampled",
    ) for one in pairs]
    return [*console.table(rows), *(["", *console.table([("joints", "between their limits", "", ""), *others])] if others else [])]


def _as_data(one: JointLimits) -> dict[str, object]:
    """Return the limits of a joint for the JSON output, in SI units."""
    return {
        "joint": one.joint.name, "lower": one.joint.limit.lower, "upper": one.joint.limit.upper, "free": one.own,
        "intervals": one.free.intervals, "contacts": one.contacts, "resolution": one.width, "proved": one.free.proved,
    }


def _values(one: JointLimits) -> dict[str, str]:
    """Return the values to write for the limits of a joint, by path. Ends without a contact and joints of nested documents are omitted."""
    if one.own is None or one.joint.name.number is not None or "." in one.joint.name:
        return {}
    scale, unit = (math.degrees(1.0), "deg") if one.joint.twist.turns else (1000.0, "mm")
    rounded = math.ceil(scale * one.own[0] * 100.0) / 100.0, math.floor(scale * one.own[1] * 100.0) / 100.0
    return {
        f"joints.{one.joint.name}.limit.{key}": f"{value:g} {unit}"
        for key, value, contact in zip(("lower", "upper"), rounded, one.contacts, strict=True) if contact is not None
    }

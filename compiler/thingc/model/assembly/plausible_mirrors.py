"""Mirrored pairs that are not mirror images: a part and its mirrored counterpart on opposite mounts, one of them turned."""

from __future__ import annotations

from itertools import combinations

from thingc.base.diagnostics import Code, allow_hint, noted
from thingc.base.joints.twist import Twist
from thingc.base.mirror import Mirror
from thingc.base.numeric import dist, maximum, radians
from thingc.base.pose import multiply, transpose
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Assembly, Mate

CLOSE = 1e-6
"""How far entries of rotations, and places [m], may differ that count as equal."""


def check_mirrored_pairs(assembly: Assembly, findings: LinkReport) -> None:
    """A warning for each mirrored part that is turned by 90 or 180 deg against its counterpart on the opposite mount."""
    groups: dict[object, list[Mate]] = {}
    for mate in assembly.mates:
        definition = assembly.occurrences[mate.child].definition
        if mate.loop is None and mate.child_mount != "origin":
            groups.setdefault((mate.parent, mate.child_mount, (definition.plain or definition).text), []).append(mate)
    for mates in groups.values():
        for one, other in combinations(mates, 2):
            turn = _turn_between(assembly, one, other)
            part, opposite, parent = (assembly.occurrences[index].path for index in (other.child, one.child, one.parent))
            if turn and findings.warn(
                Code.MIRRORED_TURN,
                f"`{part}` is turned by {abs(turn)} deg against the mirror image of `{opposite}`, on the other side of `{parent}`",
                other.origin, path=part, notes=noted(f"`{opposite}` is placed here", one.origin),
                help=f"add {turn} deg to its `turn`, or use `facing` or `mate_x` for the mounts; {allow_hint(Code.MIRRORED_TURN)}",
            ):
                break


def _turn_between(assembly: Assembly, one: Mate, other: Mate) -> int:
    """The turn [deg] about the mount's z that makes two children at q = 0 mirror images of each other; 0 if there is none, if they are
    images already, or if their mounts do not lie opposite at a plane of the parent's frame."""
    axes = [axis for mate in (one, other) if (axis := assembly.occurrences[mate.child].definition.mirror) is not None]
    if len(axes) != 1 or dist(one.X_PJ.translation, other.X_PJ.translation) < CLOSE:
        return 0
    first, second = (multiply(transpose(assembly.rest[m.parent].rotation), assembly.rest[m.child].rotation) for m in (one, other))
    before, normal = (transpose(mate.X_PJ.rotation)[2] for mate in (one, other))
    for plane in map(Mirror, "xyz"):
        if maximum(dist(plane.vector(one.X_PJ.translation), other.X_PJ.translation), dist(plane.vector(before), normal)) > CLOSE:
            continue
        image = [tuple(sign * entry for entry in Mirror(axes[0]).vector(row)) for sign, row in zip(plane.signs, first)]
        for turn in (0, 90, 180, -90):
            turned = multiply(Twist(angular=normal).exponential(radians(turn)).rotation, second)
            if maximum(map(dist, turned, image)) < CLOSE:
                return turn
    return 0

"""Find the mounts at joints that were designed for other parts, and the positions of a joint at which such parts begin to overlap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, floor, inf, radians

from thingc.base.diagnostics import Note
from thingc.model.assembly.interfaces import mount_name
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.types import JointRange
from thingc.model.robot.types import Keyframe, Robot
from thingc.model.solids.clearance import ComparedPair, Sweep, prove
from thingc.model.solids.contact_cells import divide

Notes = tuple[Note, ...]


def mount_references(assembly: Assembly) -> dict[tuple[int, int], Notes]:
    """Return the pairs of components, as sorted indices, that must not overlap because a mount at a joint was designed for another part.

    These are the part with the mount and the components on the link of its neighbour, and the neighbour and the components on the link of
    the part. The notes of a pair describe the mount and the joint, with their lines.
    """
    found: dict[tuple[int, int], Notes] = {}
    for mate in (mate for mate in assembly.mates if mate.joints):
        for owner, mount, other in ((mate.parent, mate.parent_mount, mate.child), (mate.child, mate.child_mount, mate.parent)):
            part = assembly.occurrences[owner]
            for one in part.record.expectations if part.record is not None else ():
                if one.mount == mount:
                    mine, theirs = (assembly.links[assembly.link_of[index]].members for index in (owner, other))
                    notes = (
                        Note(message=f"`{mount_name(part, mount)}` was designed for `{one.label}`", span=part.origin[0]),
                        Note(message=f"joint `{mate.name}` connects the two parts", span=mate.origin[0]),
                    )
                    pairs = [*((owner, beside) for beside in theirs), *((fixed, other) for fixed in mine)]
                    found |= {(min(pair), max(pair)): notes for pair in pairs}
    return found


def first_overlaps(robot: Robot, frame: Keyframe, ranges: Sequence[JointRange], pairs: Sequence[ComparedPair]) -> tuple[str, str] | None:
    """Describe where overlaps at the joint of the first pair begin, and the limits of the joint between which none of the pairs overlap.

    The search begins at the position 0, or at the nearest position of the range, and has an accuracy of 0.1 deg or 0.1 mm. Pairs at other
    joints are ignored. Return None if several joints move the first pair.
    """
    every, first = Sweep(robot, frame, ranges), pairs[0]
    moving, _ = every.moving(first.one, first.other)
    if len(moving) != 1:
        return None
    whole = ranges[min(moving)]
    joint = next(joint for joint in joints_of(robot.assembly) if joint.path == whole.joint)
    step, show = radians(0.1) if joint.turns else 1e-4, joint.twist.format
    beside = [pair for pair in pairs if every.moving(pair.one, pair.other)[0] == moving]

    def position(number: int) -> float:
        return min(max(number * step, whole.lower), whole.upper)

    def overlap(start: int, end: int) -> bool:
        low, high = sorted((position(start), position(end)))
        sweep = Sweep(robot, frame, [JointRange(joint=whole.joint, lower=low, upper=high)])
        again = [replace(pair, gap=inf, depth=0.0, found=False, apart=False, near=False, seen=0) for pair in beside]
        prove(sweep, [pair for pair in again if not divide(sweep, pair)])
        return any(pair.verdict == "touches" for pair in again)

    ends = floor(whole.lower / step), ceil(whole.upper / step)
    start = min(max(0, ends[0]), ends[1])
    limits, begins = [], []
    for end in ends:
        good, bad = (start, end) if overlap(start, end) else (end, end)
        while abs(bad - good) > 1:
            middle = (good + bad) // 2
            good, bad = (good, middle) if overlap(start, middle) else (middle, bad)
        limits.append(show(position(good)))
        begins += [show(position(bad))] if good != bad else []
    worst, cut = f"{joint.name} {show(first.q[whole.joint])}", "or cut a clearance into one of the two parts"
    if limits[0] == limits[1]:
        return f"{worst}, and at {limits[0]}", f"attach the part that the mount was designed for, {cut}"
    help = f"write `limit: {{lower: {limits[0]}, upper: {limits[1]}}}` at joint `{joint.name}`, {cut}"
    return f"{worst}; overlaps begin at {' and '.join(begins)}", help

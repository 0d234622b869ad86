"""Find the mounts at joints that were designed for other parts, and the positions of a joint at which such parts begin to overlap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, floor, inf, radians

from thingc.base.diagnostics import Note
from thingc.base.memo import Memo
from thingc.model.assembly.interfaces import mount_name
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.types import JointRange
from thingc.model.robot.types import Keyframe, Robot
from thingc.model.solids.clearance import SolidPair, Sweep
from thingc.model.solids.contact_cells import prove_pairs

Notes = tuple[Note, ...]


def mount_references(assembly: Assembly) -> dict[tuple[int, int], Notes]:
    """Return the pairs of components (sorted indices) to compare at joints whose mounts were designed for other parts, with their notes.

    At such a joint, the part with the mount is compared with all components on the link of its neighbour, and the neighbour with all
    components on the link of the part. The notes of a pair describe the mount and the joint, with their source lines.
    """
    references: dict[tuple[int, int], Notes] = {}
    for mate in (mate for mate in assembly.mates if mate.joints):
        for owner, mount, neighbour in ((mate.parent, mate.parent_mount, mate.child), (mate.child, mate.child_mount, mate.parent)):
            part = assembly.occurrences[owner]
            for expectation in part.record.expectations if part.record is not None else ():
                if expectation.mount == mount:
                    part_link, neighbour_link = (assembly.links[assembly.link_of[index]].members for index in (owner, neighbour))
                    notes = (
                        Note(message=f"`{mount_name(part, mount)}` was designed for `{expectation.label}`", span=part.origin[0]),
                        Note(message=f"joint `{mate.name}` connects the two parts", span=mate.origin[0]),
                    )
                    pairs = [*((owner, member) for member in neighbour_link), *((own_member, neighbour) for own_member in part_link)]
                    references |= {(min(pair), max(pair)): notes for pair in pairs}
    return references


def first_overlaps(robot: Robot, frame: Keyframe, ranges: Sequence[JointRange], pairs: Sequence[SolidPair]) -> tuple[str, ...] | None:
    """Return the joint position of the largest overlap of the first pair, the positions at which overlaps begin, and a help with limits.

    Within these limits, none of the pairs that only this joint moves overlap. The search begins at the position 0, or at the nearest
    position of the range, and has an accuracy of 0.1 deg or 0.1 mm. Return None if several joints move the first pair.
    """
    sweep_all, worst = Sweep(robot, frame, ranges), pairs[0]
    moving = sweep_all.joints_between(worst.one, worst.other)[1]
    if len(moving) != 1:
        return None
    joint_range = ranges[min(moving)]
    joint = next(joint for joint in joints_of(robot.assembly) if joint.path == joint_range.joint)
    step, show = radians(0.1) if joint.turns else 1e-4, joint.twist.format
    cache = Memo()
    joint_pairs = [pair for pair in pairs if sweep_all.joints_between(pair.one, pair.other)[1] == moving]

    def position(number: int) -> float:
        return min(max(number * step, joint_range.lower), joint_range.upper)

    def overlap(start: int, end: int) -> bool:
        low, high = sorted((position(start), position(end)))
        sweep = Sweep(robot, frame, [JointRange(joint=joint_range.joint, lower=low, upper=high)])
        copies = [replace(pair, gap=inf, depth=0.0, found=False, apart=False, near=False, seen=0) for pair in joint_pairs]
        prove_pairs(sweep, copies, cache=cache)
        return any(pair.verdict == "touches" for pair in copies)

    ends = floor(joint_range.lower / step), ceil(joint_range.upper / step)
    start = min(max(0, ends[0]), ends[1])
    limits, first_positions = [], []
    for end in ends:
        good, bad = (start, end) if overlap(start, end) else (end, end)
        while abs(bad - good) > 1:
            middle = (good + bad) // 2
            good, bad = (good, middle) if overlap(start, middle) else (middle, bad)
        limits.append(show(position(good)))
        first_positions += [show(position(bad))] if good != bad else []
    help = f"write `limit: {{lower: {limits[0]}, upper: {limits[1]}}}` in joint `{joint.name}`"
    if limits[0] == limits[1]:
        first_positions, help = limits[:1], "attach the part that the mount was designed for"
    first = f"overlaps begin at {' and '.join(first_positions)}"
    return f"{joint.name} = {show(worst.q[joint_range.joint])}", first, f"{help}, or cut a clearance into one of the two parts"

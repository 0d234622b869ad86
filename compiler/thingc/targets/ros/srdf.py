"""Write the SRDF file, which MoveIt reads in addition to the URDF. The file contains groups, poses, joints without drives, and pairs of
links that need no collision check.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from thingc.base.diagnostics import Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Origin
from thingc.model.robot.tree import BASE
from thingc.model.robot.types import Robot, Site
from thingc.targets.name_mangling import MangledNames, safe
from thingc.targets.ros.collision_matrix import CollisionMatrix, adjacent, pair_of
from thingc.targets.ros.joints import MovingJoint, joints, values
from thingc.targets.urdf.links import WORLD
from thingc.targets.xml_writer import Element

ALWAYS = 0.95
"""A pair counts as always colliding if it collides in at least this fraction of the configurations, as in MoveIt's setup assistant."""


class Group(FrozenStruct):
    """A named group of joints in the SRDF. `tip` is the mount at the end of a chain of joints. `tip` is None for the group of all
    joints.
    """

    name: str
    tip: str | None
    joints: tuple[MovingJoint, ...]
    origin: Origin


def srdf(robot: Robot, colliding_links: frozenset[str], collisions: CollisionMatrix | None, report: Report) -> Element:
    """Create the `<robot>` element of the SRDF file of a mode.

    `colliding_links` contains the names of the links that have collision shapes. `collisions` is their collision matrix, or None if it is
    unknown. If two groups have the same name, an error is reported.
    """
    root = Element(tag="robot", attributes={"name": robot.assembly.name}, origin=robot.mode.origin)
    moving = joints(robot)
    mode_groups = groups(robot, moving, report)
    base = safe(robot.assembly.links[robot.bodies[0].link].name)
    for group in mode_groups:
        element = root.add("group", {"name": group.name}, group.origin)
        if group.tip is not None:
            element.add("chain", {"base_link": base, "tip_link": group.tip})
        else:
            for joint in group.joints:
                element.add("joint", {"name": joint.name})
    for frame in robot.keyframes:
        joint_values = values(robot, frame.q)
        for group in mode_groups:
            state = root.add("group_state", {"name": frame.name, "group": group.name}, frame.origin)
            for joint in group.joints:
                if not joint.follows:
                    state.add("joint", {"name": joint.name, "value": joint_values[joint.name]})
    if robot.base == "free":
        root.add("virtual_joint", {"name": BASE, "type": "floating", "parent_frame": WORLD, "child_link": base}, robot.mode.origin)
    for joint in moving:
        if joint.drive is None and not joint.follows:
            root.add("passive_joint", {"name": joint.name}, joint.move.joint.origin)
    for first, second, reason in _unchecked_pairs(robot, colliding_links, collisions):
        root.add("disable_collisions", {"link1": first, "link2": second, "reason": reason})
    return root


def groups(robot: Robot, moving: tuple[MovingJoint, ...], report: Report) -> list[Group]:
    """Return the joint groups of a mode for MoveIt. The first group contains all joints and has the name of the robot.

    This group comes first because some readers only use the first of several states with the same name. Each other group contains the
    joints from the root to an exported mount that moves relative to the root. If several mounts have the same frame, only the first mount
    has a group. The joints of a moving base are not in any group.
    """
    names = MangledNames("group name", "SRDF", report)
    of_body: dict[int, tuple[MovingJoint, ...]] = {}
    for index, body in enumerate(robot.bodies):
        parent_joints = of_body[body.parent] if body.parent is not None else ()
        of_body[index] = (*parent_joints, *(joint for joint in moving if joint.body == index and body.parent is not None))
    result: list[Group] = []
    tree_joints = tuple(joint for joint in moving if robot.bodies[joint.body].parent is not None)
    if tree_joints:
        name = names.take(robot.assembly.name, robot.mode.origin, "the group of all joints")
        result.append(Group(name=name, tip=None, joints=tree_joints, origin=robot.mode.origin))
    for site in _exported_mounts(robot):
        if any(not joint.follows for joint in of_body[site.body]):
            name = names.take(site.path, site.origin)
            result.append(Group(name=name, tip=safe(site.path), joints=of_body[site.body], origin=site.origin))
    return result


def _exported_mounts(robot: Robot) -> Iterator[Site]:
    """Yield the mounts that the documents export.

    The mounts of the robot's own document come first. A mount with the same frame as an earlier mount is omitted.
    """
    exported = {mount.path for mount in robot.assembly.exported}
    known: set[object] = set()
    for site in sorted((site for site in robot.sites if site.path in exported), key=lambda site: site.path.count("/")):
        if (site.body, site.pose) not in known:
            known.add((site.body, site.pose))
            yield site


def _unchecked_pairs(robot: Robot, colliding_links: frozenset[str], collisions: CollisionMatrix | None) -> Iterator[tuple[str, str, str]]:
    """Yield the pairs of links that MoveIt does not need to check for collisions. Each pair has a reason in the terms of MoveIt's setup
    assistant.

    The pairs are in the order of the links in the robot. A link that a free joint separates from another link may touch it anywhere.
    """
    names, mode = [safe(link.name) for link in robot.assembly.links], robot.mode
    neighbours, excluded = adjacent(robot.assembly), {pair_of(names[first], names[second]) for first, second in mode.exclude}
    carrier_of = {names[body.link]: number for body, number in zip(robot.bodies, robot.carriers, strict=True)}
    for first, second in combinations([names[body.link] for body in robot.bodies if names[body.link] in colliding_links], 2):
        pair = pair_of(first, second)
        if pair in neighbours:
            yield first, second, "Adjacent"
        elif pair in excluded:
            yield first, second, "User"
        elif collisions is None or carrier_of[first] != carrier_of[second]:
            continue
        elif pair in collisions.at[mode.name]:
            yield first, second, "Default"
        elif collisions.counts.get(pair, 0) >= ALWAYS * collisions.samples:
            yield first, second, "Always"
        elif pair not in collisions.counts and collisions.apart.get(pair, True):
            yield first, second, "Never"

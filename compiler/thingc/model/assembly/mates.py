"""Create the edges of the mate graph from `attach`, `at` and joints. The mount B of the child C is mated to the mount A of the parent P:

    X_PC = X_PA @ Rz(turn) @ Tz(gap) @ X_J(q + offset) @ MATE @ inv(X_CB)

For a mirrored joint, X_J is between two half turns about x. For a joint with an `axis`, Rz, Tz and X_J are about this axis, and MATE is
omitted. The key `at` places the frame of a component directly: `X_PC = X_P,in @ X(xyz, rpy)`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby

from thingc.base.diagnostics import Code, make_notes
from thingc.base.graphs import MAX_CYCLE, find_cycles
from thingc.base.joints.twist import Twist
from thingc.base.memo import Memo
from thingc.base.pose import IDENTITY, MATE, NO_POSE, Pose, make_translation, turned_x
from thingc.base.source import Origin
from thingc.model.assembly.drives import joint_edge, stated_edge
from thingc.model.assembly.instance_tree import Instance, Tree, unplaced_components
from thingc.model.assembly.kinematics import on_loops
from thingc.model.assembly.links import rigid_groups
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import JointEdge, Link, Mate, MountAt
from thingc.model.resolve.types import AssemblyDefinition, At, Attach, Component, Joint, Reference

UPSIDE_DOWN = turned_x(math.pi)
"""The rotation from a mount to the frame in which a mirrored joint moves. The rotation is its own inverse."""

FIXED = "_fixed"
"""Suffix of the name of the fixed joint of a component with `keep`. A component can have the same name as a joint."""


def mates_of(tree: Tree, memo: Memo) -> tuple[tuple[Mate, ...], frozenset[int]]:
    """Return all mates of the robot, which are the edges of the mate graph.

    Also return the indices of the mates that `at` creates, which do not connect mounts.

    For each assembly, mates from `attach` and `at` come first, in the order of the components. Then come mates of joints, in the order of
    the document, and then mates of nested assemblies. Mates with an invalid reference, which has been reported, are omitted.
    """
    mates: list[Mate] = []
    placed_by_at: set[int] = set()
    checked: set[int] = set()
    for instance, definition in tree.assemblies:
        if id(definition) not in checked:
            checked.add(id(definition))
            _check_cycles(instance, definition, tree.findings)
        for reference in definition.loose:
            tree.find(instance, reference)  # resolve both ends, so that both invalid references are reported
        for component in definition.components:
            if isinstance(component.placement, Attach):
                mates.extend(_attach_mates(tree, instance, component.placement, memo))
            elif isinstance(component.placement, At):
                count = len(mates)
                mates.extend(_placement_mates(tree, instance, component, component.placement, memo))
                placed_by_at.update(range(count, len(mates)))
        for _, coordinates in groupby(definition.joints, key=lambda joint: joint.name.joint):
            mates.extend(_joint_mates(tree, instance, tuple(coordinates), memo))
    return tuple(mates), frozenset(placed_by_at)


def _attach_mates(tree: Tree, instance: Instance, attach: Attach, memo: Memo) -> Iterator[Mate]:
    child, parent = tree.find(instance, attach.mount), tree.find(instance, attach.to)
    if child is not None and parent is not None:
        place, path = ("mate", instance.within(attach.mount.text)), instance.within(f"{attach.mount.path[0]}{FIXED}")
        yield memo(place, _mate, parent, child, attach, (), attach.origin + instance.origin, path)


def _placement_mates(tree: Tree, instance: Instance, component: Component, at: At, memo: Memo) -> Iterator[Mate]:
    origin = Reference(path=(component.name,), mount="origin", origin=component.origin)
    child, parent = tree.find(instance, origin), tree.find(instance, at.to)
    if child is not None and parent is not None:
        place = ("mate", instance.within(component.name))
        path = instance.within(f"{component.name}{FIXED}") if at.keep else None
        yield memo(place, _mate_at_pose, parent, child, at.pose, at.origin + instance.origin, path)


def _joint_mates(tree: Tree, instance: Instance, coordinates: Sequence[Joint], memo: Memo) -> Iterator[Mate]:
    """Yield the mate of a joint, which contains a `JointEdge` for each coordinate of the joint.

    The mate of a `fixed` joint does not contain joint edges.
    """
    joint = coordinates[0]
    child, parent = tree.find(instance, joint.child), tree.find(instance, joint.parent)
    if child is None or parent is None:
        return
    if joint.child.path[:1] == joint.parent.path[:1] and not joint.loop:  # a loop may connect two parts of one nested assembly
        tree.findings.incomplete = True
        tree.findings.error(
            Code.PLACED_ON_ITSELF,
            f"joint `{joint.name.joint}` connects component `{joint.child.path[0]}` with itself (`{joint.parent.text}` and "
            f"`{joint.child.text}`)", joint.parent.origin + instance.origin, path=instance.within(joint.path),
            help="use mounts of two different components", notes=make_notes("the child is set here", joint.child.origin),
        )
        return
    edges = tuple(joint_edge(tree, instance, coordinate, coordinate.twist) for coordinate in coordinates if coordinate.twist is not None)
    path = instance.within(joint.name.joint.replace(".", "/"))
    origin = joint.origin + instance.origin
    yield memo(("joint", path), _mate, parent, child, joint, edges, origin, path)


def stated_joints(tree: Tree, joints: Sequence[JointEdge]) -> tuple[JointEdge, ...]:
    """Return the given joints, and all joints whose mounts are on parts with unknown geometry.

    For all these joints, the limits are known from the documents.
    """
    edges = {joint.path: joint for joint in joints}
    for instance, definition in tree.assemblies:
        for joint in definition.joints:
            path = instance.within(joint.path)
            if joint.twist is not None and path not in edges:
                edges[path] = stated_edge(instance, joint, joint.twist)
    return tuple(edges.values())


def check_loops(mates: Sequence[Mate], link_of: Sequence[int], links: Sequence[Link], findings: LinkReport) -> None:
    """Report each joint that closes a loop although its mounts do not move relative to each other, and each free joint in a loop."""
    looping, groups = on_loops(len(link_of), mates), rigid_groups(len(links), link_of, mates)
    for mate in mates:
        parent, other = (link_of[end] for end in (mate.parent, mate.child))
        if mate.free and mate.loop is None and mate.joints[0].path in looping:
            findings.error(
                Code.LOOP, f"the free joint `{mate.name}` is part of a loop", mate.origin, path=mate.name,
                help="remove the joint with `loop: true`, or use another `type`",
            )
        if mate.loop is not None and not mate.free and other in groups[parent]:
            name = links[parent].name
            ends = "itself" if parent == other else f"the fixed link `{links[other].name}`"
            findings.error(
                Code.LOOP, f"joint `{mate.loop}` connects link `{name}` with {ends}", mate.origin, path=mate.loop,
                help="use mounts of two links that move relative to each other, or remove the joint",
                notes=make_notes(f"link `{name}` is defined here", links[parent].origin),
            )


def _mate(parent: MountAt, child: MountAt, attach: Attach | Joint, joints: tuple[JointEdge, ...], origin: Origin, path: str) -> Mate:
    axis = attach.axis if isinstance(attach, Joint) else None
    X_PJ, X_JC = parent.pose, child.pose.inverse() if axis is not None else MATE @ child.pose.inverse()
    if isinstance(attach, Joint) and attach.pose != NO_POSE:
        X_PJ = X_PJ @ attach.pose
    if attach.turn != 0.0:
        X_PJ = X_PJ @ Twist(angular=axis or IDENTITY[2]).exponential(attach.turn)
    if attach.gap != 0.0:
        X_PJ = X_PJ @ (make_translation(0.0, 0.0, attach.gap) if axis is None else Twist(linear=axis).exponential(attach.gap))
    if isinstance(attach, Joint) and attach.mirrored:
        X_PJ, X_JC = X_PJ @ UPSIDE_DOWN, UPSIDE_DOWN @ X_JC
    return Mate(
        parent=parent.occurrence, child=child.occurrence, parent_mount=parent.mount, child_mount=child.mount, X_PJ=X_PJ, X_JC=X_JC,
        joints=joints, origin=origin, name=path if joints or attach.keep else None,
        loop=path if isinstance(attach, Joint) and attach.loop else None, keep=attach.keep,
        base=isinstance(attach, Joint) and attach.base,
    )


def _mate_at_pose(parent: MountAt, child: MountAt, pose: Pose, origin: Origin, path: str | None) -> Mate:
    return Mate(
        parent=parent.occurrence, child=child.occurrence, parent_mount=parent.mount, child_mount="origin",
        X_PJ=parent.pose @ pose, X_JC=child.pose.inverse(), joints=(), origin=origin, name=path, keep=path is not None,
    )


def _placements_of(definition: AssemblyDefinition) -> dict[str, tuple[str, Origin]]:
    """Return a mapping from each component to its parent component and the location of its placement."""
    names = {component.name for component in definition.components}
    placements: dict[str, tuple[str, Origin]] = {}
    for component in definition.components:
        if component.placement is not None and component.placement.to.path:
            placements[component.name] = (component.placement.to.path[0], component.placement.origin)
    for joint in definition.joints:
        if joint.child.path and joint.parent.path and not joint.loop and joint.child.path[0] != joint.parent.path[0]:
            placements.setdefault(joint.child.path[0], (joint.parent.path[0], joint.origin))
    return {name: (parent, origin) for name, (parent, origin) in placements.items() if name in names and parent in names}


def _check_cycles(instance: Instance, definition: AssemblyDefinition, findings: LinkReport) -> None:
    """Report each cycle of components that are placed relative to each other.

    If an earlier pass has reported that the assembly has no base, the cycle is not reported.
    """
    if findings.earlier and not unplaced_components(definition):
        findings.incomplete = True
        return
    placements = _placements_of(definition)
    jointed = {joint.child.path[0] for joint in definition.joints if joint.child.path}
    order = {component.name: number for number, component in enumerate(definition.components)}
    for cycle in find_cycles(placements, lambda name: placements[name][0] if name in placements else None):
        first = cycle.index(min(cycle, key=order.__getitem__))
        cycle = cycle[first:] + cycle[:first]
        hops = ", ".join(f"`{member}` on `{placements[member][0]}`" for member in cycle[:MAX_CYCLE])
        if len(cycle) > MAX_CYCLE:
            hops += f" and {len(cycle) - MAX_CYCLE} more"
        findings.incomplete = True
        findings.error(
            Code.PLACEMENT_CIRCLE, f"components are placed in a cycle: {hops}", placements[cycle[0]][1] + instance.origin,
            path=instance.within(cycle[0]), help="place one of these components on a component outside the cycle" + (
                ", or add `loop: true` to a joint that closes a loop" if jointed & set(cycle) else ""
            ), notes=[note for member in cycle[1:MAX_CYCLE] for note in make_notes(f"`{member}` is placed here", placements[member][1])],
        )

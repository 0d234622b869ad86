"""Check that the links and joints of an imported robot form one tree."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence, Set
from typing import TypeVar

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.graphs import DisjointSets, find_cycles, format_cycle
from thingc.base.grouping import group_by
from thingc.base.safe_text import quote_names
from thingc.base.source import Span
from thingc.base.suggestions import did_you_mean
from thingc.tools.importing.source_model import Attachment, SourceLink, SourceRobot

Named = TypeVar("Named", SourceLink, Attachment)
MOST_LINKS = 10_000
MOST_BELOW = 496
"""Maximum nesting of bodies, including the root. MuJoCo cannot read more than 500 levels of XML."""


def root_of(links: Sequence[SourceLink], attachments: Sequence[Attachment], where: Span, report: Report) -> str | None:
    """Return the name of the root link of an imported robot. If links and joints do not form one tree, report the errors and return None.

    Errors are duplicate names, joints of missing links, links with two parents, cycles, and zero or several roots.
    """
    before = len(report.diagnostics)
    if len(links) > MOST_LINKS:
        report.add(Code.SOURCE_TREE, f"the number of links ({len(links):,}) exceeds the maximum ({MOST_LINKS:,})", where)
        return None
    named = _distinct("links", links, report)
    _distinct("joints", attachments, report)
    above: dict[str, Attachment] = {}
    for one in attachments:
        for side, name in (("parent", one.parent), ("child", one.child)):
            if name not in named:
                message = f"the {side} link `{name}` of joint `{one.name}` does not exist"
                report.add(Code.SOURCE_TREE, message, one.ends.get(side, one.where), help=did_you_mean(name, named, what="links"))
        other = above.setdefault(one.child, one)
        if other is not one:
            report.add(
                Code.SOURCE_TREE, f"link `{one.child}` has two parents, `{other.parent}` and `{one.parent}`", one.where,
                notes=[Note(message=f"the link is also the child of joint `{other.name}`", span=other.where)],
                help="remove one of the two joints, and close the loop in the document with `loop: true`",
            )
    if not links:
        report.add(Code.SOURCE_TREE, "the robot has no links", where, help="add a `<link>`")
    if len(report.diagnostics) > before:
        return None
    _circles(named, above, report)
    roots = [link for link in links if link.name not in above]
    if len(roots) > 1:
        names = quote_names([link.name for link in roots], 6)
        report.add(
            Code.SOURCE_TREE, f"the robot has {len(roots)} links without a parent ({names})", roots[1].where,
            notes=[Note(message="a link without a parent is defined here", span=roots[0].where)],
            help="connect the links by a joint, or split the file into one file for each robot",
        )
    return roots[0].name if len(report.diagnostics) == before else None


def warn_of_depth(robot: SourceRobot, report: Report) -> None:
    """Warn if a link is nested too deeply in the kinematic tree for MuJoCo. Only the first such link is reported."""
    below = by_parent(robot.attachments)
    bare = {link.name for link in robot.links if link.is_bare}
    waiting = [(robot.root, 1)]
    while waiting:
        name, depth = waiting.pop()
        for one in below.get(name, ()):
            joins = one.child in bare and all(other.joints for other in below.get(one.child, ()))  # intermediate links do not become bodies
            there = depth + bool(one.joints and not joins)
            if there > MOST_BELOW:
                report.warn(
                    Code.SOURCE_DOUBT, f"the chain of links to `{one.child}` ({there} links) exceeds the maximum of MuJoCo ({MOST_BELOW})",
                    one.where, help="write only URDF or SDF files of the robot",
                )
                return
            waiting.append((one.child, there))


def span_tree(attachments: Sequence[Attachment]) -> tuple[tuple[Attachment, ...], tuple[Attachment, ...]]:
    """Split the joints of a robot with closed loops into a spanning tree and the joints that close loops.

    In the tree, parent and child of a joint are exchanged if necessary. The tree also contains joints that are not connected to the root,
    which `root_of` reports.
    """
    tree: list[Attachment] = []
    closing: list[Attachment] = []
    below: set[str] = set()
    numbers = {name: number for number, name in enumerate(dict.fromkeys(name for one in attachments for name in (one.parent, one.child)))}
    bodies = DisjointSets(len(numbers))
    for attachment in attachments:
        if not bodies.join(numbers[attachment.parent], numbers[attachment.child]):
            closing.append(attachment)
            continue
        if attachment.child in below and attachment.parent not in below:
            attachment = attachment.reverse()
        below.add(attachment.child)
        tree.append(attachment)
    return tuple(tree), tuple(closing)


def check_mimics(attachments: Sequence[Attachment], moving: Set[str], report: Report) -> None:
    """Report an error for each joint that mimics itself or a joint that is not in `moving`, and for each cycle of mimic joints."""
    follows = {joint.name: joint.follows for one in attachments for joint in one.joints if joint.follows is not None}
    for circle in find_cycles(follows, lambda name: follows[name].joint if name in follows else None):
        if len(circle) > 1:
            message = f"the mimics of joints form a cycle: {format_cycle(circle)}"
            report.add(Code.SOURCE_VALUE, message, follows[circle[0]].where, help="remove `mimic` from one of the joints")
    for joint in (joint for one in attachments for joint in one.joints):
        if joint.follows is None or joint.name != joint.follows.joint and joint.follows.joint in moving:
            continue
        leader = joint.follows.joint
        problem = "itself" if leader == joint.name else f"`{leader}`, not a moving joint"
        help = did_you_mean(leader, sorted(moving - {joint.name}), what="joints")
        report.add(Code.SOURCE_VALUE, f"joint `{joint.name}` mimics {problem}", joint.follows.where, help=help)


def _distinct(kind: str, things: Sequence[Named], report: Report) -> dict[str, Named]:
    """Return a mapping from name to element. If several elements have the same name, report an error and use the first element."""
    first: dict[str, Named] = {}
    for thing in things:
        if first.setdefault(thing.name, thing) is not thing:
            notes = [Note(message="the first element is here", span=first[thing.name].where)]
            report.add(Code.SOURCE_TREE, f"two {kind} are named `{thing.name}`", thing.where, notes=notes, help=f"rename one of the {kind}")
    return first


def by_parent(attachments: Iterable[Attachment]) -> dict[str, list[Attachment]]:
    """Group the attachments by the name of the parent link. Each group is in source order."""
    return group_by(attachments, lambda attachment: attachment.parent)


def downwards(root: str, attachments: Iterable[Attachment]) -> Iterator[Attachment]:
    """Yield the attachments of the kinematic tree depth first, starting at the root. The children of a link are in source order."""
    below = by_parent(attachments)
    waiting = [*reversed(below.get(root, ()))]
    while waiting:
        attachment = waiting.pop()
        yield attachment
        waiting += reversed(below.get(attachment.child, ()))


def _circles(named: dict[str, SourceLink], above: dict[str, Attachment], report: Report) -> None:
    """Report an error for each cycle of links. The location of the error is the joint of the first link of the cycle."""
    for upwards in find_cycles(named, lambda name: above[name].parent if name in above else None):
        help = "remove one of the joints of the cycle, or attach a link of the cycle to another link"
        report.add(Code.SOURCE_TREE, f"links form a cycle: {format_cycle(upwards[::-1])}", above[upwards[-1]].where, help=help)

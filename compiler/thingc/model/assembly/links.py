"""Compute the links of a robot, which are sets of rigidly connected occurrences: names, frames, mass properties and neighbours."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from thingc.base.diagnostics import Code, make_notes
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.graphs import DisjointSets
from thingc.base.grouping import group_by
from thingc.base.inertia import ZERO, MassProperties, total
from thingc.base.memo import Memo
from thingc.base.pose import NO_POSE, Pose
from thingc.base.source import Origin
from thingc.model.assembly.instance_tree import Tree
from thingc.model.assembly.kinematics import forward_kinematics, neighbourhood, on_loops
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Adhesion, Assembly, Link, LinkedMode, Mate, Occurrence


def connected_components(count: int, mates: Sequence[Mate]) -> tuple[int, ...]:
    """Find the sets of rigidly connected occurrences, which are the links of the robot. For each occurrence, return the index of its link.

    Links are numbered by their first occurrence in document order. The method is union-find with path halving over the mates that do not
    separate links.
    """
    sets = DisjointSets(count)
    for mate in mates:
        if not mate.separates:
            sets.join(mate.parent, mate.child)
    numbers: dict[int, int] = {}
    return tuple(numbers.setdefault(sets.representative(k), len(numbers)) for k in range(count))


class _Naming(FrozenStruct, kw_only=False):
    """The name of a link and the occurrence that defines its frame: an entry of the section `links:`, or the first occurrence."""

    name: str
    occurrence: int
    depth: int
    document: str
    origin: Origin


def links_of(tree: Tree, occurrences: Sequence[Occurrence], mates: Sequence[Mate], memo: Memo) -> Iterator[Link]:
    """Yield the links of the robot, in document order.

    The section `links:` of a document specifies the names and frames of links. If several documents name the same link, the outermost
    document takes precedence. By default, a link has the name and the frame of its first occurrence.
    """
    link_of = connected_components(len(occurrences), mates)
    members: list[list[int]] = [[] for _ in range(max(link_of, default=-1) + 1)]
    for occurrence, number in enumerate(link_of):
        members[number].append(occurrence)
    namings = _namings(tree, link_of)
    neighbours = neighbourhood(len(occurrences), mates)
    rigid = tuple((m.parent, m.child, m.X_PJ, m.X_JC) for m in mates if not m.separates)
    by_name: dict[str, Link] = {}
    for index, inside in enumerate(members):
        first = occurrences[inside[0]]
        naming = namings.get(index) or _Naming(first.path, first.index, 0, "", first.origin)

        def poses_in_link(_: object, frame: int, inside: tuple[int, ...]) -> tuple[Pose, ...]:
            at = forward_kinematics(mates, neighbours, frame, NO_POSE, {}, rigid=True)
            return tuple(at[k] for k in inside)

        poses = memo(("poses", naming.name), poses_in_link, rigid, naming.occurrence, tuple(inside))
        link = memo.same(("link", naming.name), Link(
            name=naming.name, index=index, frame=naming.occurrence, members=tuple(inside), poses=poses,
            properties=memo(("weight", naming.name), _sum_masses, tuple(occurrences[k].properties for k in inside), poses),
            origin=naming.origin,
        ))
        other = by_name.setdefault(link.name, link)
        if other is not link:
            _clash(other, link, named=index in namings, occurrences=occurrences, findings=tree.findings)
        yield link


def _sum_masses(properties: Sequence[MassProperties], poses: Sequence[Pose]) -> MassProperties:
    """Compute the total mass, the common centre of mass and the total inertia of several bodies.

    The mass properties of each body are in the frame of the body, and `poses` contains the poses of these frames.
    """
    return total(body.seen_from(pose) for body, pose in zip(properties, poses, strict=True))


def _namings(tree: Tree, link_of: Sequence[int]) -> dict[int, _Naming]:
    """For each link, return the entry of the section `links:` that specifies its name.

    If there are several entries for a link, the first entry in the outermost document is used.
    """
    chosen: dict[int, _Naming] = {}
    for instance, definition in tree.assemblies:
        depth = instance.path.count("/") + 1 if instance.path else 0
        for entry in definition.links:
            place = tree.component(instance, entry.component)
            if place is None or place.index is None:
                tree.findings.incomplete = True
                continue
            link = link_of[place.index]
            naming = _Naming(instance.within(entry.name), place.index, depth, instance.path, entry.origin + instance.origin)
            earlier = chosen.get(link)
            if earlier is not None and earlier.document == naming.document:
                earlier_name = earlier.name.rsplit("/", 1)[-1]
                tree.findings.error(
                    Code.LINK_NAMED_TWICE, f"the names `{entry.name}` and `{earlier_name}` refer to the same link",
                    naming.origin, path=naming.name, help="remove one of the two names",
                    notes=make_notes(f"`{earlier_name}` is defined here", earlier.origin),
                )
            elif earlier is None or naming.depth < earlier.depth:
                chosen[link] = naming
    return chosen


def _clash(earlier: Link, link: Link, *, named: bool, occurrences: Sequence[Occurrence], findings: LinkReport) -> None:
    """Report two links with the same name.

    The section `links:` specifies the name of one link, and the other link has the name of its first occurrence.
    """
    named_link, unnamed_link = (link, earlier) if named else (earlier, link)
    first = occurrences[unnamed_link.members[0]]
    findings.error(
        Code.DUPLICATE_LINK, f"two links have the name `{link.name}`", named_link.origin,
        path=link.name, help="choose another name for one of the links under `links:`",
        notes=make_notes(f"`{first.path}` is defined here", unnamed_link.origin),
    )


def links_between(
    links: Sequence[Link], link_of: Sequence[int], occurrences: Sequence[Occurrence], mates: Sequence[Mate], modes: Sequence[LinkedMode],
    adhesions: Sequence[Adhesion],
) -> frozenset[int]:
    """Return the indices of massless intermediate links.

    Intermediate links do not have mass, geometry, holds, feet or magnets. An intermediate link has exactly two joints, which are neither
    fixed joints nor ball joints nor part of a loop.
    """
    ends: dict[int, list[Mate]] = {link.index: [] for link in links if link.properties.mass == 0.0 and link.properties.inertia == ZERO}
    used = [mount.occurrence for mount in adhesions]
    for mode in modes:
        used += [hold.mount.occurrence for hold in mode.holds] + [foot.mount.occurrence for foot in mode.feet]
    for part in occurrences:
        if part.drawn or part.touching or part.index in used:
            ends.pop(link_of[part.index], None)
    for mate in mates:
        if mate.separates:
            for link in (link_of[mate.parent], link_of[mate.child]):
                if link in ends:
                    ends[link].append(mate)
    ends = {link: joints for link, joints in ends.items() if len(joints) == 2 and not any(mate.keep for mate in joints)}
    looping = on_loops(len(occurrences), mates) if ends else frozenset()
    return frozenset(link for link, joints in ends.items() if not any(
        joint.kind.at_once or joint.path in looping for mate in joints for joint in mate.joints
    ))


def rigid_groups(count: int, link_of: Sequence[int], mates: Sequence[Mate]) -> tuple[tuple[int, ...], ...]:
    """For each of `count` links, return the links that do not move relative to it, including the link itself.

    A group has several links only if a mate with `keep` connects them.
    """
    sets = DisjointSets(count)
    for mate in mates:
        if mate.keep:
            sets.join(link_of[mate.parent], link_of[mate.child])
    members = group_by(range(count), sets.representative)
    return tuple(tuple(members[sets.representative(link)]) for link in range(count))


def joined_links(assembly: Assembly, root: int | None = None) -> Iterator[tuple[int, int]]:
    """Yield each pair of links that a joint connects. Free joints and bases of nested assemblies do not connect links, except fixed bases.

    All links of a rigid group, without fixed bases, count as the link with the joint. If `root` is given, a massless intermediate link is
    replaced by the next link, unless it is the `root`.
    """
    groups = rigid_groups(len(assembly.links), assembly.link_of, [mate for mate in assembly.mates if not mate.base])
    joining = (mate for mate in assembly.mates if mate.separates and not mate.free and (mate.keep or not mate.base))
    ends = [(assembly.link_of[mate.parent], assembly.link_of[mate.child]) for mate in joining]
    at: dict[int, list[tuple[int, int]]] = {}
    for pair in ends:
        for link in pair:
            at.setdefault(link, []).append(pair)
    between = frozenset() if root is None else assembly.between - {root}
    for pair in ends:
        for a in groups[_beyond(between, at, pair[0], pair)]:
            yield from ((a, b) for b in groups[_beyond(between, at, pair[1], pair)] if b != a)


def _beyond(between: Collection[int], at: dict[int, list[tuple[int, int]]], link: int, pair: tuple[int, int]) -> int:
    """Beginning at `link`, follow the joints away from the joint `pair`, and return the first link that is not an intermediate link."""
    while link in between:
        pair = next(other for other in at[link] if other != pair)
        link = pair[0] if pair[1] == link else pair[1]
    return link

"""Several joints on one body: links that weigh nothing and show nothing, and only join two joints."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from thingc.base.inertia import ZERO
from thingc.model.assembly.kinematics import on_loops
from thingc.model.assembly.types import Adhesion, Assembly, Link, LinkedMode, Mate, Occurrence


def links_between(
    links: Sequence[Link], link_of: Sequence[int], occurrences: Sequence[Occurrence], mates: Sequence[Mate], modes: Sequence[LinkedMode],
    adhesions: Sequence[Adhesion],
) -> frozenset[int]:
    """The links (by index) that stand between exactly two joints, on no loop and none of them a ball, and have no mass, no inertia and no
    geometry; nothing holds them, stands on them or pulls at them."""
    ends: dict[int, list[Mate]] = {link.index: [] for link in links if link.properties.mass == 0.0 and link.properties.inertia == ZERO}
    busy = [mount.occurrence for mount in adhesions]
    for mode in modes:
        busy += [hold.mount.occurrence for hold in mode.holds] + [foot.mount.occurrence for foot in mode.feet]
    for one in occurrences:
        if one.drawn or one.touching or one.index in busy:
            ends.pop(link_of[one.index], None)
    for mate in mates:
        if mate.joints or mate.loop is not None:
            for link in (link_of[mate.parent], link_of[mate.child]):
                if link in ends:
                    ends[link].append(mate)
    ends = {link: joints for link, joints in ends.items() if len(joints) == 2}
    looping = on_loops(len(occurrences), mates) if ends else frozenset()
    return frozenset(link for link, joints in ends.items() if not any(
        joint.kind.at_once or joint.path in looping for mate in joints for joint in mate.joints
    ))


def neighbours(assembly: Assembly, root: int) -> Iterator[tuple[int, int]]:
    """The links on both sides of every joint, in the order of the joints: beyond those that only join it to another one, but for the link
    `root`, which is held and parts what stands on it."""
    ends = [
        (assembly.link_of[mate.parent], assembly.link_of[mate.child]) for mate in assembly.mates if mate.joints or mate.loop is not None
    ]
    at: dict[int, list[tuple[int, int]]] = {}
    for pair in ends:
        for link in pair:
            at.setdefault(link, []).append(pair)
    between = assembly.between - {root}
    for pair in ends:
        yield _beyond(between, at, pair[0], pair), _beyond(between, at, pair[1], pair)


def _beyond(between: Collection[int], at: dict[int, list[tuple[int, int]]], link: int, pair: tuple[int, int]) -> int:
    """The first link from `link` on, away from the joint between `pair`, that is more than a joint between two others."""
    while link in between:
        pair = next(other for other in at[link] if other != pair)
        link = pair[0] if pair[1] == link else pair[1]
    return link

"""Choose the joints at which a mode cuts its loops, and explain the choice."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

from thingc.base.graphs import DisjointSets
from thingc.model.assembly.types import Assembly, LinkedMode, Mate


class CutPriority(NamedTuple):
    """The priority of a mate in the kinematic tree.

    The most important criterion comes first. Each loop is cut at the mate with the lowest priority.
    """

    uncut: int
    driven: bool
    coupled: bool
    unclosable: int
    limited: bool
    dynamic: bool
    placing: bool
    earlier: int

    def reason_over(self, other: CutPriority) -> str:
        """Return the reason why the loop is cut at the joint `other` instead of this joint."""
        first = next((name for name, mine, theirs in zip(CutPriority._fields, self, other, strict=True) if mine != theirs), "earlier")
        return _WORDS[first]


_WORDS: Mapping[str, str] = {
    "uncut": "is not listed under `cut`",
    "driven": "is driven",
    "coupled": "is coupled to another joint by `mimic`",
    "unclosable": "is not a hinge or ball joint, which are preferred for cuts",
    "limited": "has limits",
    "dynamic": "has dynamics",
    "placing": "places its child",
    "earlier": "is defined earlier",
}


def spanning(assembly: Assembly, mode: LinkedMode) -> frozenset[int]:
    """Return the indices of the mates that form the kinematic tree of a mode. For a robot without loops, the tree contains all joints.

    For a robot with loops, the result is Kruskal's maximum spanning tree with the weights `CutPriority`, which omits one joint of each
    loop. Mates with `keep` are never omitted.
    """
    priorities = dict(cut_priorities(assembly, mode))
    groups = DisjointSets(len(assembly.links))
    fixed = (number for number, mate in enumerate(assembly.mates) if mate.keep)
    ordered = (*fixed, *sorted(priorities, key=priorities.__getitem__, reverse=True))
    return frozenset(number for number in ordered if groups.join(*_ends(assembly, assembly.mates[number])))


def closing(assembly: Assembly, tree_mates: Collection[int], number: int) -> list[Mate]:
    """Return the mates outside the tree `tree_mates` whose loops contain the mate with the index `number`.

    If this mate is not on a loop, the result is empty.
    """
    groups = DisjointSets(len(assembly.links))
    for index in tree_mates:
        if index != number:
            groups.join(*_ends(assembly, assembly.mates[index]))
    candidates = (mate for index, mate in enumerate(assembly.mates) if index not in tree_mates and (mate.joints or mate.loop is not None))
    return [mate for mate in candidates if len({groups.representative(end) for end in _ends(assembly, mate)}) > 1]


def _ends(assembly: Assembly, mate: Mate) -> tuple[int, int]:
    return assembly.link_of[mate.parent], assembly.link_of[mate.child]


def cut_priorities(assembly: Assembly, mode: LinkedMode) -> Iterator[tuple[int, CutPriority]]:
    """Yield the index in `assembly.mates` and the `CutPriority` of each mate with joint coordinates."""
    cut = {entry.joint: rank for rank, entry in enumerate(mode.cut)}
    mates = [(number, mate) for number, mate in enumerate(assembly.mates) if mate.joints]
    followed = {joint.mimic.joint.path for _, mate in mates for joint in mate.joints if joint.mimic is not None}
    driven = {joint.path for _, mate in mates for joint in mate.joints if joint.actuator is not None and mode.has_drive(joint.path)}
    driven |= {path for tendon in assembly.tendons if tendon.transmission and mode.has_drive(tendon.path) for path in tendon.moves}
    for number, mate in mates:
        yield number, CutPriority(
            uncut=cut.get(mate.name or "", len(cut)),
            driven=any(joint.path in driven for joint in mate.joints),
            coupled=any(joint.mimic is not None or joint.path in followed for joint in mate.joints),
            unclosable=_export_difficulty(mate),
            limited=any(joint.limit.bounded for joint in mate.joints),
            dynamic=any(joint.dynamics.acts for joint in mate.joints),
            placing=mate.loop is None,
            earlier=-number,
        )


def _export_difficulty(mate: Mate) -> int:
    """Return how well output formats support a loop that is cut at this joint, from 0 (all formats) to 2.

    The result is 0 for revolute and ball joints, which all formats with loops support. The result is 1 for universal joints, which need a
    tendon in MuJoCo. The result is 2 for all other joints, which some formats do not support.
    """
    first = mate.joints[0]
    if first.kind.at_once or len(mate.joints) == 1 and first.twist.turns and not first.twist.pitch:
        return 0
    return 1 if first.kind.name == "universal" else 2

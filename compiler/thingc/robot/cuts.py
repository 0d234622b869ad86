"""Where a mode cuts its loops: which joints its tree crosses, and why the others are left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from thingc.graph.types import Assembly, LinkedMode


class Worth(NamedTuple):
    """What of a mate only a tree can have, the weightiest first; of two on a loop, that with the lesser (as tuples compare) is cut."""

    uncut: bool
    driven: bool
    coupled: bool
    unclosable: bool
    limited: bool
    dynamic: bool
    placing: bool
    earlier: int

    def over(self, other: Worth) -> str:
        """Why this one stays, and the `other` does not: what it has, for people."""
        first = next((name for name, mine, theirs in zip(Worth._fields, self, other, strict=True) if mine != theirs), "earlier")
        return _WORDS[first]


_WORDS: Mapping[str, str] = {
    "uncut": "is not named by `cut`",
    "driven": "is driven",
    "coupled": "mimics or is followed",
    "unclosable": "is no turn and no ball, which targets can close",
    "limited": "has limits",
    "dynamic": "has dynamics",
    "placing": "places its child",
    "earlier": "stands before it",
}


def spanning(assembly: Assembly, mode: LinkedMode) -> frozenset[int]:
    """The numbers of the mates that a mode's tree crosses: all joints of a robot without loops, else Kruskal's maximal tree by their
    `Worth`: of each loop the joint is left out that is worth least."""
    worth = dict(worths(assembly, mode))
    group = list(range(len(assembly.links)))

    def find(k: int) -> int:
        while group[k] != k:
            group[k] = group[group[k]]
            k = group[k]
        return k

    taken: set[int] = set()
    for number in sorted(worth, key=worth.__getitem__, reverse=True):
        mate = assembly.mates[number]
        one, other = find(assembly.link_of[mate.parent]), find(assembly.link_of[mate.child])
        if one != other:
            group[max(one, other)] = min(one, other)
            taken.add(number)
    return frozenset(taken)


def worths(assembly: Assembly, mode: LinkedMode) -> Iterator[tuple[int, Worth]]:
    """Of each mate that moves, by its number."""
    cut = {one.joint for one in mode.cut}
    mates = [(number, mate) for number, mate in enumerate(assembly.mates) if mate.joints]
    followed = {joint.mimic.joint.path for _, mate in mates for joint in mate.joints if joint.mimic is not None}
    for number, mate in mates:
        first = mate.joints[0]
        yield number, Worth(
            uncut=mate.name not in cut,
            driven=any(j.actuator is not None and (mode.actuators is None or j.path in mode.actuators) for j in mate.joints),
            coupled=any(joint.mimic is not None or joint.path in followed for joint in mate.joints),
            unclosable=not (first.kind.at_once or (len(mate.joints) == 1 and first.twist.turns and not first.twist.pitch)),
            limited=any(joint.limit.bounded for joint in mate.joints),
            dynamic=any(joint.dynamics.acts for joint in mate.joints),
            placing=mate.loop is None,
            earlier=-number,
        )

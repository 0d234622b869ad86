"""Match the components of the old robot with the components of the new robot.

First, the algorithm matches components with the same name. Then it repeatedly matches components whose definition and mates to matched
components are unique. Finally, the algorithm refines colours of the remaining components until the partition is stable (Weisfeiler and
Leman, 1968). Components of the same colour are matched by a graph isomorphism if the remaining graphs are small, else by their poses.
Uncertain matches have the attribute `perhaps`. Exchanging the old and the new robot does not change the matches.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import dist
from thingc.tools.diff.snapshot import ComponentNode, Snapshot

RESIDUE = 30
"""Maximum number of unmatched components for which a graph isomorphism is searched."""
ROUNDS = 64
"""Maximum number of rounds of colour refinement."""
SAME_PLACE = 1e-3
"""Two components whose distance [m] is below this value are at the same place."""


class Match(FrozenStruct):
    """A component of the old robot that was matched with a component of the new robot.

    The match contains the two paths and a reason. `perhaps` is true if the match is uncertain.
    """

    old: str
    new: str
    reason: str
    perhaps: bool = False


def match(old: Snapshot, new: Snapshot) -> dict[str, Match]:
    """Match the components of the old robot with the components of the new robot.

    Return the matches, keyed by the path of the component in the old robot.
    """
    if _order(new) < _order(old):
        return {
            pair.new: Match(old=pair.new, new=pair.old, reason=pair.reason, perhaps=pair.perhaps)
            for pair in _Matching(new, old).found.values()
        }
    return _Matching(old, new).found


def _order(snapshot: Snapshot) -> list[str]:
    return sorted(node.path for node in snapshot.nodes)


class _Side:
    """The old or the new robot as a graph, which maps each component to its neighbours and to the kind of each connection."""

    def __init__(self, snapshot: Snapshot) -> None:
        self.nodes = {node.path: node for node in snapshot.nodes}
        self.left = dict.fromkeys(self.nodes)
        self.beside: dict[str, list[tuple[tuple[str, ...], str]]] = defaultdict(list)
        for edge in snapshot.edges:
            self._join(edge.parent, edge.child, ("mate", edge.joint, *edge.mounts))
        for node in snapshot.nodes:
            if node.parent:
                self._join(node.parent, node.path, ("holds",))

    def _join(self, above: str, below: str, how: tuple[str, ...]) -> None:
        self.beside[above].append((("down", *how), below))
        self.beside[below].append((("up", *how), above))


class _Matching:
    """Collects the matches between components of the old and the new robot.

    Each method adds matches. The function `match` first calls the methods that find the most certain matches.
    """

    def __init__(self, old: Snapshot, new: Snapshot) -> None:
        self.old, self.new = _Side(old), _Side(new)
        self.found: dict[str, Match] = {}
        self._back: dict[str, str] = {}
        for path in list(self.old.nodes):
            if path in self.new.nodes:
                self._take(path, path, "the same name")
        self._around()
        for what, words in ((_definition, "the same definition"), (_class, "the same class")):
            for exact in (True, False):
                while self._known_neighbours(what, words, exact) or self._around():
                    pass
            while self._colours(what, words) or self._around():
                pass

    def _take(self, old: str, new: str, reason: str, perhaps: bool = False) -> None:
        self.found[old] = Match(old=old, new=new, reason=reason, perhaps=perhaps)
        self._back[new] = old
        del self.old.left[old], self.new.left[new]

    def _around(self) -> bool:
        """Match assemblies that contain matched components, and match components with the same name in matched assemblies.

        Return whether the method found a match.
        """
        before = len(self.found)
        for path in [one for one in self.old.left if self.old.nodes[one].kind == "assembly"]:
            held = (self.found[inner].new for how, inner in self.old.beside[path] if how == ("down", "holds") and inner in self.found)
            within = {self.new.nodes[inner].parent for inner in held}
            if len(within) == 1 and (there := within.pop()) in self.new.left:
                self._take(path, there, "its content")
        for path in list(self.old.left):
            above, _, name = path.rpartition("/")
            known = self.found.get(above)
            if known is not None and known.new != above and (there := f"{known.new}/{name}") in self.new.left:
                self._take(path, there, f"the same name in `{known.new}`", known.perhaps)
        return len(self.found) > before

    # --- neighbours --------------------------------------------------------------------------------------------------

    def _known_neighbours(self, what: Callable[[ComponentNode], Hashable], words: str, exact: bool) -> bool:
        """Match two components if no other component of their robots has the same value `what` and the same mates to matched components.

        If `exact` is true, the names of the mounts must also be equal. Return whether the method found a match.
        """
        before = len(self.found)
        sides = (self._group_by_mates(self.old, what, self._old_name, exact), self._group_by_mates(self.new, what, self._back.get, exact))
        for signature, ones in sides[0].items():
            others = sides[1].get(signature, [])
            if len(ones) == len(others) == 1 and (exact or self._in_one_place(ones[0], others[0])):
                met = min(known for _, known in signature[1])
                how = f"attached to `{met}` as before" if exact else f"beside `{met}`"
                self._take(ones[0], others[0], f"{words}, {how}", perhaps=not (exact and what is _definition))
        return len(self.found) > before

    def _group_by_mates(
        self, side: _Side, what: Callable[[ComponentNode], Hashable], known: Callable[[str], str | None], exact: bool,
    ) -> dict[tuple[Hashable, tuple[tuple[tuple[str, ...], str], ...]], list[str]]:
        """Group the unmatched components by the value of the function `what` and by their mates to matched components.

        Components without a mate to a matched component are omitted.
        """
        signed: dict[Any, list[str]] = defaultdict(list)
        for path in side.left:
            met = [
                (how if exact else how[:1], one) for how, other in side.beside[path]
                if how[1] == "mate" and (one := known(other)) is not None
            ]
            if met:
                signed[what(side.nodes[path]), tuple(sorted(met))].append(path)
        return signed

    def _old_name(self, path: str) -> str | None:
        return path if path in self.found else None

    def _in_one_place(self, old: str, new: str) -> bool:
        """Return whether the assemblies that contain two components were matched with each other."""
        above, there = self.old.nodes[old].parent, self.new.nodes[new].parent
        known = self.found.get(above)
        return (above == "" and there == "") or known is not None and known.new == there

    # --- colours -----------------------------------------------------------------------------------------------------

    def _colours(self, what: Callable[[ComponentNode], Hashable], words: str) -> bool:
        """Match each component whose colour occurs once in each robot.

        If no colour is unique, match the components of one colour by an isomorphism or by position. Return whether the method found a
        match.
        """
        if not self.old.left or not self.new.left:
            return False
        colours = self._refine_colours(what)
        shared = self._group_by(lambda number, path: colours[number, path])
        alone = [(ones[0], others[0]) for ones, others in shared if len(ones) == len(others) == 1]
        if alone:
            # without matched neighbours, the old component may have been removed and the new component added
            for one, other in alone:
                self._take(one, other, f"{words} and mates", perhaps=not self._has_matched_neighbour(one))
            return True
        if shared:
            ones, others = min(shared, key=lambda pair: (len(pair[0]) + len(pair[1]), min(pair[0])))
            if len(ones) == len(others) and self._isomorphic(colours):
                return True
            self._by_place(ones, others, f"{words} and mates, the nearest of {len(ones)} equal ones")
            return True
        return self._by_definition(what, words)

    def _group_by(self, key: Callable[[int, str], Hashable]) -> list[tuple[list[str], list[str]]]:
        """Group the unmatched components of each robot by the function `key`. Return the groups whose key occurs in both robots."""
        groups: dict[Hashable, tuple[list[str], list[str]]] = defaultdict(lambda: ([], []))
        for number, side in enumerate((self.old, self.new)):
            for path in side.left:
                groups[key(number, path)][number].append(path)
        return [(ones, others) for ones, others in groups.values() if ones and others]

    def _by_definition(self, what: Callable[[ComponentNode], Hashable], words: str) -> bool:
        """Match components with equal definitions, and ignore their neighbours. Return whether the method found a match.

        Use this method if no colour occurs in both robots.
        """
        shared = self._group_by(lambda number, path: what((self.old, self.new)[number].nodes[path]))
        before = len(self.found)
        for ones, others in shared:
            if len(ones) == len(others) == 1 and self._in_one_place(ones[0], others[0]):
                self._take(ones[0], others[0], f"{words}, which is unique here", perhaps=True)
            else:
                self._by_place(ones, others, f"{words} in the same place", within=SAME_PLACE)
        return len(self.found) > before

    def _has_matched_neighbour(self, path: str) -> bool:
        """Return whether a mate connects a component of the old robot to a component that is already matched."""
        return any(other in self.found for how, other in self.old.beside[path] if how[1] == "mate")

    def _refine_colours(self, initial: Callable[[ComponentNode], Hashable]) -> dict[tuple[int, str], int]:
        """Refine the colours of the unmatched components. Return a mapping from robot (0: old, 1: new) and component path to colour."""
        numbers: dict[Hashable, int] = {}

        def colour(of: Hashable) -> int:
            return numbers.setdefault(of, len(numbers))

        sides = (self.old, self.new)
        names: tuple[Callable[[str], str | None], ...] = (self._old_name, self._back.get)
        colours = {(k, path): colour(initial(side.nodes[path])) for k, side in enumerate(sides) for path in side.left}
        parts = len(set(colours.values()))
        for round_ in range(ROUNDS):
            refined: dict[tuple[int, str], int] = {}
            for k, side in enumerate(sides):
                for path in side.left:
                    neighbours = sorted((how, names[k](other) or f"#{colours[k, other]}") for how, other in side.beside[path])
                    refined[k, path] = colour((round_, colours[k, path], tuple(neighbours)))
            colours = refined
            if (split := len(set(colours.values()))) == parts:
                break
            parts = split
        return colours

    def _isomorphic(self, colours: Mapping[tuple[int, str], int]) -> bool:
        """Match all remaining components by a graph isomorphism if the graphs are small. Return whether an isomorphism exists.

        Several isomorphisms would differ only by an automorphism of the new robot, so any isomorphism is correct.
        """
        if not len(self.old.left) == len(self.new.left) <= RESIDUE:
            return False
        if Counter(colours[0, path] for path in self.old.left) != Counter(colours[1, path] for path in self.new.left):
            return False
        from networkx import MultiDiGraph
        from networkx.algorithms.isomorphism import MultiDiGraphMatcher

        graphs = []
        for k, side in enumerate((self.old, self.new)):
            graph = MultiDiGraph()
            for path in sorted(side.left):
                place = side.nodes[path].place
                at = None if place is None else tuple(round(x, 6) + 0.0 for x in place.translation)
                graph.add_node(path, colour=colours[k, path], at=at)
            for path in side.left:
                for how, other in side.beside[path]:
                    if other in side.left and how[0] == "down":
                        graph.add_edge(path, other, how=how)
            graphs.append(graph)

        def alike(ones: Mapping[int, Any], others: Mapping[int, Any]) -> bool:
            return sorted(repr(one["how"]) for one in ones.values()) == sorted(repr(one["how"]) for one in others.values())

        for keys in (("colour", "at"), ("colour",)):
            def same(one: Mapping[str, Any], other: Mapping[str, Any], keys: tuple[str, ...] = keys) -> bool:
                return all(one[key] == other[key] for key in keys)

            matcher = MultiDiGraphMatcher(graphs[0], graphs[1], node_match=same, edge_match=alike)
            if matcher.is_isomorphic():
                reason = "the same definition and mates" + (", and the same place" if "at" in keys else ", by an isomorphism")
                for one, other in sorted(matcher.mapping.items()):
                    self._take(one, other, reason, perhaps=True)
                return True
        return False

    def _by_place(self, ones: Sequence[str], others: Sequence[str], reason: str, within: float = math.inf) -> None:
        """Match the remaining components by their positions, the nearest pairs first. These matches are uncertain (`perhaps`).

        A component without a pose has an infinite distance from every other component.
        """
        for distance, one, other in sorted((self._distance(one, other), one, other) for one in ones for other in others):
            if distance <= within and one in self.old.left and other in self.new.left:
                self._take(one, other, reason, perhaps=True)

    def _distance(self, old: str, new: str) -> float:
        a, b = self.old.nodes[old].place, self.new.nodes[new].place
        return dist(a.translation, b.translation) if a is not None and b is not None else math.inf


def _definition(node: ComponentNode) -> Hashable:
    return node.kind, node.text


def _class(node: ComponentNode) -> Hashable:
    return node.kind, node.reference

"""Plain build123d selectors that find a face or an edge of a solid, chosen at the default parameters of a part.

Each selector gets the best possible chance. It sorts along the axis on which the feature is farthest from its neighbours, and its index
counts from the nearer end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import permutations
from typing import Any

from build123d import Axis, Edge, Face, GeomType, Solid
from features import Feature

AXES = {"X": Axis.X, "Y": Axis.Y, "Z": Axis.Z}
SURFACES = {"plane": GeomType.PLANE, "hole": GeomType.CYLINDER, "shaft": GeomType.CYLINDER, "apex": GeomType.CONE}
FACES = (
    "faces()[k]",
    "faces().sort_by(A)[k]",
    "faces().filter_by(T).sort_by(A)[k]",
    "faces().filter_by(T).group_by(A)[i].sort_by(B)[k]",
)
EDGES = (
    "edges()[k]",
    "edges().filter_by(GeomType.CIRCLE).sort_by(A)[k]",
    "edges().filter_by(GeomType.CIRCLE).group_by(A)[i].sort_by(B)[k]",
)


class Lists:
    """A cache of the sorted and grouped faces and edges of one solid."""

    def __init__(self, solid: Solid) -> None:
        self.solid = solid
        self._made: dict[tuple[object, ...], Any] = {}

    def every(self, what: str, kind: GeomType | None) -> Any:
        """Return all faces or edges in the order of the CAD kernel, optionally of one geometry type."""
        if kind is None:
            return self._once((what,), lambda: getattr(self.solid, what)())
        return self._once((what, kind), lambda: self.every(what, None).filter_by(kind))

    def sorted(self, what: str, kind: GeomType | None, axis: str) -> Any:
        return self._once((what, kind, axis), lambda: self.every(what, kind).sort_by(AXES[axis]))

    def group(self, what: str, kind: GeomType | None, axis: str, index: int, then: str) -> Any:
        """Return a group of faces or edges. The groups are formed along `axis`, and the items of the group are sorted along `then`. Raises
        `IndexError` if the group does not exist.
        """
        groups = self._once((what, kind, axis, "groups"), lambda: list(self.every(what, kind).group_by(AXES[axis])))
        chosen = groups[index]
        return self._once((what, kind, axis, index, then), lambda: chosen.sort_by(AXES[then]))

    def groups(self, what: str, kind: GeomType | None, axis: str) -> int:
        """Return the number of groups of faces or edges along an axis."""
        if self.every(what, kind):
            self.group(what, kind, axis, 0, axis)
        return len(self._made.get((what, kind, axis, "groups"), ()))

    def _once(self, key: tuple[object, ...], make: Callable[[], Any]) -> Any:
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pick:
    """A plain build123d selector with its arguments. `margin` [mm] is the distance to the nearest neighbour along the sort axis."""

    selector: str
    what: str
    kind: GeomType | None
    index: int
    axis: str = ""
    group: int = 0
    then: str = ""
    margin: float = 0.0

    def of(self, lists: Lists) -> Face | Edge:
        """Return the face or edge that the selector finds in a solid. Raises `IndexError` if the group does not exist."""
        if not self.axis:
            return lists.every(self.what, self.kind)[self.index]
        if not self.then:
            return lists.sorted(self.what, self.kind, self.axis)[self.index]
        return lists.group(self.what, self.kind, self.axis, self.group, self.then)[self.index]


def chosen(selector: str, lists: Lists, feature: Feature, right: Callable[[Any], bool]) -> Pick | None:
    """Return the selector that a user would write to find a feature in a solid. The function `right` identifies the feature. Return None if
    no face or edge is the feature.
    """
    what = "faces" if selector.startswith("faces") else "edges"
    kind = None
    if "filter_by" in selector:
        kind = SURFACES[feature.kind] if what == "faces" else GeomType.CIRCLE
    hits = [item for item in lists.every(what, None) if right(item)]
    options = list(_options(selector, what, kind, lists, hits))
    # If several selectors have the same margin, use the first axis and the lowest index.
    return max(options, key=lambda pick: pick.margin, default=None)


def _options(selector: str, what: str, kind: GeomType | None, lists: Lists, hits: list[Any]) -> Iterator[Pick]:
    if "sort_by" not in selector:
        for index, _ in _places(lists.every(what, kind), hits):
            yield Pick(selector=selector, what=what, kind=kind, index=index)
    elif "group_by" not in selector:
        for axis in AXES:
            ordered = lists.sorted(what, kind, axis)
            for index, margin in _places(ordered, hits, axis):
                yield Pick(selector=selector, what=what, kind=kind, axis=axis, index=_nearer(index, len(ordered)), margin=margin)
    else:
        for axis, then in permutations(AXES, 2):
            count = lists.groups(what, kind, axis)
            for group in range(count):
                ordered = lists.group(what, kind, axis, group, then)
                for index, margin in _places(ordered, hits, then):
                    here = _coordinate(ordered[index], axis)
                    beside = [lists.group(what, kind, axis, other, then)[0] for other in (group - 1, group + 1) if 0 <= other < count]
                    apart = min((abs(_coordinate(item, axis) - here) for item in beside), default=float("inf"))
                    yield Pick(
                        selector=selector, what=what, kind=kind, axis=axis, group=_nearer(group, count), then=then,
                        index=_nearer(index, len(ordered)), margin=min(margin, apart),
                    )


def _places(ordered: Any, hits: list[Any], axis: str = "") -> Iterator[tuple[int, float]]:
    """Yield the position of each hit in a sorted list, and the distance [mm] to its nearest neighbour along the sort axis."""
    for index, item in enumerate(ordered):
        if any(item.is_same(hit) for hit in hits):
            beside = [ordered[other] for other in (index - 1, index + 1) if 0 <= other < len(ordered)] if axis else []
            here = _coordinate(item, axis) if axis else 0.0
            yield index, min((abs(_coordinate(other, axis) - here) for other in beside), default=float("inf"))


def _nearer(index: int, count: int) -> int:
    return index if index < count - index else index - count


def _coordinate(item: Any, axis: str) -> float:
    return float(getattr(item.center(), axis))

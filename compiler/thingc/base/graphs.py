"""Find cycles in directed graphs, and merge disjoint sets."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from typing import TypeVar

MAX_CIRCLE = 12
"""Maximum number of members of a cycle that are shown."""

T = TypeVar("T", bound=Hashable)


def find_cycles(starts: Iterable[T], after: Callable[[T], T | None]) -> Iterator[list[T]]:
    """Yield each cycle of a directed graph in which every node has at most one successor. A cycle is a list of its nodes.

    The search follows the successors of each node in `starts`. `after(node)` returns the successor of a node, or None. Each cycle is
    yielded once, beginning with the node that the search reaches first.
    """
    done: set[T] = set()
    for start in starts:
        way: dict[T, None] = {}
        at: T | None = start
        while at is not None and at not in done and at not in way:
            way[at] = None
            at = after(at)
        done.update(way)
        if at in way:
            steps = list(way)
            yield steps[steps.index(at):]


def circle_words(names: Sequence[str]) -> str:
    """Format a cycle of names as text, such as `a -> b -> a`, which ends with the first name. The middle of a long cycle is omitted."""
    shown = [f"`{name}`" for name in names]
    if len(shown) > MAX_CIRCLE:
        shown = [*shown[: MAX_CIRCLE - 2], f"... ({len(shown) - MAX_CIRCLE + 1} more)", shown[-1]]
    return " -> ".join([*shown, f"`{names[0]}`"])


class DisjointSets:
    """A union-find data structure that groups the numbers from 0 to `count` - 1 into disjoint sets.

    The smallest number of each set represents the set.
    """

    def __init__(self, count: int) -> None:
        self._above = list(range(count))

    def join(self, one: int, other: int) -> bool:
        """Merge the set that contains `one` with the set that contains `other`.

        Return False if both numbers were already in the same set.
        """
        one, other = self.representative(one), self.representative(other)
        self._above[max(one, other)] = min(one, other)
        return one != other

    def representative(self, number: int) -> int:
        """Return the smallest number of the set that contains `number`."""
        while self._above[number] != number:
            self._above[number] = self._above[self._above[number]]
            number = self._above[number]
        return number

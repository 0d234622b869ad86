"""Find cycles in directed graphs, and merge disjoint sets."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from typing import TypeVar

MAX_CYCLE = 12
"""Maximum number of members of a cycle that are shown."""

T = TypeVar("T", bound=Hashable)


def find_cycles(starts: Iterable[T], successor: Callable[[T], T | None]) -> Iterator[list[T]]:
    """Yield each cycle of a directed graph in which every node has at most one successor. A cycle is a list of its nodes.

    The search follows the successors of each node in `starts`. `after(node)` returns the successor of a node, or None. Each cycle is
    yielded once, beginning with the node that the search reaches first.
    """
    visited: set[T] = set()
    for start in starts:
        path: dict[T, None] = {}
        node: T | None = start
        while node is not None and node not in visited and node not in path:
            path[node] = None
            node = successor(node)
        visited.update(path)
        if node in path:
            steps = list(path)
            yield steps[steps.index(node):]


def format_cycle(names: Sequence[str]) -> str:
    """Format a cycle of names as text, such as `a -> b -> a`, which ends with the first name. The middle of a long cycle is omitted."""
    quoted = [f"`{name}`" for name in names]
    if len(quoted) > MAX_CYCLE:
        quoted = [*quoted[: MAX_CYCLE - 2], f"... ({len(quoted) - MAX_CYCLE + 1} more)", quoted[-1]]
    return " -> ".join([*quoted, f"`{names[0]}`"])


class DisjointSets:
    """A union-find data structure that groups the numbers from 0 to `count` - 1 into disjoint sets.

    The smallest number of each set represents the set.
    """

    def __init__(self, count: int) -> None:
        self._parents = list(range(count))

    def join(self, a: int, b: int) -> bool:
        """Merge the set that contains `a` with the set that contains `b`.

        Return False if both numbers were already in the same set.
        """
        a, b = self.representative(a), self.representative(b)
        self._parents[max(a, b)] = min(a, b)
        return a != b

    def representative(self, number: int) -> int:
        """Return the smallest number of the set that contains `number`."""
        while self._parents[number] != number:
            self._parents[number] = self._parents[self._parents[number]]
            number = self._parents[number]
        return number

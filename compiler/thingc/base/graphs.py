"""Find cycles in graphs, and compute disjoint sets."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from typing import TypeVar

MAX_CIRCLE = 12
"""Maximum number of members of a cycle that are shown."""

T = TypeVar("T", bound=Hashable)


def find_cycles(starts: Iterable[T], after: Callable[[T], T | None]) -> Iterator[list[T]]:
    """Yield every cycle of a graph once, starting at the member that the search reaches first.

    `after` returns the successor of a member, or None.
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
    """Format a cycle of names as a chain that ends with its first name. A long cycle is abbreviated in the middle."""
    shown = [f"`{name}`" for name in names]
    if len(shown) > MAX_CIRCLE:
        shown = [*shown[: MAX_CIRCLE - 2], f"... ({len(shown) - MAX_CIRCLE + 1} more)", shown[-1]]
    return " -> ".join([*shown, f"`{names[0]}`"])


class DisjointSets:
    """Disjoint sets of the numbers 0 to `count` - 1 (union-find). The smallest number of a set represents it."""

    def __init__(self, count: int) -> None:
        self._above = list(range(count))

    def join(self, one: int, other: int) -> bool:
        """Join the sets of two numbers. Return False if they were already in the same set."""
        one, other = self.representative(one), self.representative(other)
        self._above[max(one, other)] = min(one, other)
        return one != other

    def representative(self, number: int) -> int:
        """Return the smallest number in the set of `number`."""
        while self._above[number] != number:
            self._above[number] = self._above[self._above[number]]
            number = self._above[number]
        return number

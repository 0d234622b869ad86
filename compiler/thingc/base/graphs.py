"""Things that lead to one another, what to say where they do so in a circle, and things in disjoint sets."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from typing import TypeVar

MAX_CIRCLE = 12
"""Members of a circle that are shown."""

T = TypeVar("T", bound=Hashable)


def find_cycles(starts: Iterable[T], after: Callable[[T], T | None]) -> Iterator[list[T]]:
    """Every circle once, from the member that is met first, each behind the one that leads to it. `after` is what a thing leads to, None
    where that is nothing."""
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
    """A circle of names as a chain that ends where it begins, its middle left out where it is long."""
    shown = [f"`{name}`" for name in names]
    if len(shown) > MAX_CIRCLE:
        shown = [*shown[: MAX_CIRCLE - 2], f"... ({len(shown) - MAX_CIRCLE + 1} more)", shown[-1]]
    return " -> ".join([*shown, f"`{names[0]}`"])


class DisjointSets:
    """Numbers (0 to `count` - 1) in sets, of which two can be joined; the smallest number in a set represents it."""

    def __init__(self, count: int) -> None:
        self._above = list(range(count))

    def join(self, one: int, other: int) -> bool:
        """Make one set of the two sets of these numbers; False if they were in one already."""
        one, other = self.representative(one), self.representative(other)
        self._above[max(one, other)] = min(one, other)
        return one != other

    def representative(self, number: int) -> int:
        """The smallest number in the set of `number`."""
        while self._above[number] != number:
            self._above[number] = self._above[self._above[number]]
            number = self._above[number]
        return number

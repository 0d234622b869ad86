"""A cache with one entry per place: the last result of a pure function."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

Answer = TypeVar("Answer")

PLACES = 100_000
"""Maximum number of entries; above it the cache is cleared."""


class Memo:
    """A cache with one result per place (`("geom", "hand/cap")`), the last one, with its inputs.

    Compiling a document again changes few of the inputs, so that keeping the last result is enough, and the cache does not grow with the
    number of compilations. Functions must depend on their inputs alone. Inputs and results are shared and must not be modified. Inputs are
    compared by value (identical objects quickly); zeros of either sign are equal, which does not affect any output.
    """

    __slots__ = ("_kept",)

    def __init__(self) -> None:
        self._kept: dict[Hashable, tuple[tuple[Any, ...], Any]] = {}

    def __call__(self, place: Hashable, function: Callable[..., Answer], *inputs: Any) -> Answer:
        """Return `function(*inputs)`; the cached object if the last inputs at this place were equal."""
        known = self._kept.get(place)
        if known is not None and known[0] == inputs:
            kept: Answer = known[1]
            return kept
        answer = function(*inputs)
        self.keep(place, inputs, answer)
        return answer

    def apart(self) -> Memo:
        """Return an empty memo, for results that are valid in one run only."""
        return Memo()

    def last(self, place: Hashable, inputs: tuple[Any, ...]) -> Any | None:
        """Return the result at this place if its inputs were equal, else None; for results stored with `keep`."""
        known = self._kept.get(place)
        return known[1] if known is not None and known[0] == inputs else None

    def keep(self, place: Hashable, inputs: tuple[Any, ...], answer: Any) -> None:
        """Store a result."""
        if len(self._kept) >= PLACES:
            self._kept.clear()
        self._kept[place] = (inputs, answer)

    def same(self, place: Hashable, value: Answer) -> Answer:
        """Return the last object at this place if it equals `value`, else `value`, so that later comparisons are quick."""
        kept: Answer | None = self.last(place, (value,))
        if kept is not None:
            return kept
        self.keep(place, (value,), value)
        return value

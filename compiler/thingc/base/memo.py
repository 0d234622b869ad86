"""A cache for pure functions that keeps the last result per key."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

Answer = TypeVar("Answer")

PLACES = 100_000
"""Maximum number of entries. A larger cache is cleared."""


class Memo:
    """A cache that keeps the last result and its inputs per key (`("geom", "hand/cap")`).

    Few inputs change between two compilations of a document. The last result is therefore enough, and the cache does not grow with the
    number of compilations. Functions must depend only on their inputs. Inputs and results are shared and must not be modified. The cache
    compares inputs by value. The comparison of identical objects is fast. 0.0 and -0.0 are equal, which does not affect any output.
    """

    __slots__ = ("_kept",)

    def __init__(self) -> None:
        self._kept: dict[Hashable, tuple[tuple[Any, ...], Any]] = {}

    def __call__(self, place: Hashable, function: Callable[..., Answer], *inputs: Any) -> Answer:
        """Return `function(*inputs)`, or the cached object if the last inputs for this key were equal."""
        known = self._kept.get(place)
        if known is not None and known[0] == inputs:
            kept: Answer = known[1]
            return kept
        answer = function(*inputs)
        self.keep(place, inputs, answer)
        return answer

    def apart(self) -> Memo:
        """Return a separate empty memo for results that are valid only in one run."""
        return Memo()

    def last(self, place: Hashable, inputs: tuple[Any, ...]) -> Any | None:
        """Return the result that `keep` stored for equal inputs, otherwise None."""
        known = self._kept.get(place)
        return known[1] if known is not None and known[0] == inputs else None

    def keep(self, place: Hashable, inputs: tuple[Any, ...], answer: Any) -> None:
        """Store a result with the inputs from which it was computed."""
        if len(self._kept) >= PLACES:
            self._kept.clear()
        self._kept[place] = (inputs, answer)

    def same(self, place: Hashable, value: Answer) -> Answer:
        """Return the last object for this key if it equals `value`, otherwise `value`. Later comparisons of identical objects are fast."""
        kept: Answer | None = self.last(place, (value,))
        if kept is not None:
            return kept
        self.keep(place, (value,), value)
        return value

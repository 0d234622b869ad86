"""A cache for the results of pure functions that stores only the most recent result for each key."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

Answer = TypeVar("Answer")

PLACES = 100_000
"""Maximum number of entries of the cache. When this number is exceeded, the cache is cleared."""


class Memo:
    """A cache that stores, for each key, the most recent result of a function and the inputs of this call.

    A key is for example `("geom", "hand/cap")`. Few inputs change between two compilations of a document, so the most recent result is
    sufficient, and the cache does not grow with the number of compilations.

    Functions must depend only on their inputs. Inputs and results are shared and must not be modified. The cache compares inputs by value,
    which is fast for identical objects. 0.0 and -0.0 are equal, which does not affect any output.
    """

    __slots__ = ("_entries",)

    def __init__(self) -> None:
        self._entries: dict[Hashable, tuple[tuple[Any, ...], Any]] = {}

    def __call__(self, place: Hashable, function: Callable[..., Answer], *inputs: Any) -> Answer:
        """Return `function(*inputs)`.

        If the most recent call for the key `place` had equal inputs, return the cached result of this call.
        """
        entry = self._entries.get(place)
        if entry is not None and entry[0] == inputs:
            cached: Answer = entry[1]
            return cached
        answer = function(*inputs)
        self.keep(place, inputs, answer)
        return answer

    def make_empty(self) -> Memo:
        """Return a new, empty cache for results that are valid only during one run of the compiler."""
        return Memo()

    def last(self, place: Hashable, inputs: tuple[Any, ...]) -> Any | None:
        """Return the result that `keep` stored for the key `place`, if it was stored with equal inputs, otherwise None."""
        entry = self._entries.get(place)
        return entry[1] if entry is not None and entry[0] == inputs else None

    def keep(self, place: Hashable, inputs: tuple[Any, ...], answer: Any) -> None:
        """Store the result `answer` of a function and the inputs of the call under the key `place`."""
        if len(self._entries) >= PLACES:
            self._entries.clear()
        self._entries[place] = (inputs, answer)

    def same(self, place: Hashable, value: Answer) -> Answer:
        """Return the object that is cached under the key `place` if it equals `value`.

        If the cached object differs, or if nothing is cached, cache and return `value`.

        Returning the same object for equal values makes later comparisons fast.
        """
        cached: Answer | None = self.last(place, (value,))
        if cached is not None:
            return cached
        self.keep(place, (value,), value)
        return value

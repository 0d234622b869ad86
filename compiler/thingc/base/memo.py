"""What pure functions answered last, by place: asked again with equal inputs, they need not work again."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

Answer = TypeVar("Answer")

PLACES = 100_000
"""How many answers are kept: when there are more, all are forgotten."""


class Memo:
    """One answer per place (`("geom", "hand/cap")`), the last one, with the inputs that it belongs to.

    Compiling a document again changes few of the inputs, whatever the settings, so that the last answer is the one worth keeping,
    and what is kept does not grow with the number of compilations. Functions must depend on their inputs alone, and inputs and
    answers are shared: nobody may change them. Inputs are compared by value (the same object is equal at once); zeros of either
    sign are equal, which no artifact tells apart.
    """

    __slots__ = ("_kept",)

    def __init__(self) -> None:
        self._kept: dict[Hashable, tuple[tuple[Any, ...], Any]] = {}

    def __call__(self, place: Hashable, function: Callable[..., Answer], *inputs: Any) -> Answer:
        """`function(*inputs)`, worked out unless the last inputs at this place were equal: then the same object as then."""
        known = self._kept.get(place)
        if known is not None and known[0] == inputs:
            kept: Answer = known[1]
            return kept
        answer = function(*inputs)
        self.keep(place, inputs, answer)
        return answer

    def apart(self) -> Memo:
        """An empty one, for answers that hold in one run alone."""
        return Memo()

    def last(self, place: Hashable, inputs: tuple[Any, ...]) -> Any | None:
        """The answer at this place if its inputs were equal to these, else None; for answers that `keep` notes."""
        known = self._kept.get(place)
        return known[1] if known is not None and known[0] == inputs else None

    def keep(self, place: Hashable, inputs: tuple[Any, ...], answer: Any) -> None:
        """Note an answer."""
        if len(self._kept) >= PLACES:
            self._kept.clear()
        self._kept[place] = (inputs, answer)

    def same(self, place: Hashable, value: Answer) -> Answer:
        """`value`, or the equal object that was last seen at this place, so that what compares it next is quick."""
        kept: Answer | None = self.last(place, (value,))
        if kept is not None:
            return kept
        self.keep(place, (value,), value)
        return value

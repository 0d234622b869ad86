"""Where the places of a text are in another one: the lines at its beginning and its end that have not changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from itertools import takewhile

from thingc.base.source import Span

SpanMap = Callable[[Span], Span | None]


@lru_cache(maxsize=4)
def steady(before: str, after: str) -> SpanMap:
    """Gives the place in `after` of a place in `before`; None where a line of it has changed."""
    if before == after:
        return lambda span: span
    old, new = before.splitlines(), after.splitlines()
    same = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(old, new, strict=False)))
    most = min(len(old), len(new)) - same
    end = min(most, sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(reversed(old), reversed(new), strict=False))))

    def line(number: int) -> int | None:
        if number <= same:
            return number
        return number + len(new) - len(old) if number > len(old) - end else None

    def moved(span: Span) -> Span | None:
        first, last = line(span.line), line(span.end_line)
        return None if first is None or last is None else replace(span, line=first, end_line=last)

    return moved

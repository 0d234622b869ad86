"""What came of comparing, as plain JSON values: it is worked out in a process of its own where nobody trusts the documents."""

from __future__ import annotations

from typing import Any

from thingc.base.source import Span
from thingc.driver.up_to_date import packed, unpacked
from thingc.tools.diff.change import Change, DisplayValue
from thingc.tools.diff.checkouts import BrokenSide
from thingc.tools.diff.comparing import Comparison


def pack(answer: Comparison | BrokenSide) -> list[Any]:
    """The values of an answer for one document."""
    if isinstance(answer, BrokenSide):
        return ["broken", answer.name, [packed(d) for d in answer.diagnostics], dict(answer.texts)]
    return ["compared", answer.name, [_change(change) for change in answer.changes], list(answer.unknown)]


def unpack(values: list[Any]) -> Comparison | BrokenSide:
    """The inverse of `pack`."""
    kind, name, inner, more = values
    if kind == "broken":
        return BrokenSide(name=name, diagnostics=tuple(unpacked(one) for one in inner), texts=more)
    return Comparison(name=name, changes=tuple(_back(one) for one in inner), unknown=tuple(more))


def _change(change: Change) -> list[Any]:
    span = change.span
    place = None if span is None else [span.file, span.line, span.column, span.end_line, span.end_column]
    return [
        change.what, change.change, change.path, change.new_path, change.field, change.old, change.new, change.because, change.reason,
        change.words, place,
    ]


def _back(values: list[Any]) -> Change:
    what, how, path, new_path, field, old, new, because, reason, words, place = values
    span = None if place is None else Span(file=place[0], line=place[1], column=place[2], end_line=place[3], end_column=place[4])
    return Change(
        what=what, change=how, path=path, new_path=new_path, field=field, old=_tuples(old), new=_tuples(new), because=tuple(because),
        reason=reason, words=None if words is None else (words[0], words[1]), span=span,
    )


def _tuples(value: Any) -> DisplayValue:
    return tuple(_tuples(one) for one in value) if isinstance(value, list) else value

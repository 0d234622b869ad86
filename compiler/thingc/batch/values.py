"""Values of variants: from what a document writes to SI, and to the text that says the same value to every other program."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from decimal import Decimal
from fractions import Fraction
from typing import Any

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.units import Quantity, UnitError, exact, parse_quantity, scan_number, scan_unit
from thingc.documents.expressions.evaluation import ExpressionValue, evaluate, plain
from thingc.documents.expressions.terms import Expression, ExpressionError
from thingc.documents.load.documents import Documents
from thingc.documents.spec.settable_values import current_value
from thingc.documents.spec.variants import AxisSpec, VariantsSpec

ID_DIGITS = 12
"""Hexadecimal digits of a variant's id."""


def unit_in(text: str) -> str:
    """The unit of a quantity as it is written; empty where it has none, or is no quantity."""
    number = scan_number(text.strip())
    return "" if number is None else text.strip()[number[1]:].strip()


def size_of(unit: str) -> float | None:
    """One of a unit, in SI: 0.001 of `mm`; None of what is no unit."""
    try:
        return parse_quantity(f"1 {unit}").value
    except UnitError:
        return None


def spaced(first: str, last: str, count: int) -> list[Quantity] | None:
    """`count` values at equal distances from one quantity to another of the same unit, each rounded once; None where the units
    are not the same word.

    So `60 mm` to `90 mm` in four steps has 70 mm, and not its neighbour.
    """
    ends: list[Fraction] = []
    units: list[str] = []
    for text in (first, last):
        number = scan_number(text.strip())
        if number is None:
            return None
        ends.append(Fraction(*exact(number[0])))
        units.append(text.strip()[number[1]:].strip())
    if units[0] != units[1]:
        return None
    numbers = [ends[0] + (ends[1] - ends[0]) * Fraction(k, count - 1) for k in range(count)]
    if not units[0]:
        return [Quantity(float(number) + 0.0) for number in numbers]
    try:
        (numerator, denominator, dimension), _ = scan_unit(units[0], 0)
    except UnitError:
        return None
    if units[0] == "deg":  # as the units of documents: the double that `math.radians` gives
        return [Quantity(math.radians(float(number)) + 0.0, dimension) for number in numbers]
    return [Quantity(float(number * Fraction(numerator, denominator)) + 0.0, dimension) for number in numbers]


def spaced_si(first: Quantity, last: Quantity, count: int) -> list[Quantity]:
    """The same between any two quantities of one dimension, on the decimals of their SI values."""
    a, b = Fraction(Decimal(repr(first.value))), Fraction(Decimal(repr(last.value)))
    return [Quantity(float(a + (b - a) * Fraction(k, count - 1)) + 0.0, first.dimension) for k in range(count)]


def is_whole(text: str | None) -> bool:
    """Whether a number was written without a point or a unit."""
    return text is not None and re.fullmatch(r"[-+]?\d+", text.strip()) is not None


def identity(assembly: str, parameters: Mapping[str, ExpressionValue], choices: Mapping[str, str]) -> str:
    """The id of a variant: 12 hex of the SHA-256 of its settings.

    `assembly` is the document's path in the workspace; `parameters` and `choices` are those that say something else than the
    document itself. The same settings have the same id in whatever batch, and in whatever order they were written.
    """
    settings = {"assembly": assembly, "parameters": {name: plain(value) for name, value in parameters.items()}, "choices": dict(choices)}
    text = json.dumps(settings, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:ID_DIGITS]


class Paths(FrozenStruct):
    """Every path at which a document of variants sets values, in the order written: `kinds` has a value of the kind that stands there,
    `own` those that the assembly says itself, of which `expressions` are worked out."""

    kinds: Mapping[str, ExpressionValue]
    own: Mapping[str, ExpressionValue]
    expressions: Mapping[str, Expression]


def read_paths(spec: VariantsSpec, documents: Documents, parameters: Mapping[str, ExpressionValue]) -> Paths:
    """The paths of a document; `parameters` are the values of the assembly's."""
    given: dict[str, list[ExpressionValue]] = {}
    for name, raw in _entries(spec):
        if "." in name:
            given.setdefault(name, []).extend(value for one in _each(raw) if (value := as_value(one)) is not None)
    stated = {path: current_value(documents, path) for path in given}
    own = {path: value for path, value in stated.items() if value is not None and not isinstance(value, Expression)}
    expressions = {path: value for path, value in stated.items() if isinstance(value, Expression)}
    for path, expression in expressions.items():
        with suppress(ExpressionError):
            own[path] = evaluate(expression, parameters)
    kinds = {path: kind for path, values in given.items() if (kind := _kind(own.get(path), values)) is not None}
    return Paths(kinds=kinds, own={path: of_kind(value, kinds[path]) or value for path, value in own.items()}, expressions=expressions)


def _entries(spec: VariantsSpec) -> Iterator[tuple[str, Any]]:
    yield from spec.parameters.items()
    if spec.sample is not None:
        yield from spec.sample.ranges.items()
    for entry in spec.list_:
        yield from entry.parameters.items()


def _each(raw: Any) -> Iterable[Any]:
    if isinstance(raw, AxisSpec):
        return (raw.from_, raw.to)
    return raw if isinstance(raw, list) else (raw,)


def as_value(raw: Any) -> ExpressionValue | None:
    """A value as documents write it; None for an expression."""
    if isinstance(raw, Expression):
        return None
    return Quantity(float(raw)) if isinstance(raw, (int, float)) and not isinstance(raw, bool) else raw


def _kind(own: ExpressionValue | None, given: Iterable[ExpressionValue]) -> ExpressionValue | None:
    """A value of the kind that values at a path have: the assembly's own, or the first that is given. A bare 0 says nothing of its unit."""
    known = [one for one in (own, *given) if one is not None]
    return next((one for one in known if one != Quantity(0.0)), known[0] if known else None)


def of_kind(value: ExpressionValue, kind: ExpressionValue | None) -> ExpressionValue | None:
    """A value as one of the kind of another; None where it is none."""
    if not isinstance(value, Quantity) or not isinstance(kind, Quantity):
        return value if kind is None or type(value) is type(kind) else None
    if value == Quantity(0.0):
        return Quantity(0.0, kind.dimension)
    return value if value.dimension == kind.dimension else None

"""Convert values in a variants document to SI units, and to strings that represent exactly the same value."""

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
from thingc.base.units import Dimension, Quantity, UnitError, exact, parse_quantity, scan_number, scan_unit
from thingc.documents.expressions.evaluation import ExpressionValue, evaluate, plain
from thingc.documents.expressions.terms import Expression, ExpressionError
from thingc.documents.load.documents import Documents
from thingc.documents.spec.settable_values import current_value
from thingc.documents.spec.variants import AxisSpec, VariantsSpec

ID_DIGITS = 12
"""Number of hexadecimal digits in the id of a variant."""


def unit_in(text: str) -> str:
    """Return the unit in the text of a quantity, such as `mm` for `70 mm`.

    For a number without a unit, and for a string that is not a quantity, return an empty string.
    """
    number = scan_number(text.strip())
    return "" if number is None else text.strip()[number[1]:].strip()


def size_of(unit: str) -> float | None:
    """Return the size of a unit in SI units, such as 0.001 for `mm`. Return None if the string is not a unit."""
    try:
        return parse_quantity(f"1 {unit}").value
    except UnitError:
        return None


def standard_unit(dimension: Dimension) -> str:
    """Return the common name of the SI unit of a physical dimension, such as `N*m`, `kg` or `Hz`.

    For plain numbers, return an empty string.
    """
    usual = unit_in(dimension.example)
    return next((unit for unit in (usual, usual[1:]) if unit and size_of(unit) == 1.0), dimension.symbol)


def evenly_spaced(first: str, last: str, count: int) -> list[Quantity] | None:
    """Return `count` evenly spaced quantities between two quantities, given as strings with the same unit.

    Each quantity is rounded only once. For example, four values from `60 mm` to `90 mm` include exactly 70 mm. Return None if the two
    strings have different units.
    """
    low, high, unit = scan_number(first.strip()), scan_number(last.strip()), unit_in(first)
    if low is None or high is None or unit != unit_in(last):
        return None
    numbers = _evenly_spaced(Fraction(*exact(low[0])), Fraction(*exact(high[0])), count)
    if not unit:
        return [Quantity(float(number) + 0.0) for number in numbers]
    try:
        (numerator, denominator, dimension), _ = scan_unit(unit, 0)
    except UnitError:
        return None
    if unit == "deg":  # use `math.radians`, as for units in documents
        return [Quantity(math.radians(float(number)) + 0.0, dimension) for number in numbers]
    return [Quantity(float(number * Fraction(numerator, denominator)) + 0.0, dimension) for number in numbers]


def spaced_si(first: Quantity, last: Quantity, count: int) -> list[Quantity]:
    """Return `count` evenly spaced quantities between two quantities of the same physical dimension.

    The quantities are computed from the decimal representation of the SI values.
    """
    numbers = _evenly_spaced(Fraction(Decimal(repr(first.value))), Fraction(Decimal(repr(last.value))), count)
    return [Quantity(float(number) + 0.0, first.dimension) for number in numbers]


def _evenly_spaced(first: Fraction, last: Fraction, count: int) -> list[Fraction]:
    return [first + (last - first) * Fraction(k, count - 1) for k in range(count)]


def is_whole(text: str | None) -> bool:
    """Return True if a number, given as a string, has neither a decimal point nor a unit."""
    return text is not None and re.fullmatch(r"[-+]?\d+", text.strip()) is not None


def identity(assembly: str, parameters: Mapping[str, ExpressionValue], choices: Mapping[str, str]) -> str:
    """Return the id of a variant, which consists of 12 hexadecimal digits of the SHA-256 of its settings.

    `assembly` is the path of the assembly document in the workspace. `parameters` and `choices` contain the settings that differ from the
    documents. The same settings have the same id in every batch, in any order.
    """
    settings = {"assembly": assembly, "parameters": {name: plain(value) for name, value in parameters.items()}, "choices": dict(choices)}
    text = json.dumps(settings, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:ID_DIGITS]


class Paths(FrozenStruct):
    """The paths in the assembly document at which a variants document sets values, in order.

    `kinds` contains an example value for each path, which determines the type. `own` contains the values in the assembly document by path.
    `expressions` contains those values in the assembly document that are expressions.
    """

    kinds: Mapping[str, ExpressionValue]
    own: Mapping[str, ExpressionValue]
    expressions: Mapping[str, Expression]


def read_paths(spec: VariantsSpec, documents: Documents, parameters: Mapping[str, ExpressionValue]) -> Paths:
    """Return the paths at which a variants document sets values. `parameters` contains the values of the parameters of the assembly."""
    values_by_path: dict[str, list[ExpressionValue]] = {}
    for name, raw in _entries(spec):
        if "." in name:
            values_by_path.setdefault(name, []).extend(value for entry in _each(raw) if (value := as_value(entry)) is not None)
    document_values = {path: current_value(documents, path) for path in values_by_path}
    values = {path: value for path, value in document_values.items() if value is not None and not isinstance(value, Expression)}
    expressions = {path: value for path, value in document_values.items() if isinstance(value, Expression)}
    for path, expression in expressions.items():
        with suppress(ExpressionError):
            values[path] = evaluate(expression, parameters)
    kinds = {path: kind for path, others in values_by_path.items() if (kind := _kind(values.get(path), others)) is not None}
    return Paths(kinds=kinds, own={path: of_kind(value, kinds[path]) or value for path, value in values.items()}, expressions=expressions)


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
    """Convert a value in a document to a quantity, boolean or string. Return None if the value is an expression."""
    if isinstance(raw, Expression):
        return None
    return Quantity(float(raw)) if isinstance(raw, (int, float)) and not isinstance(raw, bool) else raw


def _kind(document_value: ExpressionValue | None, others: Iterable[ExpressionValue]) -> ExpressionValue | None:
    """Return an example value for a path: the value in the assembly document, or else the first value in the variants document.

    `others` contains the values in the variants document. Return the number 0 without a unit only if there is no other value.
    """
    known = [value for value in (document_value, *others) if value is not None]
    return next((value for value in known if value != Quantity(0.0)), known[0] if known else None)


def of_kind(value: ExpressionValue, kind: ExpressionValue | None) -> ExpressionValue | None:
    """Convert a value to the same type and physical dimension as the value `kind`. Return None if the value cannot be converted."""
    if not isinstance(value, Quantity) or not isinstance(kind, Quantity):
        return value if kind is None or type(value) is type(kind) else None
    if value == Quantity(0.0):
        return Quantity(0.0, kind.dimension)
    return value if value.dimension == kind.dimension else None

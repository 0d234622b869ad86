"""Values of variants: from what a document writes to SI, and to the text that says the same value to every other program."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping
from decimal import Decimal
from fractions import Fraction

from thingc.base.units import (
    Dimension,
    Quantity,
    UnitError,
    exact,
    parse_quantity,
    scan_number,
    scan_unit,
)
from thingc.documents.expressions.evaluation import ExpressionValue, plain

ID_DIGITS = 12
"""Hexadecimal digits of a variant's id."""


def unit_of(dimension: Dimension) -> str:
    """The SI unit of a column: `m`, `kg*m^2`; empty for a number."""
    return dimension.symbol


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
    settings = {
        "assembly": assembly, "parameters": {name: plain(value) for name, value in parameters.items()}, "choices": dict(choices),
    }
    text = json.dumps(settings, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:ID_DIGITS]

"""Format values as strings that `-p NAME=VALUE` parses to exactly the same value."""

from __future__ import annotations

import functools
import math
from decimal import Decimal

from thingc.base import numeric
from thingc.base.units import FREQUENCY, NUMBER, Quantity, Unit, UnitError, scan_unit, to_si
from thingc.documents.expressions.evaluation import ExpressionValue, format_value


def text_of(value: ExpressionValue, unit: str = "") -> str:
    """Format a value as a string that `-p NAME=VALUE` parses to exactly the same value.

    A quantity is formatted in `unit` (`95.5 mm`) if possible, otherwise in SI units (`0.0955 m`). A boolean is formatted as `true` or
    `false`. Strings are returned unchanged.
    """
    if not isinstance(value, Quantity):
        return format_value(value)
    number = value.value + 0.0
    if unit and (in_unit := _in_unit(value, unit)) is not None:
        return in_unit
    if value.dimension == NUMBER:
        return _exact_number(number)
    if value.dimension == FREQUENCY:
        return f"{_exact(number)} Hz"
    symbol = value.dimension.symbol
    numerator, _, denominator = symbol.partition("/")
    return f"={_exact(number)} / (1 {denominator})" if numerator == "1" else f"{_exact(number)} {symbol}"


@numeric.formatter("exact")
def _exact(number: float) -> str:
    return repr(number)


@numeric.formatter("exact number")
def _exact_number(number: float) -> str:
    return repr(int(number) if number % 1.0 == 0.0 else number)


def _in_unit(quantity: Quantity, unit: str) -> str | None:
    """Format a quantity in the given unit, with the fewest digits that represent the value exactly.

    Return None if the unit has another physical dimension, or if no decimal number in this unit represents the value exactly, which is
    possible for degrees.
    """
    parsed_unit = _scan_unit(unit)
    if parsed_unit is None or parsed_unit[2] != quantity.dimension:
        return None
    number = Decimal(quantity.value + 0.0) * parsed_unit[1] / parsed_unit[0]
    double = float(number)
    if not numeric.isfinite(double):
        return None
    neighbours = (double + ulps * math.ulp(double) for ulps in (0, 1, -1))  # neighbouring doubles, needed for degrees
    texts = (f"{double:.15g}", f"{number:.16g}", *(f"{candidate:.17g}" for candidate in (number, *neighbours)))
    try:
        return next((f"{text} {unit}" for text in texts if to_si(text, parsed_unit) == quantity.value), None)
    except UnitError:
        return None


@functools.cache
def _scan_unit(unit: str) -> Unit | None:
    """Parse a unit such as `mm` or `N*m`. Return None for an invalid unit."""
    try:
        return scan_unit(unit, 0)[0]
    except UnitError:
        return None

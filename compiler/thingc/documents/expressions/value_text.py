"""The text that says a value: what `-p NAME=VALUE` reads back to the last bit."""

from __future__ import annotations

import functools
import math
from decimal import Decimal

from thingc.base import numeric
from thingc.base.units import FREQUENCY, NUMBER, Quantity, Unit, UnitError, converted, scan_unit
from thingc.documents.expressions.evaluation import ExpressionValue, plain


def text_of(value: ExpressionValue, unit: str = "") -> str:
    """A value as `-p NAME=VALUE` reads it back to the last bit: in `unit`, where it can be said so, else in SI (`95.5 mm`, `0.0955 m`);
    `true`, a text as it is."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value
    number = plain(value)
    if unit and (short := _in_unit(value, unit)) is not None:
        return short
    if value.dimension == NUMBER:
        return repr(number)
    if value.dimension == FREQUENCY:
        return f"{number!r} Hz"
    symbol = value.dimension.symbol
    above, _, below = symbol.partition("/")
    return f"={number!r} / (1 {below})" if above == "1" else f"{number!r} {symbol}"


def _in_unit(quantity: Quantity, unit: str) -> str | None:
    """A quantity in a unit, in as few digits as say the same value to the last bit; None where no digits do (in degrees, which are rounded
    twice, some are missing), or it is no unit of that dimension."""
    known = _scanned(unit)
    if known is None or known[2] != quantity.dimension:
        return None
    number = Decimal(quantity.value + 0.0) * known[1] / known[0]
    double = float(number)
    if not numeric.isfinite(double):
        return None
    near = (double + ulps * math.ulp(double) for ulps in (0, 1, -1))  # for degrees
    texts = (f"{double:.15g}", f"{number:.16g}", *(f"{one:.17g}" for one in (number, *near)))
    try:
        return next((f"{text} {unit}" for text in texts if converted(text, known) == quantity.value), None)
    except UnitError:
        return None


@functools.cache
def _scanned(unit: str) -> Unit | None:
    """What a word for a unit means; None where it is no unit."""
    try:
        return scan_unit(unit, 0)[0]
    except UnitError:
        return None

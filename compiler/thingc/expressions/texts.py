"""The text that says a value: what `-p NAME=VALUE` reads back to the last bit."""

from __future__ import annotations

import functools
import math
from decimal import Decimal

from thingc.expressions.evaluation import Found, plain
from thingc.units import FREQUENCY, NUMBER, Quantity, Unit, UnitError, converted, scan_unit


def text_of(found: Found, unit: str = "") -> str:
    """A value as `-p NAME=VALUE` reads it back to the last bit: in `unit`, where it can be said so, else in SI (`95.5 mm`, `0.0955 m`);
    `true`, a text as it is."""
    if isinstance(found, bool):
        return "true" if found else "false"
    if isinstance(found, str):
        return found
    value = plain(found)
    if unit and (short := _in_unit(found, unit)) is not None:
        return short
    if found.dimension == NUMBER:
        return repr(value)
    if found.dimension == FREQUENCY:
        return f"{value!r} Hz"
    symbol = found.dimension.symbol
    above, _, below = symbol.partition("/")
    return f"={value!r} / (1 {below})" if above == "1" else f"{value!r} {symbol}"


def _in_unit(found: Quantity, unit: str) -> str | None:
    """A quantity in a unit, in as few digits as say the same value to the last bit; None where no digits do (in degrees, which are rounded
    twice, some are missing), or it is no unit of that dimension."""
    known = _scanned(unit)
    if known is None or known[2] != found.dimension:
        return None
    number = Decimal(found.value + 0.0) * known[1] / known[0]
    double = float(number)
    if not math.isfinite(double):
        return None
    near = (double + ulps * math.ulp(double) for ulps in (0, 1, -1))  # for degrees
    texts = (f"{double:.15g}", f"{number:.16g}", *(f"{one:.17g}" for one in (number, *near)))
    try:
        return next((f"{text} {unit}" for text in texts if converted(text, known) == found.value), None)
    except UnitError:
        return None


@functools.cache
def _scanned(unit: str) -> Unit | None:
    """What a word for a unit means; None where it is no unit."""
    try:
        return scan_unit(unit, 0)[0]
    except UnitError:
        return None

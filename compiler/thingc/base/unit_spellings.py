"""Interpret informal spellings of units, such as synonyms of units and products of units without an operator."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from itertools import islice

SYNONYMS = {
    "mps": "m/s", "kmh": "km/h", "kph": "km/h", "rps": "rev/s", "oz": "ozf", "µm": "um", "μm": "um",
    "micron": "um", "microns": "um", "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm",
    "centimeter": "cm", "centimetre": "cm", "meter": "m", "meters": "m", "metre": "m", "metres": "m", "inch": "in",
    "inches": "in", "°": "deg", "degree": "deg", "degrees": "deg", "degs": "deg", "radian": "rad", "radians": "rad",
    "rads": "rad", "turn": "rev", "turns": "rev", "RPM": "rpm", "gram": "g", "grams": "g", "gr": "g", "kilogram": "kg",
    "kilograms": "kg", "kilo": "kg", "kgs": "kg", "lbs": "lb", "pound": "lb", "pounds": "lb", "sec": "s", "secs": "s",
    "second": "s", "seconds": "s", "msec": "ms", "minute": "min", "minutes": "min", "hour": "h", "hours": "h",
    "newton": "N", "newtons": "N", "Newton": "N", "hertz": "Hz", "percent": "%", "pct": "%", "µs": "us", "μs": "us",
}
"""Synonyms of units in the table."""

_LOOSE = re.compile(r"(?:\^|\*\*)?(-?[1-9]|[²³]?)(\s*[*/·.-]?\s*)")
"""Regular expression of the text after a unit: an exponent, and a separator before the next unit."""
LONGEST = 30
"""Maximum length of a string for which all interpretations are tried."""
MAX_READINGS = 1000


def spellings(text: str, units: Collection[str]) -> list[str]:
    """Return all products of the given units whose symbols can be written as `text`.

    For example, the result for `Nms/rad` is `N*ms/rad` and `N*m*s/rad`.
    """
    return list(islice(_products(text, "", units), MAX_READINGS)) if 0 < len(text) <= LONGEST else []


def _products(text: str, sign: str, units: Collection[str]) -> Iterator[str]:
    if not text:
        yield ""
    for end in range(min(len(text), 12), 0, -1):
        unit = SYNONYMS.get(text[:end], text[:end])
        if unit in units:
            written, power, joint = _LOOSE.match(text, end).group(0, 1, 2)  # type: ignore[union-attr]
            following = "/" if "/" in joint or sign == "/" and not joint else "*"
            exponent = f"^{power.translate({178: '2', 179: '3'})}" if power else ""
            for product in _products(text[end + len(written):], following, units):
                yield f"{sign}{unit}{exponent}{product}"

"""Regular expressions and schemas of values in documents, for the JSON Schemas.

The regular expressions accept every value that the compiler accepts. Unknown units, and simple units of another physical dimension, are
rejected. Regular expressions cannot check the dimension of products of units or the syntax of expressions.
"""

from __future__ import annotations

from typing import Any

from thingc.base.units import NUMBER, UNITS, Dimension, fits

EXPRESSION = r"=\s*\S[\s\S]*"
_DIGITS = r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?"
_ZERO = r"[-+]?(0+(\.0*)?|\.0+)([eE][-+]?\d+)?"
_FACTOR = rf"({'|'.join(sorted(UNITS, key=lambda unit: (-len(unit), unit)))})((\^|\*\*)\s*[-+]?\d{{1,2}}|[²³])?"
_UNITS = rf"{_FACTOR}(\s*[*/·]\s*{_FACTOR})*"
_BETWEEN = r"(\s+|(?=[-+.]))"
ANY_VALUE = rf"^(\s*{EXPRESSION}|\s*{_DIGITS}(\s*{_UNITS})?\s*|(?!\s*(=|[-+]?\.?\d))[\s\S]*)$"


def _units_of(*dimensions: Dimension) -> str:
    """Return the regular expression of a unit with one of the physical dimensions, or of a product of units.

    The value `0 %` is accepted in the same way as the number 0 without a unit.
    """
    single = {unit: dimension for unit, (_, _, dimension) in UNITS.items() if dimension != NUMBER}
    excluded = sorted(unit for unit, dimension in single.items() if not any(fits(dimension, allowed) for allowed in dimensions))
    return rf"(?!({'|'.join(excluded)})\s*$){_UNITS}"


def quantity_pattern(*dimensions: Dimension, word: str = "") -> str:
    """Return the regular expression of a quantity with one of the physical dimensions.

    If `word` is given, the regular expression also accepts this word.
    """
    bare = _DIGITS if any(fits(NUMBER, dimension) for dimension in dimensions) else _ZERO
    return rf"^\s*({EXPRESSION}|{_DIGITS}\s*{_units_of(*dimensions)}|{bare}{'|' + word if word else ''})\s*$"


def vector_pattern(dimension: Dimension) -> str:
    """Return the regular expression of a vector in a single string: three numbers and a unit, or three zeros."""
    numbers, zeros = ((_BETWEEN.join([pattern] * 3)) for pattern in (_DIGITS, _ZERO))
    return rf"^\s*({numbers}\s*{_units_of(dimension)}|{zeros})\s*$"


def raw_schema(levels: int) -> dict[str, Any]:
    """Return the JSON Schema of a scalar, a list of scalars, or a mapping of these that is nested at most `levels` deep."""
    schema: dict[str, Any] = {
        "type": ["string", "number", "boolean", "array", "object"],
        "items": {"type": ["string", "number", "boolean", "object"] if levels else ["string", "number", "boolean"]},
    }
    return {**schema, "additionalProperties": raw_schema(levels - 1)} if levels else schema

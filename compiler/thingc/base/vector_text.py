"""Parse vectors: three numbers with a common unit, such as `0 120 30 mm`."""

from __future__ import annotations

import re

from thingc.base.units import MAX_TEXT, NUMBER, NUMBER_TEXT, Dimension, Quantity, UnitError, scan_number, scan_unit, shorten, to_si

_NUMBERS = re.compile(rf"(?:\s*(?a:{NUMBER_TEXT.pattern}))*\s*")
"""The numbers at the beginning of a text."""


def parse_vector(text: str, expected: tuple[Dimension, ...] = ()) -> tuple[Quantity, Quantity, Quantity]:
    """Parse a vector of three numbers with a common unit, such as `0 120 30 mm`. The vector `0 0 0` does not need a unit.

    Raises `UnitError` for an invalid vector. The offsets of the error count the characters of `text`.
    """
    if len(text) > MAX_TEXT:
        raise UnitError(f"the vector has {len(text)} characters (at most {MAX_TEXT} are allowed)")
    beginning = _NUMBERS.match(text).group()  # type: ignore[union-attr]
    numbers, at = NUMBER_TEXT.findall(beginning), len(beginning)
    count = {1: "one number", 2: "two numbers"}.get(len(numbers), f"{len(numbers)} numbers")
    problem = "write, for example, `0 120 30 mm` or `[0, 120 mm, 30 mm]`"
    if not numbers:
        raise UnitError(f"expected three numbers and a unit, found `{shorten(text.strip())}`", help=problem)
    if len(numbers) != 3:
        problem = _separator_hint(text) or problem
        raise UnitError(f"expected three numbers and a unit, found {count} (`{shorten(text.strip())}`)", help=problem)
    unit = (1, 1, NUMBER)
    if at < len(text):
        unit, end = scan_unit(text, at, expected=expected)
        if text[end:].strip():
            raise UnitError(
                f"unexpected `{shorten(text[end:].strip())}` after `{text[:end].strip()}`",
                offset=end, end=len(text), help=problem,
            )
    x, y, z = (Quantity(to_si(number, unit), unit[2]) for number in numbers)
    return x, y, z


def _separator_hint(text: str) -> str | None:
    """Return a hint for a vector whose three values are written with separators or several units.

    Return None if the vector has another error.
    """
    pieces = [piece.strip() for piece in re.split("[,x×]", text)]
    if len(pieces) == 3 and all(scan_number(piece) for piece in pieces):
        shared = all(map(NUMBER_TEXT.fullmatch, pieces[:2]))
        return f"write `{shorten(' '.join(pieces))}`" if shared else f"write `[{shorten(', '.join(pieces))}]`"
    number = NUMBER_TEXT.pattern
    values = re.fullmatch(rf"\s*({number})\s*([^\W\d]+)\s+({number})\s*\2\s+({number})\s*\2\s*", text)
    return f"write `{values.group(1)} {values.group(3)} {values.group(4)} {values.group(2)}`" if values is not None else None

"""Read the quantities of a document exactly, and write new values in the same units."""

from __future__ import annotations

from fractions import Fraction

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.units import ANGLE, LENGTH, NUMBER, Dimension, Unit, UnitError, exact, scan_number, scan_unit
from thingc.tools.importing.quantities import si_unit

DEFAULT_UNITS = {NUMBER: "", ANGLE: "deg", LENGTH: "mm"}
"""Units of new values, by physical dimension. Other values are written in SI units."""


class ExactQuantity(FrozenStruct):
    """A quantity of a document: an exact value in SI units, and the unit in which the document specifies it, or an expression."""

    value: Fraction = Fraction(0)
    unit: str = ""
    dimension: Dimension = NUMBER
    expression: str = ""

    def text(self, dimension: Dimension, unit: str = "") -> str:
        """Return the text of the quantity. `unit` is the unit of a quantity that the document specifies without a unit, such as 0."""
        if self.expression or not (self.value or self.unit):
            return f"={self.expression}" if self.expression else "0"
        unit = self.unit or unit or DEFAULT_UNITS.get(dimension, si_unit(dimension))
        numerator, denominator, _ = _unit(unit)
        number = float(self.value * denominator / numerator)
        short = f"{number:.15g}"
        return f"{short if float(short) == number else repr(number)} {unit}".strip()


def read_quantity(text: str) -> ExactQuantity:
    """Parse the text of a quantity. Raises `UnitError` if the text is neither an expression nor a number with a known unit."""
    if text.strip().startswith("="):
        return ExactQuantity(expression=text.strip()[1:].strip())
    scanned = scan_number(text.strip())
    if scanned is None:
        raise UnitError(f"expected a number with a unit, found `{text}`")
    number, end = scanned
    unit = text.strip()[end:].strip()
    numerator, denominator, dimension = _unit(unit)
    return ExactQuantity(value=Fraction(*exact(number)) * numerator / denominator, unit=unit, dimension=dimension)


def _unit(unit: str) -> Unit:
    if not unit:
        return 1, 1, NUMBER
    known, end = scan_unit(unit, 0)
    if end < len(unit):
        raise UnitError(f"`{unit}` is not a unit", kind="unit")
    return known

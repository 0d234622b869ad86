"""Check whether densities, sizes and masses are in a plausible range, to detect wrong units."""

from __future__ import annotations

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import maximum
from thingc.base.pose import Vector
from thingc.base.units import LENGTH, Quantity, parse_quantity
from thingc.documents.load.paths import SUFFIXES_WITH_UNIT
from thingc.geometry.record import FILE_UNIT, PartDefinition
from thingc.model.resolve.link_definition import LinkDefinition

LIGHTEST, HEAVIEST = 10.0, 25_000.0
"""Plausible range of densities [kg/m^3] of solids. Light foams have about 10 kg/m^3, and osmium has 22 590 kg/m^3."""

SMALLEST, LARGEST = 1e-3, 10.0
"""Plausible range for the size of a part [m], which is the longest side of its bounding box."""

LIKELY_UNITS = ("mm", "m", "in", "cm", "um")
"""Likely units of files that do not specify a unit, most likely first."""

_STEP = 1000.0
"""Ratio of g/cm^3 to kg/m^3, and of kg to g."""

_OUTSIDE = f"is outside the range of solids ({LIGHTEST:g} to {HEAVIEST:g} kg/m^3)"


class Implausible(FrozenStruct):
    """The description of an implausible value, and the value [SI] that the user probably intended (None if unknown)."""

    words: str
    meant: float | None


def density_doubt(density: float) -> Implausible | None:
    """Check a density [kg/m^3]. Return None if the density is plausible for a solid."""
    if LIGHTEST <= density <= HEAVIEST:
        return None
    intended = density * _STEP if density < LIGHTEST else density / _STEP
    words = f"({_format_number(density)} kg/m^3) {_OUTSIDE}"
    return Implausible(words=words, meant=intended if LIGHTEST <= intended <= HEAVIEST else None)


def mass_doubt(mass: float, volume: float) -> Implausible | None:
    """Check the mass [kg] of a solid of this volume [m^3]. Return None if the mass is plausible."""
    doubt = density_doubt(mass / volume)
    if doubt is None:
        return None
    return Implausible(
        words=f"({mass_words(mass)} in {_format_number(1e6 * volume)} cm^3) {_OUTSIDE}",
        meant=None if doubt.meant is None else doubt.meant * volume,
    )


def density_cure(doubt: Implausible) -> str | None:
    """Return a hint for an implausible density, or None if the intended density is unknown."""
    return None if doubt.meant is None else f"try `{doubt.meant:.6g} kg/m^3`"


def said_by_file(definition: PartDefinition) -> bool:
    """Return whether a part is imported from a file whose format specifies the unit of length."""
    return definition.reference.lower().endswith(SUFFIXES_WITH_UNIT)


def longest_side(box: tuple[Vector, Vector]) -> float:
    """Return the longest side [m] of a box, which is given by two corners."""
    return maximum(high - low for low, high in zip(*box))


def size_doubt(box: tuple[Vector, Vector]) -> str | None:
    """Describe the size of a part with an implausible bounding box. Return None if the size is plausible."""
    if SMALLEST <= longest_side(box) <= LARGEST:
        return None
    bound = f"shorter than {1000.0 * SMALLEST:g} mm" if longest_side(box) < SMALLEST else f"longer than {LARGEST:g} m"
    return f"is {bound} ({measures(box)})"


def unit_meant(definition: object, box: tuple[Vector, Vector]) -> str:
    """Return a hint for a part whose bounding box has an implausible size.

    If the part is a file without a unit, the hint suggests a unit for which the size is plausible.
    """
    if isinstance(definition, LinkDefinition):
        return "check the units of the shapes, such as `unit: m` of a `mesh`"
    if not isinstance(definition, PartDefinition) or definition.kind != "file":
        return "check the units of the `params` (part code uses millimetres)"
    if said_by_file(definition):
        return "export the file again in the right unit"
    unit = str(dict(definition.parameters).get("unit", FILE_UNIT))
    number = longest_side(box) / parse_quantity(f"1 {unit}").value
    sizes = {other: number * parse_quantity(f"1 {other}").value for other in LIKELY_UNITS}
    for least in (5.0 * SMALLEST, SMALLEST):
        for other, meant in sizes.items():
            if least <= meant <= LARGEST / 3.0:
                return f"write `unit: {other}` if the numbers in the file are in {other}"
    return f"check the unit of the file (read as {unit})"


def measures(box: tuple[Vector, Vector]) -> str:
    """Format the side lengths of a box, which is given by two corners [m]: `60 x 20 x 6 mm`."""
    sides = (float(f"{1000.0 * (above - below):.3g}") for below, above in zip(*box))
    return " x ".join(f"{side:g}" for side in sides) + " mm"


def mass_words(mass: float) -> str:
    """Format a mass [kg]: `82 g`, `27 kg`."""
    return f"{_format_number(1000.0 * mass)} g" if mass < 1.0 else f"{_format_number(mass)} kg"


def length_words(length: float, digits: int = 6) -> str:
    """Format a length [m]: `40 mm`, `12 m`."""
    return f"{float(f'{length:.{digits}g}'):g} m" if abs(length) >= 1.0 else str(Quantity(float(f"{length:.{digits}g}"), LENGTH))


def times_words(ratio: float) -> str:
    """Format a ratio with three significant digits."""
    return f"{ratio:.3g}" if ratio < 1000.0 else f"{ratio:.0f}"


def _format_number(value: float) -> str:
    """Format a number without an exponent, and with separators between thousands."""
    return f"{value:,.0f}".replace(",", " ") if value >= 1000.0 else f"{value:.3g}"

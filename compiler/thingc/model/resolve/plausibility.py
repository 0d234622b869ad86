"""What no robot is: densities, sizes and masses that a slip of units makes."""

from __future__ import annotations

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Vector
from thingc.base.units import LENGTH, Quantity, parse_quantity
from thingc.documents.load.paths import SUFFIXES_WITH_UNIT
from thingc.geometry.record import FILE_UNIT, PartDefinition
from thingc.model.resolve.link_definition import LinkDefinition

LIGHTEST, HEAVIEST = 10.0, 25_000.0
"""Densities [kg/m^3] that solids have: foams begin at 10, osmium has 22 590."""

SMALLEST, LARGEST = 1e-3, 10.0
"""Of parts: how long [m] the longest side of the box around one is."""

LIKELY_UNITS = ("mm", "m", "in", "cm", "um")
"""Of files that do not say theirs, the likeliest first."""

_STEP = 1000.0
"""Between kg/m^3 and g/cm^3, g and kg."""


class Implausible(FrozenStruct):
    """What is odd about a number, in words that follow what has it, and the number that was probably meant, in SI (None: nobody
    can tell)."""

    words: str
    meant: float | None


def density_doubt(density: float) -> Implausible | None:
    """About a density [kg/m^3] that no solid has; None for others."""
    if LIGHTEST <= density <= HEAVIEST:
        return None
    light = density < LIGHTEST
    meant = density * _STEP if light else density / _STEP
    than = f"{'less than foam' if light else 'more than any solid'} ({_format_number(LIGHTEST)} to {_format_number(HEAVIEST)})"
    words = f"has a density of {_format_number(density)} kg/m^3, {than}"
    return Implausible(words=words, meant=meant if LIGHTEST <= meant <= HEAVIEST else None)


def mass_doubt(mass: float, volume: float) -> Implausible | None:
    """About a mass [kg] that no solid of this volume [m^3] has; None for others."""
    doubt = density_doubt(mass / volume)
    if doubt is None:
        return None
    return Implausible(
        words=f"weighs {mass_words(mass)} in {_format_number(1e6 * volume)} cm^3: it {doubt.words}",
        meant=None if doubt.meant is None else doubt.meant * volume,
    )


def density_cure(doubt: Implausible) -> str | None:
    """What to write for a density that no solid has; None where nobody can tell."""
    return None if doubt.meant is None else f"write `{density_words(doubt.meant)}` if that is meant"


def said_by_file(definition: PartDefinition) -> bool:
    """Whether a part is a file that says itself which unit its numbers are in."""
    return definition.reference.lower().endswith(SUFFIXES_WITH_UNIT)


def unit_meant(definition: object, size: float) -> str:
    """What to do about a part (its definition) whose size [m] is odd: of a file without a unit, the unit in which it is none."""
    if isinstance(definition, LinkDefinition):
        return "lengths of shapes have their units; write `unit: m`, or another one, beside a `mesh` whose numbers are in that"
    if not isinstance(definition, PartDefinition) or definition.kind != "file":
        return "part code is in millimetres, and documents write units: check those of its `params`"
    if said_by_file(definition):
        return "the file says its unit itself: export it anew in the right one"
    unit = str(dict(definition.parameters).get("unit", FILE_UNIT))
    number = size / parse_quantity(f"1 {unit}").value
    sizes = {other: number * parse_quantity(f"1 {other}").value for other in LIKELY_UNITS}
    for least in (5.0 * SMALLEST, SMALLEST):
        for other, meant in sizes.items():
            if least <= meant <= LARGEST / 3.0:
                return f"write `unit: {other}` if its numbers are in {other}"
    return f"its numbers are taken as {unit}: check the file"


def measures(box: tuple[Vector, Vector]) -> str:
    """The sides of a box (two corners [m]) as people write them: `60 x 20 x 6 mm`."""
    sides = (float(f"{1000.0 * (above - below):.3g}") for below, above in zip(*box))
    return " x ".join(f"{side:g}" for side in sides) + " mm"


def mass_words(mass: float) -> str:
    """A mass [kg] as people write it: `82 g`, `27 kg`."""
    return f"{_format_number(1000.0 * mass)} g" if mass < 1.0 else f"{_format_number(mass)} kg"


def density_words(density: float) -> str:
    """A density [kg/m^3] as documents write it: `1270 kg/m^3`."""
    return f"{density:.6g} kg/m^3"


def length_words(length: float, digits: int = 6) -> str:
    """A length [m] as people write it: `40 mm`, `12 m`."""
    return f"{float(f'{length:.{digits}g}'):g} m" if abs(length) >= 1.0 else str(Quantity(float(f"{length:.{digits}g}"), LENGTH))


def times_words(ratio: float) -> str:
    """How many times something is another, to three digits."""
    return f"{ratio:.3g}" if ratio < 1000.0 else f"{ratio:.0f}"


def _format_number(value: float) -> str:
    """A number without an exponent, its thousands apart."""
    return f"{value:,.0f}".replace(",", " ") if value >= 1000.0 else f"{value:.3g}"

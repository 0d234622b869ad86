"""What no robot is: densities, sizes and masses that a slip of units makes."""

from __future__ import annotations

from dataclasses import dataclass

LIGHTEST, HEAVIEST = 10.0, 25_000.0
"""Densities [kg/m^3] that solids have: foams begin at 10, osmium has 22 590."""

_STEP = 1000.0
"""Between kg/m^3 and g/cm^3, g and kg."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubt:
    """What is odd about a number, in words that follow what has it, and the number that was probably meant, in SI (None: nobody
    can tell)."""

    words: str
    meant: float | None


def density_doubt(density: float) -> Doubt | None:
    """About a density [kg/m^3] that no solid has; None for others."""
    if LIGHTEST <= density <= HEAVIEST:
        return None
    light = density < LIGHTEST
    meant = density * _STEP if light else density / _STEP
    than = f"{'less than foam' if light else 'more than any solid'} ({_plain(LIGHTEST)} to {_plain(HEAVIEST)})"
    return Doubt(words=f"has a density of {_plain(density)} kg/m^3, {than}", meant=meant if LIGHTEST <= meant <= HEAVIEST else None)


def mass_doubt(mass: float, volume: float) -> Doubt | None:
    """About a mass [kg] that no solid of this volume [m^3] has; None for others."""
    doubt = density_doubt(mass / volume)
    if doubt is None:
        return None
    return Doubt(
        words=f"weighs {mass_words(mass)} in {1e6 * volume:.3g} cm^3: it {doubt.words}",
        meant=None if doubt.meant is None else doubt.meant * volume,
    )


def mass_words(mass: float) -> str:
    """A mass [kg] as people write it: `82 g`, `27 kg`."""
    return f"{_plain(1000.0 * mass)} g" if mass < 1.0 else f"{_plain(mass)} kg"


def density_words(density: float) -> str:
    """A density [kg/m^3] as documents write it: `1270 kg/m^3`."""
    return f"{density:.6g} kg/m^3"


def _plain(value: float) -> str:
    """A number without an exponent, its thousands apart."""
    return f"{value:,.0f}".replace(",", " ") if value >= 1000.0 else f"{value:.3g}"

"""The `materials/1` document, key by key."""

from __future__ import annotations

from typing import Literal

from thingc.spec.base import Model
from thingc.spec.fields import ColorField, CountField, DensityField, LengthField, Name, NumberField, RatioField


class FrictionSpec(Model):
    """Coefficients of friction against an average counterpart."""

    slide: NumberField
    """Sliding (Coulomb) friction."""
    torsion: LengthField | NumberField | None = None
    """Torsional friction, as MuJoCo's [m]."""
    roll: LengthField | NumberField | None = None
    """Rolling friction, as MuJoCo's [m]."""


class ProcessSpec(Model):
    """How a part is made. For `fdm` prints the infill model estimates the mass from it."""

    kind: Literal["fdm", "resin", "machined", "cast", "molded", "bought"] | None = None
    walls: CountField | None = None
    line_width: LengthField | None = None
    layer: LengthField | None = None
    top: CountField | None = None
    bottom: CountField | None = None
    infill: RatioField | None = None
    """0 % to 100 %."""


class MaterialSpec(Model):
    """A material: density, looks, friction and how parts are made of it."""

    base: str | None = None
    """A library material to start from: `bd_materials:pla`; what is written here goes over it."""
    density: DensityField | None = None
    color: ColorField | None = None
    """A CSS name or `#rrggbb`."""
    friction: FrictionSpec | None = None
    process: ProcessSpec | None = None


class MaterialsSpec(Model):
    """A document of materials."""

    thingc: Literal["materials/1"]
    materials: dict[Name, MaterialSpec]

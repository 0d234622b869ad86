"""The `materials/1` document, key by key."""

from typing import Literal

from pydantic import Field

from thingc.documents.spec import fields
from thingc.documents.spec.base import Model, optional
from thingc.documents.spec.name_types import NewMaterial


class FrictionSpec(Model):
    """Coefficients of friction between the material and a typical other material."""

    slide: fields.NumberField
    """Sliding (Coulomb) friction."""
    torsion: fields.LengthField | fields.NumberField | None = optional(0.005, "5 mm")
    """Torsional friction, as in MuJoCo [m]."""
    roll: fields.LengthField | fields.NumberField | None = optional(0.0001, "0.1 mm")
    """Rolling friction, as in MuJoCo [m]."""


class ProcessSpec(Model):
    """Manufacturing process of a part, which also determines how the mass of a part with infill is estimated."""

    kind: Literal["fdm", "resin", "machined", "cast", "molded", "bought"] | None = None
    """The kind of process: printed from filament (`fdm`) or resin, machined, cast, molded, or bought."""
    walls: fields.CountField | None = None
    """Number of printed lines in a wall."""
    line_width: fields.LengthField | None = None
    """Width of one printed line."""
    layer: fields.LengthField | None = None
    """Height of one layer."""
    top: fields.CountField | None = None
    """Number of solid layers at the top."""
    bottom: fields.CountField | None = None
    """Number of solid layers at the bottom."""
    infill: fields.RatioField | None = None
    """Share of the interior that is filled, 0 % to 100 %."""
    overlap: fields.RatioField | None = optional("25 %")
    """Overlap of infill and walls, as a share of the line width; default: 25 %, as in PrusaSlicer."""
    bridge_flow: fields.RatioField | None = optional("100 %")
    """Flow of material in bridges, relative to other lines; default: 100 %, as in PrusaSlicer."""
    speed: fields.VelocityField | None = optional("60 mm/s")
    """Mean speed at which walls are printed, for the printing time; default: 28 mm/s."""
    layer_time: fields.TimeField | None = optional("2 s")
    """Additional time for each layer, for travel and retraction; default: 4 s."""
    tolerance: fields.LengthField | None = optional("0.1 mm")
    """Largest deviation of the position of a mount along each axis of the part, for `stack` tests."""
    tilt: fields.AngleField | None = optional("0.2 deg")
    """Largest deviation of the orientation of a mount about each axis of the part, for `stack` tests."""
    estimate: Literal["layers", "skin"] | None = None
    """How to estimate the mass of a part with infill: `layers` (the default for `fdm`) or `skin` (for all others)."""


class MaterialSpec(Model):
    """A material: density, appearance, friction and manufacturing process."""

    base: str | None = optional("bd_materials:pla")
    """A material of a library, such as `bd_materials:pla`. The other keys override its values."""
    density: fields.DensityField | None = None
    """Mass per volume of the solid material."""
    color: fields.ColorField | None = None
    """The colour: a CSS name or `#rrggbb`."""
    price_per_kg: fields.CostField | None = optional("24.90 EUR")
    """Price of one kilogram, for the cost of prints."""
    friction: FrictionSpec | None = optional({"slide": 0.4})
    process: ProcessSpec | None = optional({"kind": "fdm", "walls": 3, "line_width": "0.45 mm", "infill": "15 %"})


class MaterialsSpec(Model):
    """A document of materials."""

    thingc: Literal["materials/1"]
    """Kind and version of this document."""
    materials: dict[NewMaterial, MaterialSpec] = Field(examples=[{"petg": {"density": "1270 kg/m^3", "color": "lavender"}}])
    """The materials, by name."""

"""The mass, centre and inertia of one component: who may say it, and who is asked first.

Component override, then the Thing's own `mass()` and `matrix_of_inertia()`, then material x process x exact volume.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

from thingc.inertia import ZERO, MassProperties
from thingc.pose import Matrix, Vector
from thingc.realize.record import PartRecord
from thingc.resolve.model import Overrides, Process

NOTHING = MassProperties(mass=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Density:
    """A density [kg/m^3] and whether it is a guess, which makes every mass computed from it one."""

    value: float
    estimated: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighed:
    """The answer: properties in the component's frame, and where the mass came from
    (`measured | vendor | stated | derived | estimated`)."""

    properties: MassProperties
    source: str


def merged(over: Process | None, under: Process | None) -> Process | None:
    """`over` key by key on top of `under`."""
    if over is None or under is None:
        return over if over is not None else under
    said = {name: value for name in Process.__dataclass_fields__ if (value := getattr(over, name)) is not None}
    return replace(under, **said)


def incomplete_infill(process: Process | None) -> str | None:
    """The key that the infill model misses (`walls` or `line_width`), or None."""
    if process is None or process.infill is None or process.infill >= 1.0:
        return None
    if process.walls is None:
        return "walls"
    return "line_width" if process.line_width is None else None


def solid_fraction(volume: float, area: float, process: Process | None) -> float | None:
    """The share of `volume` [m^3] that is filled when printed with an infill, None for a solid part.

    `(V_s + infill * (V - V_s)) / V` with the skin `V_s = min(V, area * walls * line_width)`, `area` in m^2.
    """
    if process is None or process.infill is None or process.infill >= 1.0:
        return None
    skin = min(volume, area * float(process.walls or 0) * (process.line_width or 0.0))
    return (skin + process.infill * (volume - skin)) / volume


def weigh(record: PartRecord | None, density: Density | None, process: Process | None, overrides: Overrides) -> Weighed | None:
    """The mass properties of a component, or None where nothing says its mass.

    `record` is None for a frame. `density` is the Thing's own or the material's, None where there is neither. A mass
    alone scales whatever inertia there is, a centre alone moves it unchanged; inertias are about the centre.
    """
    natural = _natural(record, density, process)
    mass = natural.properties.mass if natural is not None else None
    source = natural.source if natural is not None else "derived"
    inertia: Matrix = natural.properties.inertia if natural is not None else ZERO
    centre = record.centre if record is not None else (0.0, 0.0, 0.0)

    if record is not None:
        if record.mass is not None:
            mass, source = cast("float", record.mass.value), record.mass.source
            inertia = _scaled(record, mass)
        if record.com is not None:
            centre = cast("Vector", record.com.value)
        if record.matrix is not None:
            inertia = cast("Matrix", record.matrix.value)

    if overrides.mass is not None:
        new = overrides.mass.value[0]
        if mass is not None and mass > 0.0:
            inertia = MassProperties(mass=mass, inertia=inertia).with_mass(new).inertia
        elif record is not None and record.matrix is None:
            inertia = _scaled(record, new)
        mass, source = new, overrides.mass.source
    if mass is None:
        return None
    if overrides.com is not None:
        x, y, z = overrides.com.value
        centre = (x, y, z)
    if overrides.inertia is not None:
        inertia = stated_inertia(overrides.inertia.value)
    return Weighed(properties=MassProperties(mass=mass, centre=centre, inertia=inertia), source=source)


def stated_inertia(six: tuple[float, ...]) -> Matrix:
    """The matrix of `ixx iyy izz ixy ixz iyz` [kg m^2]."""
    xx, yy, zz, xy, xz, yz = six
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def _natural(record: PartRecord | None, density: Density | None, process: Process | None) -> Weighed | None:
    """Material x process x exact volume; nothing weighs nothing; None without a density."""
    if record is None or record.volume <= 0.0:
        return Weighed(properties=NOTHING, source="derived")
    if density is None:
        return None
    fraction = solid_fraction(record.volume, record.area, process)
    mass = density.value * record.volume * (1.0 if fraction is None else fraction)
    return Weighed(
        properties=MassProperties(mass=mass, centre=record.centre, inertia=_scaled(record, mass)),
        source="estimated" if density.estimated or fraction is not None else "derived",
    )


def _scaled(record: PartRecord, mass: float) -> Matrix:
    """The inertia [kg m^2] of the part's exact shape at this mass [kg]; zero without geometry."""
    return MassProperties(mass=record.volume, inertia=record.inertia).with_mass(mass).inertia

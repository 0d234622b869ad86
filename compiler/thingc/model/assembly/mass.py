"""The mass, centre and inertia of one component: who may say it, and who is asked first.

Component override, then the Thing's own `mass()` and `matrix_of_inertia()`, then density x what the part is made of: its exact volume,
or, with an infill, what is printed of it.
"""

from __future__ import annotations

from msgspec.structs import replace

from thingc.base import numeric
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import ZERO, MassProperties
from thingc.base.pose import Matrix, Vector
from thingc.geometry.print_slices import BRIDGE_FLOW, OVERLAP, UPRIGHT, SliceResult, Slicing
from thingc.geometry.record import PartRecord
from thingc.model.resolve.types import Overrides, Process

NOTHING = MassProperties(mass=0.0)


class Density(FrozenStruct):
    """A density [kg/m^3] and whether it is a guess, which makes every mass computed from it one."""

    value: float
    estimated: bool = False


class MassResult(FrozenStruct):
    """The answer: properties in the component's frame, and where the mass came from
    (`measured | vendor | stated | derived | estimated`); `estimate` is `layers | skin` where it was worked out from an infill."""

    properties: MassProperties
    source: str
    estimate: str | None = None


def merged(over: Process | None, under: Process | None) -> Process | None:
    """`over` key by key on top of `under`."""
    if over is None or under is None:
        return over if over is not None else under
    stated = {name: value for name in Process.__struct_fields__ if (value := getattr(over, name)) is not None}
    wrong = over.wrong | (under.wrong - stated.keys())
    return replace(under, **{**stated, "origins": {**under.origins, **over.origins}, "wrong": wrong})


_NEEDED = {"skin": ("walls", "line_width"), "layers": ("walls", "line_width", "layer", "top", "bottom")}


def estimate_of(process: Process | None) -> str | None:
    """How the volume that is printed with this process is worked out: `layers` or `skin`; None where the part is solid."""
    if process is None or process.infill is None or process.infill >= 1.0:
        return None
    return process.estimate or ("layers" if process.kind == "fdm" else "skin")


def missing_keys(process: Process | None) -> tuple[str, ...]:
    """The keys of a process that the estimate misses: `("walls",)`."""
    return tuple(key for key in _NEEDED.get(estimate_of(process) or "", ()) if getattr(process, key) is None)


def unsaid_keys(process: Process | None) -> tuple[str, ...]:
    """Those of the `missing_keys` that nothing is written for: of one that is wrong it has been said, and none may be missing where what
    the estimate goes by is wrong."""
    if process is None or not process.wrong.isdisjoint(("kind", "estimate")):
        return ()
    return tuple(key for key in missing_keys(process) if key not in process.wrong)


def layers_too_high(process: Process) -> bool:
    """Whether its layers are higher than its lines are wide."""
    return process.layer is not None and process.line_width is not None and process.layer > process.line_width


def slicing_of(process: Process | None, overrides: Overrides, record: PartRecord) -> Slicing | None:
    """How a part is cut into layers, where its mass comes from them; None where it does not, or the process cannot say how."""
    return layers_of(process, overrides.up or record.up) if record.volume > 0.0 else None


def layers_of(process: Process | None, up: Vector | None) -> Slicing | None:
    """How a process cuts whatever lies on the printer this way `up`; None as above."""
    if process is None or estimate_of(process) != "layers" or missing_keys(process) or layers_too_high(process):
        return None
    return Slicing(
        up=up or UPRIGHT, layer=process.layer or 0.0, line_width=process.line_width or 0.0,
        walls=process.walls or 0, top=process.top or 0, bottom=process.bottom or 0,
        overlap=OVERLAP if process.overlap is None else process.overlap, bridge_flow=process.bridge_flow or BRIDGE_FLOW,
    )


def component_mass(record: PartRecord | None, density: Density | None, process: Process | None, overrides: Overrides) -> MassResult | None:
    """The mass properties of a component, or None where nothing says its mass.

    `record` is None for a frame. `density` is the Thing's own or the material's, None where there is neither. A mass
    alone scales whatever inertia there is, a centre alone moves it unchanged; inertias are about the centre.
    """
    matter, estimate = _matter(record, process, overrides)
    natural = _natural(matter, density, estimate)
    mass = natural.properties.mass if natural is not None else None
    source = natural.source if natural is not None else "derived"
    inertia: Matrix = natural.properties.inertia if natural is not None else ZERO
    centre = matter.centre

    if record is not None:
        if record.mass is not None:
            mass, source, estimate = record.mass.value, record.mass.source, None
            inertia = matter.with_mass(mass).inertia
        if record.com is not None:
            centre = record.com.value
        if record.matrix is not None:
            inertia = record.matrix.value

    if overrides.mass is not None:
        new = overrides.mass.value[0]
        if mass is not None and mass > 0.0:
            inertia = MassProperties(mass=mass, inertia=inertia).with_mass(new).inertia
        elif record is not None and record.matrix is None:
            inertia = matter.with_mass(new).inertia
        mass, source, estimate = new, overrides.mass.source, None
    if mass is None:
        return None
    return MassResult(
        properties=_with_overrides(MassProperties(mass=mass, centre=centre, inertia=inertia), overrides), source=source, estimate=estimate,
    )


def weigh_link(matter: MassProperties, overrides: Overrides) -> MassResult:
    """The mass properties of a link: what the document states, else what its shapes weigh, which `matter` is then. A mass alone is spread
    over them, as `matter` is."""
    if overrides.mass is None:
        return MassResult(properties=_with_overrides(matter, overrides), source="derived")
    return MassResult(properties=_with_overrides(matter.with_mass(overrides.mass.value[0]), overrides), source=overrides.mass.source)


def is_fully_stated(overrides: Overrides) -> bool:
    """Whether a document says all of a mass: how large it is, where it is, and how it is spread."""
    return overrides.mass is not None and overrides.com is not None and overrides.inertia is not None


def _with_overrides(properties: MassProperties, overrides: Overrides) -> MassProperties:
    """With the centre and the inertia that the document states, as far as it does."""
    if overrides.com is not None:
        x, y, z = overrides.com.value
        properties = replace(properties, centre=(x, y, z))
    if overrides.inertia is not None:
        properties = replace(properties, inertia=stated_inertia(overrides.inertia.value))
    return properties


def stated_inertia(six: tuple[float, ...]) -> Matrix:
    """The matrix of `ixx iyy izz ixy ixz iyz` [kg m^2]."""
    xx, yy, zz, xy, xz, yz = six
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def _matter(record: PartRecord | None, process: Process | None, overrides: Overrides) -> tuple[MassProperties, str | None]:
    """What a part is made of, at density 1: its volume [m^3] as the mass, centre and inertia [m^5]; and how that was estimated.

    From layers as they are printed. By skin: `(V_s + infill * (V - V_s))` of the solid part with the volume V and the area A, where
    `V_s = min(V, A * walls * line_width)`. Without an infill it is exact.
    """
    if record is None or record.volume <= 0.0:
        return (NOTHING if record is None else replace(NOTHING, centre=record.centre)), None
    exact = MassProperties(mass=record.volume, centre=record.centre, inertia=record.inertia)
    if process is None or process.infill is None or estimate_of(process) is None:
        return exact, None
    slicing = slicing_of(process, overrides, record)
    sliced = record.slices.get(slicing) if slicing is not None else None
    if isinstance(sliced, SliceResult):
        return sliced.printed(process.infill), "layers"
    skin = numeric.minimum(record.volume, record.area * float(process.walls or 0) * (process.line_width or 0.0))
    return exact.with_mass(record.volume * ((skin + process.infill * (record.volume - skin)) / record.volume)), "skin"


def _natural(matter: MassProperties, density: Density | None, estimate: str | None) -> MassResult | None:
    """Density x matter; nothing weighs nothing; None without a density."""
    if matter.mass <= 0.0:
        return MassResult(properties=NOTHING, source="derived")
    if density is None:
        return None
    return MassResult(
        properties=matter.with_mass(density.value * matter.mass),
        source="estimated" if density.estimated or estimate is not None else "derived",
    )

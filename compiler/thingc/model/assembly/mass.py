"""Compute the mass, the centre of mass and the inertia of one component.

The first available source is used: overrides of the component, the methods `mass()` and `matrix_of_inertia()` of the Thing, or density
times volume. For a part with infill, the printed volume is estimated from its print settings, which are part of the requests to the
geometry service.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from thingc.base import numeric
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import ZERO, MassProperties
from thingc.base.pose import Matrix
from thingc.geometry.print_slices import LikelySlicing, SliceResult, Slicing
from thingc.geometry.record import PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.model.resolve.types import AssemblyDefinition, Component, Material, Overrides, Process

NOTHING = MassProperties(mass=0.0)


class MassResult(FrozenStruct):
    """The mass properties of a component in its own frame, and their source (`measured | vendor | stated | derived | estimated`).

    `estimate` is the method of estimation (`layers | skin`) for a part with infill, otherwise None.
    """

    properties: MassProperties
    source: str
    estimate: str | None = None


def slicing_of(process: Process, overrides: Overrides, record: PartRecord) -> Slicing | None:
    """Return the slicing settings of a part whose mass is estimated from its printed layers.

    Return None if the mass is not estimated from layers, or if settings are missing.
    """
    return process.slicing(overrides.up or record.up) if record.volume > 0.0 else None


def component_mass(component: Component, record: PartRecord | None, material: Material | None) -> MassResult | None:
    """Compute the mass, the centre of mass and the inertia of a component in its own frame. Return None if the mass cannot be determined.

    `record` is the geometry record of the part (None for a frame). If the document overrides only the mass, the inertia is scaled. If the
    document overrides only the centre of mass, the inertia is unchanged. All inertias are about the centre of mass of the component.
    """
    overrides = component.overrides
    matter, estimate = _matter(record, overrides.process_with(material), overrides)
    natural = _natural(matter, record, material, estimate)
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
        properties=with_overrides(MassProperties(mass=mass, centre=centre, inertia=inertia), overrides), source=source, estimate=estimate,
    )


def with_overrides(properties: MassProperties, overrides: Overrides) -> MassProperties:
    """Replace the centre of mass and the inertia by the values in the document, if specified."""
    if overrides.com is not None:
        x, y, z = overrides.com.value
        properties = replace(properties, centre=(x, y, z))
    if overrides.inertia is not None:
        properties = replace(properties, inertia=stated_inertia(overrides.inertia.value))
    return properties


def stated_inertia(six: tuple[float, ...]) -> Matrix:
    """Create a symmetric inertia matrix (3 x 3) from its elements `ixx iyy izz ixy ixz iyz` [kg m^2]."""
    xx, yy, zz, xy, xz, yz = six
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def _matter(record: PartRecord | None, process: Process, overrides: Overrides) -> tuple[MassProperties, str | None]:
    """Return the mass properties of a part at density 1 (volume [m^3], centre [m], inertia [m^5]), and the method of estimation.

    The properties of a part without infill are exact. The method `layers` computes the properties from the sliced layers of the part. The
    method `skin` uses `V_s + infill * (V - V_s)` for a solid with volume V and area A, where `V_s = min(V, A * walls * line_width)`.
    """
    if record is None or record.volume <= 0.0:
        return (NOTHING if record is None else replace(NOTHING, centre=record.centre)), None
    exact = MassProperties(mass=record.volume, centre=record.centre, inertia=record.inertia)
    if process.infill is None or process.estimation is None:
        return exact, None
    slicing = slicing_of(process, overrides, record)
    sliced = record.slices.get(slicing) if slicing is not None else None
    if isinstance(sliced, SliceResult):
        return sliced.mass_properties(process.infill), "layers"
    skin = numeric.minimum(record.volume, record.area * float(process.walls or 0) * (process.line_width or 0.0))
    return exact.with_mass(record.volume * ((skin + process.infill * (record.volume - skin)) / record.volume)), "skin"


def _natural(matter: MassProperties, record: PartRecord | None, material: Material | None, estimate: str | None) -> MassResult | None:
    """Return the mass properties of a part for the density of its class or, if the class does not specify a density, of its material.

    For a part without volume, the mass is 0. Without a density, return None.
    """
    if matter.mass <= 0.0:
        return MassResult(properties=NOTHING, source="derived")
    density, estimated = material.density if material is not None else None, estimate is not None
    if record is not None and record.density is not None:
        density, estimated = float(record.density.value), estimated or record.density.source == "estimated"
    if density is None:
        return None
    return MassResult(properties=matter.with_mass(density * matter.mass), source="estimated" if estimated else "derived")


def material_of(component: Component, default: str | None, scope: AssemblyDefinition) -> Material | None:
    """Return the material of a component: the material in the document or, if `scope` contains it, the default of the part class."""
    return component.material or scope.materials.get(default or "")


def slicings_of(model: AssemblyDefinition, records: Mapping[str, PartRecord | PartFailure]) -> dict[str, set[Slicing]]:
    """Return the slicing settings of all printed parts of a model, keyed by the text of the part's definition.

    If components print the same part differently, the result contains several settings for the part.
    """
    slicings: dict[str, set[Slicing]] = {}
    for definition, component, scope in _parts(model):
        record = records.get(definition.text)
        if not isinstance(record, PartRecord):
            continue
        slicing = slicing_of(component.overrides.process_with(material_of(component, record.material, scope)), component.overrides, record)
        if slicing is not None:
            slicings.setdefault(definition.text, set()).add(slicing)
    return slicings


def likely_slicings(model: AssemblyDefinition, schemas: Mapping[str, PartSchema | PartFailure]) -> dict[str, set[LikelySlicing]]:
    """Predict the slicing settings of parts before the parts are built. The materials are predicted from the part classes."""
    likely: dict[str, set[LikelySlicing]] = {}
    for definition, component, scope in _parts(model):
        schema, up = schemas.get(definition.reference), component.overrides.up
        material = material_of(component, schema.material if isinstance(schema, PartSchema) else None, scope)
        slicing = component.overrides.process_with(material).slicing(up)
        if slicing is not None:
            likely.setdefault(definition.text, set()).add((slicing, up is None))
    return likely


def _parts(model: AssemblyDefinition) -> Iterator[tuple[PartDefinition, Component, AssemblyDefinition]]:
    """Yield the distinct parts of each assembly, with their components."""
    for scope in model.assemblies():
        for component in scope.components:
            if isinstance(component.definition, PartDefinition):
                yield component.definition, component, scope

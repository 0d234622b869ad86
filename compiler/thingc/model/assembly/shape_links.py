"""Compute the geometry, the mass properties and the mesh files of links whose shapes are listed in the document."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

from msgspec.structs import replace

from thingc.base import numeric
from thingc.base.diagnostics import Code, Report
from thingc.base.inertia import MassProperties, total
from thingc.base.pose import Vector
from thingc.base.primitives import Primitive
from thingc.base.source import Origin
from thingc.base.units import LENGTH, Quantity
from thingc.geometry.meshes.files import MeshFile, MeshRecord
from thingc.geometry.record import Mesh, PartFailure, PartRecord
from thingc.model.assembly.mass import NOTHING, MassResult, with_overrides
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Listed, Surface
from thingc.model.resolve.link_definition import LinkDefinition, LinkShape
from thingc.model.resolve.types import AssemblyDefinition, Component, Material, Overrides

Meshes = Mapping[MeshFile, MeshRecord]
"""Records of the mesh files that have been read, by file."""

Decompose = Callable[[Collection[tuple[str, int]]], Mapping[tuple[str, int], tuple[Mesh, ...] | PartFailure]]
"""Decomposes meshes into convex pieces: `PartSource.decompose`."""


def list_shapes(definition: LinkDefinition, material: Material | None, meshes: Meshes) -> Listed:
    """Return the shapes of a link for display, collision and mass.

    `meshes` contains the records of mesh files. A shape whose mesh file has no record is omitted.
    """
    boxes = [_box(shape, meshes) for shape in definition.shapes if isinstance(shape.solid, MeshFile) or shape.solid.shape != "plane"]
    return Listed(
        drawn=tuple(surface for shape in definition.shapes if shape.drawn for surface in _surfaces(shape, material, meshes)),
        touching=tuple(surface for shape in definition.shapes if shape.touches for surface in _touching(shape, material, meshes)),
        solids=tuple(surface for shape in solid_shapes(definition) for surface in _solid(shape, material, meshes)),
        box=bounding_box([box for box in boxes if box is not None]) if None not in boxes else None,
    )


def _box(shape: LinkShape, meshes: Meshes) -> tuple[Vector, Vector] | None:
    """Return the bounding box of a shape in the frame of the link, as two corners [m].

    Return None if the mesh file of the shape has not been read.
    """
    if not isinstance(shape.solid, MeshFile):
        return shape.solid.box
    record = meshes.get(shape.solid)
    return None if record is None else shape.pose.around(record.box)


def _surfaces(shape: LinkShape, material: Material | None, meshes: Meshes) -> Iterator[Surface]:
    """Yield the surfaces of a shape with their colours. A shape is a primitive, or a mesh file with one or several pieces."""
    material, solid = shape.material or material, shape.solid
    otherwise = material.color if material is not None else None
    if not isinstance(solid, MeshFile):
        yield Surface(solid=solid, material=material, color=shape.color or otherwise, title=shape.name, origin=shape.origin)
    elif (record := meshes.get(solid)) is not None:
        for number, piece in enumerate(record.pieces):
            color = shape.color or piece.color or otherwise
            if piece.mesh == record.mesh:
                yield _mesh_surface(shape, solid, record, material, color)
            else:
                name = f"{solid.name}_{number}"
                yield Surface(solid=piece.mesh, material=material, color=color, pose=shape.pose, name=name, title=shape.name)


def _touching(shape: LinkShape, material: Material | None, meshes: Meshes) -> Iterator[Surface]:
    """Yield the collision shapes of a shape: a primitive, or a mesh file as a whole or in convex pieces."""
    record = meshes.get(shape.solid) if isinstance(shape.solid, MeshFile) else None
    pieces = () if record is None or shape.pieces is None else record.convex.get(shape.pieces, ())
    for surface in _solid(shape, material, meshes):
        for number, piece in enumerate(pieces):
            yield replace(surface, solid=piece, own=None, scale=None, name=f"{surface.name}_convex{shape.pieces or ''}_{number}")
        if not pieces:
            yield surface


def _solid(shape: LinkShape, material: Material | None, meshes: Meshes) -> Iterator[Surface]:
    material, solid = _with_friction(shape, shape.material or material), shape.solid
    if not isinstance(solid, MeshFile):
        yield Surface(solid=solid, material=material, color=None, title=shape.name, origin=shape.origin)
    elif (record := meshes.get(solid)) is not None:
        yield _mesh_surface(shape, solid, record, material, None)


def _with_friction(shape: LinkShape, material: Material | None) -> Material | None:
    """Return the material of a shape. If the shape specifies a friction, the returned material has this friction."""
    specified = {key: value for key, value in zip(("slide", "torsion", "roll"), shape.friction, strict=True) if value is not None}
    if not specified:
        return material
    return replace(material or Material(name="friction", density=None, origin=shape.origin), **specified)


def _mesh_surface(shape: LinkShape, file: MeshFile, record: MeshRecord, material: Material | None, color: str | None) -> Surface:
    return Surface(
        solid=record.mesh, material=material, color=color, pose=shape.pose, name=file.name, origin=shape.origin,
        volume=record.matter.mass if record.matter is not None else 0.0, own=record.own, scale=file.scale, title=shape.name,
    )


def bounding_box(boxes: Sequence[tuple[Vector, Vector]]) -> tuple[Vector, Vector] | None:
    """Return the smallest box (two corners [m]) that contains several boxes. Return None for an empty list."""
    corners = [corner for box in boxes for corner in box]
    if not corners:
        return None
    (ax, bx), (ay, by), (az, bz) = ((numeric.minimum(extent), numeric.maximum(extent)) for extent in zip(*corners, strict=True))
    return (ax, ay, az), (bx, by, bz)


class MissingDensity(Exception):
    """Raised if the mass of a link cannot be computed from its shapes.

    The message is the end of a sentence that begins with the name of the link. If a mesh file was not read, the message is empty.
    """


def solid_shapes(definition: LinkDefinition) -> Sequence[LinkShape]:
    """Return the shapes from which the mass of a link is computed.

    The result contains the collision shapes or, if the link has none, the display shapes.
    """
    return [shape for shape in definition.shapes if shape.touches] or [shape for shape in definition.shapes if shape.drawn]


def weigh_shapes(definition: LinkDefinition, material: Material | None, meshes: Meshes, overrides: Overrides) -> MassResult:
    """Return the mass properties of a link, as specified in the document or computed from its shapes.

    If the document specifies the mass, missing values are those of the shapes at a common density. Raises `MissingDensity` if the mass
    cannot be computed.
    """
    if overrides.mass is None:
        return MassResult(properties=with_overrides(_weight_of(definition, material, meshes), overrides), source="derived")
    matter = NOTHING if overrides.fully_stated else total(_matter(shape, meshes) for shape in solid_shapes(definition))
    return MassResult(properties=with_overrides(matter.with_mass(overrides.mass.value[0]), overrides), source=overrides.mass.source)


def _matter(shape: LinkShape, meshes: Meshes) -> MassProperties:
    """Return the mass properties of a shape at density 1, in the link's frame.

    Raises `MissingDensity` if the volume of its mesh file is unknown.
    """
    if not isinstance(shape.solid, MeshFile):
        return shape.solid.matter
    record = meshes.get(shape.solid)
    if record is None:
        raise MissingDensity("")
    if record.matter is None:
        raise MissingDensity(f"contains the mesh `{shape.solid.path}`, which is not closed and has no volume")
    return record.matter.seen_from(shape.pose)


def _weight_of(definition: LinkDefinition, material: Material | None, meshes: Meshes) -> MassProperties:
    """Compute the mass [kg], centre of mass [m] and inertia [kg m^2] of a link from the densities of its shapes.

    If no shape has a density, the result is zero.

    Raises `MissingDensity` if the mass cannot be computed, for example if only some shapes have a density.
    """
    dense = [(shape, own.density) for shape in solid_shapes(definition) if (own := shape.material or material) and own.density is not None]
    weights = [(density, _matter(shape, meshes)) for shape, density in dense]
    others = [shape for shape in solid_shapes(definition) if shape not in [weighted for weighted, _ in dense]]
    if weights and any(_matter(shape, meshes).mass > 0.0 for shape in others):
        raise MissingDensity("has some shapes without a density")
    return total(matter.with_mass(density * matter.mass) for density, matter in weights)


def listed_meshes(model: AssemblyDefinition, *, drawn: bool) -> dict[MeshFile, tuple[Origin, bool]]:
    """Return every mesh file that the links of the model and the collision shapes of its parts use.

    Each file is mapped to the location of its first use, and to whether the file must be read. A mesh file must be read if meshes are
    `drawn`, if the mass of a link depends on the file, or if a mode is `on_floor`.
    """
    read_all = drawn or any(mode.on_floor for mode in model.modes)
    files: dict[MeshFile, tuple[Origin, bool]] = {}
    for component, shape, file in _mesh_shapes(model):
        weighed = isinstance(component.definition, LinkDefinition) and not component.overrides.fully_stated
        origin, needed = files.get(file, (shape.origin, False))
        files[file] = (origin, needed or read_all or weighed)
    return files


def _mesh_shapes(model: AssemblyDefinition) -> Iterator[tuple[Component, LinkShape, MeshFile]]:
    """Yield each mesh file that documents list, with its component and shape: a shape of a link, or a collision shape of a part."""
    for component in (component for assembly in model.assemblies() for component in assembly.components):
        for listed in (component.definition, *(choice.shapes for choice in component.overrides.choices.values())):
            for shape in listed.shapes if isinstance(listed, LinkDefinition) else ():
                if isinstance(shape.solid, MeshFile):
                    yield component, shape, shape.solid


def with_pieces(model: AssemblyDefinition, meshes: Meshes, decompose: Decompose, report: Report) -> Meshes:
    """Add the convex pieces that shapes of the model require to the records of mesh files, and return the new records.

    If a mesh cannot be decomposed, report an error at its shape.
    """
    requests: dict[tuple[str, int], tuple[MeshFile, Origin]] = {}
    for _, shape, file in _mesh_shapes(model):
        if shape.pieces is not None and file in meshes:
            requests.setdefault((meshes[file].mesh.sha256, shape.pieces), (file, shape.origin))
    pieces_by_mesh: dict[str, dict[int, tuple[Mesh, ...]]] = {}
    for (mesh, count), pieces in (decompose(requests) if requests else {}).items():
        if isinstance(pieces, PartFailure):
            file, origin = requests[mesh, count]
            report.add(
                Code.PART_INVALID, f"`{file.path}` cannot be decomposed into convex pieces: {pieces.message}", origin,
                help="remove `decompose`, and list primitives or convex meshes instead",
            )
        else:
            pieces_by_mesh.setdefault(mesh, {})[count] = pieces
    return {file: replace(record, convex=pieces_by_mesh.get(record.mesh.sha256, {})) for file, record in meshes.items()}


def warn_far(shapes: LinkDefinition, record: PartRecord | None, meshes: Meshes, path: str, findings: LinkReport) -> None:
    """Warn of each collision shape that extends beyond the bounding box of its part by more than the diagonal of the box."""
    if record is None or record.box is None or not record.exact:
        return
    (low, high), size = record.box, numeric.hypot(*(b - a for a, b in zip(*record.box, strict=True)))
    for shape in shapes.shapes:
        box = _box(shape, meshes)
        if box is None or isinstance(shape.solid, Primitive) and shape.solid.shape == "plane":
            continue
        sides = ((low, box[0]), (box[1], high))
        distance = numeric.maximum([a - b for inner, outer in sides for a, b in zip(inner, outer, strict=True)])
        if distance > size:
            far, diagonal = (Quantity(float(f"{length:.3g}"), LENGTH) for length in (distance, size))
            findings.warn(
                Code.SHAPE_FAR, f"the collision shape `{shape.word}` extends {far} beyond the bounding box of `{path}` (diagonal: "
                f"{diagonal})", shape.origin, path=path, help="check the units and the pose `at` of the shape",
            )

"""Build a part in a child process of the worker: create its Thing, measure and mesh its geometry, and write the files to the store."""

from __future__ import annotations

import contextlib
import inspect
import io
import math
import os
import warnings
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace
from OCP.BinTools import BinTools, BinTools_FormatVersion
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS, TopoDS_Shape

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.primitives import Primitive
from thingc.base.units import parse_quantity
from thingc.documents.workspace import Tessellation
from thingc.geometry import record as records
from thingc.geometry.declared_interfaces import contradictions
from thingc.geometry.record_json import record_to_json, to_json
from thingc.geometry.store.local import Store, StoreUnusable
from thingc.geometry.things import inspection
from thingc.geometry.things.assets import asset
from thingc.geometry.things.thing import Thing
from thingc.geometry.worker.kernel import convert, meshing
from thingc.geometry.worker.kernel.bounding_primitives import fit_all
from thingc.geometry.worker.kernel.feature_search import features_of
from thingc.geometry.worker.kernel.integrals import at_origin, bodies_of, compound_of, measure, solids_of, subshapes
from thingc.geometry.worker.kernel.mesh_files import SUFFIXES, BadPartFile
from thingc.geometry.worker.kernel.mirroring import SolidMirror
from thingc.geometry.worker.kernel.part_files import hex_colour, hexadecimal, kernel_shape, read_part, unusable
from thingc.geometry.worker.kernel.primitives import primitive_of
from thingc.geometry.worker.kernel.simplifying import deviation, simplify
from thingc.geometry.worker.kernel.tessellation import tessellate
from thingc.geometry.worker.part_session import NoPart, PartSession, RequestContext, kind_of

NOTHING = 1e-9
"""Volume [mm^3] below which the geometry of a part counts as empty."""

OVERLAP = 0.01
"""Fraction of a part's volume. An overlap of its solids is reported if it is larger than this fraction and larger than 1 mm^3."""

NOT_CONVEX = 0.05
"""Fraction of the volume of a convex hull. If more than this fraction is outside of the solid, the solid is not convex. Facets of curved
surfaces leave out up to 1 %, and small notches do not change contacts.
"""

DEVIATION = 0.01
"""Largest deviation of a simplified mesh from the original mesh for which no warning is reported, relative to the longest side of the
part.
"""

DECIMALS = 9
"""Number of decimals to which the coordinates of corners are rounded [mm].

If a boolean operation merges two corners, the kernel keeps the corner with the lower memory address. The coordinate of one corner may be 0,
and that of the other corner 2e-31. Without rounding, the same part could have a different mesh in the next run.
"""


class Tessellations(FrozenStruct):
    """Tessellation settings: `fine` for print files and clearance checks, `simulation` for visual and collision meshes in simulators."""

    fine: Tessellation
    simulation: Tessellation


# msgspec resolves and caches the annotations of these structs here, so that no child process of the server has to resolve them
msgspec.json.Decoder(tuple[records.PartRecord, RequestContext, Tessellations])


class BuiltPart(FrozenStruct):
    """The geometry that part code or a part file defines, before it is measured.

    The shapes are objects of the CAD kernel [mm]. There are no shapes for a part without geometry. `record` contains all properties that do
    not result from measuring the shapes. `one` is True if the solids should be connected to one body. `file` is True if the part is a file,
    and `faceted` is True if all its faces are triangles. `faces` is the maximum number of triangles for simulators.
    """

    shapes: Sequence[TopoDS_Shape]
    record: records.PartRecord
    visual: Sequence[TopoDS_Shape] = ()
    collision: Sequence[TopoDS_Shape] = ()
    one: bool = False
    file: bool = False
    faceted: bool = False
    faces: int | None = None


def build_part(definition: dict[str, Any], tessellations: Tessellations, context: RequestContext, store: Store) -> dict[str, Any]:
    """Build a part definition. Return the record or failure, and the files that were read: `{"record" | "failure": ..., "reads": [...]}`.

    If the part was built, the answer also contains `ran` and `loaded`. `ran` contains the functions of the code that have run (see
    `PartSession.ran`). `loaded` is the time at which the class was loaded (`time.monotonic`). `definition` contains `kind`, `reference`,
    `text`, `mirror`, and the canonical `parameters` in SI units. Missing parameters have their default values. In addition, `definition`
    contains `placed`. `placed` is True if the location of the class is already known. If `placed` is False, this location is searched,
    which is slow. The meshes and the B-rep are written to the store. Raises `StoreUnusable` if the store is not writable.
    """
    text = definition["text"]
    with PartSession(context) as session, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            built = _from_file(definition, context) if definition["kind"] == "file" else _from_code(definition, session)
            if definition["mirror"] is not None:
                built = _mirror(built, definition["mirror"])
            session.stop()
            record = _measure(built, tessellations, store) if built.shapes else built.record
            pieces, hull_warnings = _pieces(built.collision, tessellations.simulation, store)
            record = replace(record, pieces=pieces, warnings=(*record.warnings, *hull_warnings))
            python_warnings = dict.fromkeys(  # warnings about lines in libraries are omitted
                records.PartWarning(message=str(one.message), file=one.filename, line=one.lineno)
                for one in caught if session.is_own(one.filename)
            )
            part_warnings = (*record.warnings, *python_warnings, *session.impure_inputs.found)
            answer = {"record": record_to_json(replace(record, warnings=part_warnings), context.root)}
            reads = session.reads(*(warning.file for warning in part_warnings))
            loaded = {"loaded": session.loaded} if session.loaded is not None else {}
            return {**answer, **loaded, "reads": reads, "ran": session.ran()}
        except StoreUnusable:
            raise
        except BaseException as fault:
            session.stop()
            if definition["kind"] == "file" and not isinstance(fault, (NoPart, BadPartFile, MemoryError)):
                fault = unusable(fault)
            failure = session.failure(text, fault)
            if failure.file is None and definition["kind"] == "code":
                failure = replace(failure, **_code_location(definition["reference"], session))
            return {"failure": to_json(failure, context.root), "reads": session.reads(failure.file)}


def _code_location(reference: str, session: PartSession) -> dict[str, Any]:
    """Return the `file` and `line` of the author's class, or an empty dict if they are unknown.

    This location is used for errors that have no line number.
    """
    with contextlib.suppress(Exception):
        file, line = inspection.code_location(inspect.unwrap(session.part(reference))) or ("", 0)
        if session.is_own(file):
            return {"file": file, "line": line}
    return {}


def _from_code(definition: dict[str, Any], session: PartSession) -> BuiltPart:
    reference = definition["reference"]
    part = session.part(reference)
    kind = kind_of(part, reference)
    schemas = inspection.parameters_of(part)
    kinds = {parameter.name: parameter.kind for parameter in schemas}
    # defaults are rounded in the same way as values in a document
    defaults = {parameter.name: convert.to_si(parameter.kind, parameter.default) for parameter in schemas if parameter.default is not None}
    values = {**defaults, **definition["parameters"]}
    parameters = {name: convert.to_author(kinds.get(name, ""), value) for name, value in values.items()}
    thing = inspection.build(part, parameters)
    geometry = thing.result()
    shapes = _shapes(geometry, "result")
    mass, centre, matrix, density = (inspection.statement_of(thing, name) for name in ("mass", "centre", "matrix_of_inertia", "density"))
    color, color_warnings = _color(inspection.color_of(thing), {hexadecimal(shape.color) for shape in shapes if shape.color is not None})
    actuator = inspection.actuator_of(thing)
    visual, collision = _shapes(thing.visual(), "visual"), _shapes(thing.collision(), "collision")
    record = records.PartRecord(
        text=definition["text"],
        material=inspection.material_of(thing),
        color=color,
        mounts={
            name: records.MountRecord(
                pose=convert.pose(mount.location.wrapped.Transformation()), interface=mount.interface,
                tolerance=None if mount.tolerance is None else convert.length(mount.tolerance),
                features=tuple(feature.in_units(convert.length, math.radians) for feature in mount.features),
            )
            for name, mount in inspection.mounts_of(thing).items()
        },
        references=inspection.references_of(thing),
        expectations=tuple(_expectation(expected) for expected in inspection.expectations_of(thing)),
        actuator=msgspec.convert(actuator, records.ActuatorRecord | None, from_attributes=True),
        mass=_read_declared(mass, float), com=_read_declared(centre, convert.vector), matrix=_read_declared(matrix, convert.matrix),
        density=_read_declared(density, float),
        bom=_bom(thing, part), up=inspection.up_of(thing), warnings=color_warnings,
        code=None if definition["placed"] else inspection.code_location(part),
    )
    is_one = kind != "shape" and inspection.is_one_solid(geometry)  # users cannot change a library's shape class
    return BuiltPart(shapes=_round(shapes), visual=_round(visual), collision=_round(collision), record=record, one=is_one)


def _bom(thing: Thing, part: inspection.PartLike) -> records.Bom:
    """Return the entries of a part for the bill of materials, with the path of its picture relative to the workspace."""
    bom, code = inspection.bom_of(thing), inspection.code_location(part) if "picture" in thing.bom else None
    if code is not None:
        picture = os.path.relpath(asset(str(bom["picture"]), beside=code[0])).replace(os.sep, "/")  # the working folder is the workspace
        if picture.startswith("../"):
            raise ValueError(f"the picture `{bom['picture']}` is outside of the workspace")
        bom["picture"] = picture
    return bom


def _from_file(definition: dict[str, Any], context: RequestContext) -> BuiltPart:
    unit = parse_quantity(f"1 {definition['parameters'].get('unit', records.FILE_UNIT)}").value * convert.MM
    shapes, colors, repairs = read_part(os.path.join(context.root, definition["reference"]), unit)
    color, color_warnings = _color(None, colors)
    warnings = (*color_warnings, *(records.PartWarning(message=repair) for repair in repairs))
    return BuiltPart(
        shapes=shapes, record=records.PartRecord(text=definition["text"], color=color, warnings=warnings), file=True,
        faceted=definition["reference"].lower().endswith(SUFFIXES), faces=definition["parameters"].get("faces"),
    )


def _mirror(built: BuiltPart, axis: str) -> BuiltPart:
    """Return the mirror image of a built part along an axis of its frame.

    The mirror image has no order number in the bill of materials, because this number belongs to the original part.
    """
    mirror, record = SolidMirror(axis), built.record
    mounts_stay = all(mirror.keeps(mount.pose) for mount in record.mounts.values())
    image = replace(
        record, mounts={name: mount.mirror_image(axis) for name, mount in record.mounts.items()},
        com=None if record.com is None else replace(record.com, value=mirror.vector(record.com.value)),
        matrix=None if record.matrix is None else replace(record.matrix, value=mirror.matrix(record.matrix.value)),
        up=None if record.up is None else mirror.vector(record.up),
        bom={key: value for key, value in record.bom.items() if key != "number"},
        own_image=bool(built.shapes) and mounts_stay and mirror.is_image_of_itself(solid_part(built)),
    )
    shapes, visual, collision = (list(map(mirror.shape, shapes)) for shapes in (built.shapes, built.visual, built.collision))
    return replace(built, shapes=shapes, visual=visual, collision=collision, record=image)


def _shapes(geometry: Any, name: str) -> tuple[Any, ...]:
    try:
        shapes = inspection.shapes_of(geometry)
    except TypeError as fault:
        raise NoPart("invalid", f"{fault} in {name}()") from None
    for shape in shapes:
        if kernel_shape(shape) is None:
            raise NoPart("empty", f"{name}() returned an empty {type(shape).__name__}")
    return shapes


def _round(shapes: Iterable[Any]) -> list[TopoDS_Shape]:
    """Round the coordinates of the corners of build123d shapes to `DECIMALS`, and return the shapes of the CAD kernel."""
    builder, rounded = BRep_Builder(), [shape.wrapped for shape in shapes]
    for shape in rounded:
        corners = ShapeMap()
        TopExp.MapShapes_s(shape, TopAbs_VERTEX, corners)
        for corner in map(TopoDS.Vertex, corners):
            position = BRep_Tool.Pnt_s(corner).Coord()
            x, y, z = (round(coordinate, DECIMALS) + 0.0 for coordinate in position)
            if (x, y, z) != position:
                builder.UpdateVertex(corner, gp_Pnt(x, y, z), BRep_Tool.Tolerance_s(corner))
    return rounded


def _read_declared(statement: Any, converted: Callable[[Any], records.Declared]) -> records.DeclaredValue[records.Declared] | None:
    return None if statement is None else records.DeclaredValue(value=converted(statement.value), source=statement.source)


def _expectation(expected: Any) -> records.MountExpectation:
    family = expected.family
    schemas = {parameter.name: parameter for parameter in inspection.parameters_of(family)}
    values = {name: convert.to_si(schemas[name].kind, value) for name, value in expected.parameters.items() if name in schemas}
    defaults = {name: convert.to_si(p.kind, p.default) for name, p in schemas.items() if not p.required}
    named = (f"{family.__module__}:{family.__qualname__}", values, defaults)
    texts = {name: records.format_value(schemas[name].kind, value, records.LABEL_DIGITS) for name, value in values.items()}
    return records.MountExpectation(
        mount=expected.mount, child_mount=expected.child_mount,
        text=records.definition_text(*named), label=records.definition_label(*named, texts),
    )


def _color(declared: str | None, of_shapes: set[str]) -> tuple[str | None, tuple[records.PartWarning, ...]]:
    if declared is not None:
        try:
            return hex_colour(declared), ()
        except ValueError:
            return None, (records.PartWarning(message=f"`{declared}` is not a colour: use a CSS colour name or `#rrggbb`"),)
    if len(of_shapes) > 1:
        names = ", ".join(f"`{color}`" for color in sorted(of_shapes))
        return None, (records.PartWarning(message=f"expected one colour, found {names}: the material determines the colour"),)
    return next(iter(of_shapes), None), ()


def _measure(built: BuiltPart, tessellations: Tessellations, store: Store) -> records.PartRecord:
    """Measure and mesh the solids of a part, write the files to the store, and return the record with the results."""
    solid = solid_part(built)
    measures = measure(solid)
    if not measures.volume > NOTHING:
        raise NoPart("empty", f"found {measures.volume:.3g} mm^3")
    brep = store.put(written_brep(solid))  # written before meshing, which would add triangles to the shape
    solids = _meshes(solid, tessellations.fine)
    mesh = meshing.together(solids)
    metres = mesh.scale(1.0 / convert.MM)
    full_hull = meshing.hull(metres.vertices) or metres
    coarse, hull, part_warnings = metres, full_hull, built.record.warnings
    if tessellations.simulation != tessellations.fine and not built.faceted:
        coarse = meshing.together(_meshes(solid, tessellations.simulation)).scale(1.0 / convert.MM)
        hull = meshing.hull(coarse.vertices) or coarse
    meshes: dict[str, records.Mesh] = {}
    if built.faces is not None:
        if len(coarse.faces) > built.faces:
            fewer = simplify(coarse, built.faces)
            part_warnings = (*part_warnings, *_deviation_warning(coarse, fewer))
            coarse, hull = fewer, meshing.hull(fewer.vertices) or fewer
        meshes["simulation"] = stored_obj(coarse, store)
    visual = _visual(built.visual, tessellations.simulation).scale(1.0 / convert.MM) if built.visual else coarse
    meshes["visual"] = _store_mesh(visual, meshing.obj(visual), store)
    meshes["mesh"] = stored_obj(metres, store)
    meshes["hull"] = stored_obj(hull, store)
    printed, double = meshing.merge_vertices(mesh), meshing.merge_vertices(mesh, DECIMALS)
    meshes["print"] = _store_mesh(printed, meshing.stl(printed), store)
    meshes["slicing"] = _store_mesh(double, meshing.double(double), store)
    if not meshes["print"].closed:
        part_warnings = (*part_warnings, records.PartWarning(message="the mesh of the part has gaps between faces"))
    inertia = convert.unit_inertia(measures.inertia)
    return replace(
        built.record, volume=convert.volume(measures.volume), area=convert.area(measures.area), centre=convert.vector(measures.centre),
        inertia=inertia, box=(convert.vector(measures.box[0]), convert.vector(measures.box[1])), brep=brep, meshes=meshes,
        fits=fit_all(full_hull.vertices, inertia), warnings=(*part_warnings, *_overlap_warning(solids, file=built.file)),
        apart=_body_volumes(solid) if built.one else (), mounts=_compare_mounts(built.record.mounts, solid),
    )


def _compare_mounts(mounts: dict[str, records.MountRecord], solid: TopoDS_Shape) -> dict[str, records.MountRecord]:
    """Compare the mating features of mounts with the solid of the part, and add the contradictions to the mounts."""
    if not any(mount.features for mount in mounts.values()):
        return mounts
    measured = features_of(solid, outlines=False)  # outlines take a third of the time
    return {name: replace(mount, contradictions=contradictions(mount.features, mount.pose, measured)) for name, mount in mounts.items()}


def _body_volumes(solid: TopoDS_Shape) -> tuple[float, ...]:
    """Return the volumes [m^3] of the bodies of a part, the largest volume first. The result is empty if all solids of the part are
    connected.
    """
    solids = solids_of(solid)
    bodies = bodies_of(solids) if len(solids) > 1 else []
    if len(bodies) < 2:
        return ()
    return tuple(sorted((convert.volume(math.fsum(measure(one).volume for one in body)) for body in bodies), reverse=True))


def _deviation_warning(mesh: meshing.Triangles, fewer: meshing.Triangles) -> tuple[records.PartWarning, ...]:
    """Return a warning if a simplified mesh deviates too much from the original. Both meshes are in metres."""
    away, size = deviation(mesh, fewer), float(np.ptp(mesh.vertices, axis=0).max())
    if away <= DEVIATION * size:
        return ()
    mesh_text = f"the simulation mesh ({len(fewer.faces)} triangles)"
    return (records.PartWarning(message=f"{mesh_text} deviates from the part by up to {away * convert.MM:.2g} mm; increase `faces`"),)


def _overlap_warning(solids: Sequence[meshing.Triangles], *, file: bool) -> tuple[records.PartWarning, ...]:
    """Return a warning if solids of a part overlap, because overlapping volume counts twice in the integrals.

    An overlap of a thread with its hole is not reported.
    """
    common, total = meshing.counted_twice(solids) if len(solids) > 1 else 0.0, math.fsum(mesh.volume for mesh in solids)
    if common <= max(OVERLAP * total, 1.0):
        return ()
    overlap = f"the {len(solids)} solids overlap by {float(f'{common:.4g}'):g} mm^3"  # 1000, not 1e+03
    return (records.PartWarning(message=f"{overlap}; {'unite the solids in the CAD program' if file else 'fuse the solids (`a + b`)'}"),)


def solid_part(built: BuiltPart) -> TopoDS_Shape:
    """Return the solids of a part, as a single solid or as a compound of several solids. Raises `NoPart` if the geometry contains no
    solids.

    The result has no location of its own, because the kernel would write an additional assembly for each part with a location to a STEP
    file.
    """
    solids = [at_origin(solid) for shape in built.shapes for solid in solids_of(shape)]
    if not solids:
        raise NoPart("empty", f"{'the file' if built.file else 'result()'} contains {_content_text(built.shapes)}")
    return compound_of(solids)


def _content_text(shapes: Sequence[TopoDS_Shape]) -> str:
    """Describe the content of shapes that do not contain a solid, for an error message."""
    kinds = {"faces": TopAbs_FACE, "edges": TopAbs_EDGE, "points": TopAbs_VERTEX}
    return next(
        (f"only {name}" for name, kind in kinds.items() if any(True for shape in shapes for _ in subshapes(shape, kind))),
        "no geometry",
    )


def written_brep(shape: TopoDS_Shape) -> bytes:
    """Write a shape in the binary format of the CAD kernel, without triangles, and return the bytes."""
    stream = io.BytesIO()
    BinTools.Write_s(shape, stream, False, False, BinTools_FormatVersion.BinTools_FormatVersion_CURRENT)
    return stream.getvalue()


def _triangles(shape: TopoDS_Shape, tessellation: Tessellation) -> meshing.Triangles:
    return tessellate(shape, tessellation.linear * convert.MM, tessellation.angular)


def _meshes(shape: TopoDS_Shape, tessellation: Tessellation) -> list[meshing.Triangles]:
    """Mesh each solid separately, so that touching solids do not share edges. Return one mesh for each solid, with faces that point
    outwards.
    """
    return [_triangles(solid, tessellation).outward() for solid in solids_of(shape)]


def _visual(shapes: Sequence[TopoDS_Shape], tessellation: Tessellation) -> meshing.Triangles:
    mesh = meshing.together([_triangles(shape, tessellation) for shape in shapes])
    if len(mesh.faces) == 0:
        raise NoPart("invalid", "visual() must return faces or solids")
    return mesh


def _pieces(
    shapes: Sequence[TopoDS_Shape], tessellation: Tessellation, store: Store,
) -> tuple[tuple[records.Mesh | Primitive, ...], list[records.PartWarning]]:
    """Return the convex shapes that replace the solids of `collision()`, and warnings about solids that are not convex."""
    solids = [solid for shape in shapes for solid in solids_of(shape)]
    if shapes and not solids:
        raise NoPart("invalid", "collision() must return convex solids")
    pieces: list[records.Mesh | Primitive] = []
    hull_warnings: list[records.PartWarning] = []
    for number, solid in enumerate(solids, start=1):
        primitive = primitive_of(solid)
        if primitive is not None:
            pieces.append(primitive)
            continue
        mesh = _triangles(solid, tessellation).scale(1.0 / convert.MM)
        hull = meshing.hull(mesh.vertices) or mesh
        outside = hull.volume - abs(mesh.volume)
        if outside > NOT_CONVEX * hull.volume:
            message = f"solid {number} of collision() is not convex ({outside / hull.volume:.1%} of its hull is empty); use convex solids"
            hull_warnings.append(records.PartWarning(message=message))
        pieces.append(stored_obj(hull, store))
    return tuple(pieces), hull_warnings


def _store_mesh(mesh: meshing.Triangles, data: bytes, store: Store) -> records.Mesh:
    return records.Mesh(
        sha256=store.put(data), size=len(data), vertices=len(mesh.vertices), faces=len(mesh.faces), closed=mesh.closed,
        flat=mesh.flat,
    )


def stored_obj(mesh: meshing.Triangles, store: Store) -> records.Mesh:
    """Write a mesh to the store as an OBJ file, without changing its unit."""
    rounded = meshing.merge_vertices(mesh)
    return _store_mesh(rounded, meshing.obj(rounded), store)

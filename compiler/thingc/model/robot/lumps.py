"""Replace nested assemblies with `as: lump` by one rigid body.

The body has the mass, the centre of mass, the inertia and the exported mounts that the nested assembly has in one pose. Its shapes are one
box around each link. Records from the lock file contain all numbers for this, so no part is built.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from msgspec.structs import asdict, replace

from thingc.base.diagnostics import Note, Report, first_notes
from thingc.base.inertia import named_moments, total
from thingc.base.one_line_repr import format_count
from thingc.base.pose import Pose, make_translation
from thingc.base.primitives import Primitive
from thingc.geometry.lock.lock import LOCK_FILE
from thingc.geometry.lock.reader import LockOnlyGeometry
from thingc.geometry.record import PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.model.assembly.instance_tree import unplaced_components
from thingc.model.assembly.linking import link
from thingc.model.assembly.mass import slicings_of
from thingc.model.assembly.shape_links import Meshes, bounding_box
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.link_definition import LinkShape, link_of
from thingc.model.resolve.mirroring import with_components, with_own_images
from thingc.model.resolve.overrides import MOMENTS
from thingc.model.resolve.parts import FAILURES
from thingc.model.resolve.types import AssemblyDefinition, BomEntry, Component, ExtraMount, Overrides, Reference, StatedValue
from thingc.model.robot.kinematic_tree import root
from thingc.model.robot.kinematics import occurrence_poses

_SHOWN = 8


def with_lumps(
    model: AssemblyDefinition, locked: Callable[[], LockOnlyGeometry], meshes_of: Callable[[AssemblyDefinition], Meshes], report: Report,
) -> AssemblyDefinition:
    """Return a copy of a model in which every lump contains only one link, which the bill of materials lists as one part.

    `locked` returns the reader of the lock file, and `meshes_of` the mesh files that links of a model use. If parts of a lump are not in
    the lock file, this is reported, and the component has no definition.
    """
    bodies: dict[tuple[object, ...], AssemblyDefinition | None] = {}  # equal lumps are the same object

    def with_body(component: Component) -> Component:
        nested = component.definition
        if not isinstance(nested, AssemblyDefinition) or not nested.lump:
            return component
        key = (nested.document, nested.parameters, nested.mirror, nested.modes[0].pose)
        if key not in bodies:
            bodies[key] = _lump(component, nested, locked, meshes_of(nested), report)
        return replace(component, definition=bodies[key], bom=replace(component.bom, one=True))

    return with_components(model, with_body)


def _lump(
    component: Component, nested: AssemblyDefinition, locked: Callable[[], LockOnlyGeometry], meshes: Meshes, report: Report,
) -> AssemblyDefinition | None:
    definitions = nested.part_definitions()
    records: Mapping[str, PartRecord | PartFailure] = {}
    if definitions:
        records = locked().realize(definitions)
        nested = with_own_images(nested, records)
        records = locked().slice(definitions, records, slicings_of(nested, records))
        if not _check_records(component, definitions, records, locked(), report):
            return None
    assembly = link(nested, records, report, meshes=meshes)
    robot = root(assembly, assembly.modes[0], report) if assembly is not None else None
    if assembly is None or robot is None:
        return None
    base = unplaced_components(nested)[0]
    poses = occurrence_poses(robot, robot.start.q)  # the base is fixed at the origin of the world
    body = total(one.properties.seen_from(pose) for one, pose in zip(assembly.occurrences, poses, strict=True))
    estimated = any(one.mass_source == "estimated" for one in assembly.occurrences)

    def value_of(*numbers: float) -> StatedValue:
        return StatedValue(value=numbers, source="estimated" if estimated else "derived", origin=component.origin, computed=True)

    mounts = {}
    for exported in assembly.exported:
        if "/" not in exported.path:
            mount = assembly.occurrences[exported.occurrence].mounts[exported.mount]
            values = {**asdict(mount), "pose": poses[exported.occurrence] @ exported.pose, "origin": exported.origin}
            mounts[exported.path] = ExtraMount(**values)
    moments = named_moments(body.inertia)
    overrides = Overrides(
        mass=value_of(body.mass), com=value_of(*body.centre), inertia=value_of(*(moments[name] for name in MOMENTS)),
    ) if body.mass > 0.0 else Overrides()
    rigid = Component(
        name=base, key=base, definition=link_of(tuple(_boxes(assembly, poses))), frame=False, placement=None, material=None,
        overrides=overrides, mounts=mounts, bom=BomEntry(), origin=next(one.origin for one in nested.components if one.name == base),
    )
    exports = {name: Reference(path=(base,), mount=name, origin=mount.origin) for name, mount in mounts.items()}
    return replace(
        nested, components=(rigid,), mounts=exports, joints=(), links=(), poses=(), modes=(), raw=(), added=(), tendons=(), sensors=(),
        names=(), loose=(), order=(), simulation={}, step_origin=(),
    )


def _check_records(
    component: Component, definitions: Sequence[PartDefinition], records: Mapping[str, PartRecord | PartFailure],
    locked: LockOnlyGeometry, report: Report,
) -> bool:
    """Return whether the lock file contains all parts of a lump. Report missing and outdated parts as one error."""
    failures: dict[str, PartFailure] = {}
    for part in definitions:
        record: PartRecord | PartSchema | PartFailure | None = records.get(part.text)
        if record is None or isinstance(record, PartRecord) and not record.exact:
            record = locked.describe([part.reference]).get(part.reference)
        if record is None or isinstance(record, PartSchema):
            message = f"`{LOCK_FILE}` does not contain the parameters or the process"
            record = PartFailure(subject=part.reference, kind="unlocked", message=message)
        if isinstance(record, PartFailure):
            failures[part.label] = record
    if failures:
        code, _, help = FAILURES[next(iter(failures.values())).kind]
        notes = [Note(message=f"`{label}`: {failure.message}") for label, failure in failures.items()]
        message = f"`{LOCK_FILE}` is out of date for {format_count(len(failures), 'part')} of the lump `{component.name}`"
        report.add(code, message, component.origin, help=f"{help}; or remove `as: lump`", notes=first_notes(notes, _SHOWN, "more part"))
    return not failures


def _boxes(assembly: Assembly, poses: Sequence[Pose]) -> Iterator[LinkShape]:
    """Yield a box around the parts of each link, along the axes of the link. `poses` contains the poses of all occurrences."""
    for one in assembly.links:
        boxes = [pose.around(box) for member, pose in zip(one.members, one.poses) if (box := assembly.occurrences[member].box) is not None]
        corners = bounding_box(boxes)
        if corners is not None:
            (ax, ay, az), (bx, by, bz) = corners
            centre = poses[one.frame] @ make_translation((ax + bx) / 2.0, (ay + by) / 2.0, (az + bz) / 2.0)
            size = ((bx - ax) / 2.0, (by - ay) / 2.0, (bz - az) / 2.0)
            yield LinkShape(solid=Primitive(shape="box", size=size, pose=centre), drawn=True, touches=True, origin=one.origin)

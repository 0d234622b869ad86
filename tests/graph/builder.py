"""Resolved models, part records and occurrences for tests, and the mating formulas written independently in numpy.

Nothing here calls the code under test: poses are passed and returned as numpy matrices."""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report, Severity
from thingc.base.inertia import MassProperties, total
from thingc.base.joints.kinds import KINDS
from thingc.base.pose import NO_POSE, Pose
from thingc.base.source import Origin, Span
from thingc.geometry.record import (
    ActuatorRecord,
    DeclaredValue,
    Mesh,
    MountExpectation,
    MountRecord,
    PartDefinition,
    PartFailure,
    PartRecord,
    PartWarning,
)
from thingc.geometry.store.local import Store
from thingc.model.assembly.hag import Definition
from thingc.model.assembly.kinematics import coordinates, forward_kinematics, joints_of, neighbourhood
from thingc.model.assembly.linking import link
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.model.resolve.coordinates import CoordinateName, Dynamics, Limit, Mimic
from thingc.model.resolve.types import (
    AssemblyDefinition,
    At,
    Attach,
    BomEntry,
    Component,
    Drive,
    ExtraMount,
    Joint,
    LinkName,
    Material,
    Mode,
    NamedPose,
    Overrides,
    Process,
    RawAttribute,
    Reference,
    StatedValue,
)
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.types import Robot

Array = Any
FILE = "/robots/robot.yaml"
MATE = np.array([[0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]], dtype=float)


def where(line: int, file: str = FILE) -> Origin:
    return (Span(file=file, line=line, column=3, end_line=line, end_column=9),)


# --- matrices, written from the formulas of the semantics ----------------------------------------------------------


def rz(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def ry(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])


def rx(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])


def t(x: float, y: float, z: float) -> Array:
    out = np.eye(4)
    out[:3, 3] = (x, y, z)
    return out


def inv(matrix: Array) -> Array:
    return np.linalg.inv(matrix)


LEAD = 0.05


def motion(kind: str, *q: float) -> Array:
    """Motion of a joint of this kind, independent of the code under test. `ball` and `free` are not included."""
    by_hand: dict[str, Callable[..., Array]] = {
        "revolute": rz, "continuous": rz, "prismatic": lambda d: t(0, 0, d), "fixed": lambda *_: np.eye(4),
        "screw": lambda a: rz(a) @ t(0, 0, LEAD * a / (2 * np.pi)), "cylindrical": lambda a, d: rz(a) @ t(0, 0, d),
        "universal": lambda a, b: rx(a) @ ry(b), "planar": lambda x, y, a: t(x, y, 0) @ rz(a),
    }
    assert kind in by_hand, f"write the motion of `{kind}` by hand, as a matrix: `motion` in tests/graph/builder.py"
    return by_hand[kind](*q)


def mated(
    X_PA: Array, X_CB: Array, *, turn: float = 0.0, gap: float = 0.0, kind: str = "fixed", q: float | Sequence[float] = 0.0,
    offset: float = 0.0,
) -> Array:
    """X_PC = X_PA Rz(turn) Tz(gap) X_J(q + offset) M inv(X_CB). With several coordinates, each has the offset."""
    values = [one + offset for one in (q if isinstance(q, Sequence) else [q])]
    return X_PA @ rz(turn) @ t(0, 0, gap) @ motion(kind, *values) @ MATE @ inv(X_CB)


def as_pose(matrix: Array) -> Pose:
    """The pose of a homogeneous 4 x 4 matrix."""
    rows = np.asarray(matrix).tolist()
    return Pose(rotation=tuple(tuple(row[:3]) for row in rows[:3]), translation=tuple(row[3] for row in rows[:3]))


def as_matrix(pose: Pose) -> Array:
    return np.array(pose.rows())


# --- parts ---------------------------------------------------------------------------------------------------------


def box_inertia(size: tuple[float, float, float]) -> Array:
    """Inertia of a box of density 1 about its centre [m^5]: V/12 (b^2 + c^2) and so on."""
    a, b, c = size
    return np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) * (a * b * c / 12.0)


def record(name: str, **said: Any) -> PartRecord:
    """A part record. Without further arguments, it has no geometry, no mounts and no stated values."""
    blank = {
        "material": None,
        "color": None,
        "volume": 0.0,
        "area": 0.0,
        "centre": (0.0, 0.0, 0.0),
        "inertia": ((0.0, 0.0, 0.0),) * 3,
        "box": None,
        "mounts": {},
        "references": (),
        "expectations": (),
        "actuator": None,
        "mass": None,
        "com": None,
        "matrix": None,
        "density": None,
        "bom": {},
        "warnings": (),
        "fits": {},
        "meshes": {},
        "pieces": (),
        "convex": {},
        "brep": None,
        "code": None,
    }
    return PartRecord(text=name, **{**blank, **said})


def box(
    name: str,
    size: tuple[float, float, float] = (0.1, 0.06, 0.04),
    *,
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0),
    mounts: Mapping[str, Array] | None = None,
    material: str | None = "petg",
    **over: Any,
) -> PartRecord:
    """A box of exact volume, area, centre and inertia."""
    a, b, c = size
    low = tuple(m - s / 2 for m, s in zip(centre, size))
    high = tuple(m + s / 2 for m, s in zip(centre, size))
    plain = {
        "material": material,
        "volume": a * b * c,
        "area": 2 * (a * b + b * c + a * c),
        "centre": centre,
        "inertia": tuple(tuple(row) for row in box_inertia(size).tolist()),
        "box": (low, high),
        "mounts": {key: MountRecord(pose=as_pose(matrix)) for key, matrix in (mounts or {}).items()},
        "code": ("/robots/parts/boxes.py", 12),
    }
    return record(name, **{**plain, **over})


def bare(name: str, **over: Any) -> PartRecord:
    """A Thing without geometry."""
    zero = ((0.0, 0.0, 0.0),) * 3
    return box(name, **{"material": None, "volume": 0.0, "area": 0.0, "inertia": zero, "box": None, **over})


def binary_stl(vertices: Any, faces: Any) -> bytes:
    """Binary STL of triangles (vertex indices). Normals are 0, because readers compute them."""
    points = np.asarray(vertices)
    out = [b"\0" * 80, struct.pack("<I", len(faces))]
    for face in faces:
        out.append(struct.pack("<12fH", 0, 0, 0, *points[list(face)].ravel(), 0))
    return b"".join(out)


def kept(store: Store, data: bytes, vertices: int, faces: int, *, closed: bool = True, flat: bool = False) -> Mesh:
    """Store the data of a mesh and return its record."""
    return Mesh(sha256=store.put(data), size=len(data), vertices=vertices, faces=faces, closed=closed, flat=flat)


def part(text: str, **parameters: Any) -> PartDefinition:
    return PartDefinition(reference=text.split("(")[0], kind="code", parameters=tuple(sorted(parameters.items())), text=text, label=text)


def material(name: str, density: float | None = 1000.0, **said: Any) -> Material:
    blank = {"color": None, "slide": None, "torsion": None, "roll": None, "process": None, "origin": where(400)}
    return Material(name=name, density=density, **{**blank, **said})


PETG = material("petg")

# --- documents -----------------------------------------------------------------------------------------------------


def ref(text: str, line: int = 1) -> Reference:
    """Reference to a mount: `hand.cap.pen` is the mount `pen` of `hand.cap`."""
    *path, mount = text.split(".")
    return Reference(path=tuple(path), mount=mount, origin=where(line))


def whole(text: str, line: int = 1) -> Reference:
    """Reference to a component: `hand.cap` is the component itself."""
    return Reference(path=tuple(text.split(".")), mount=None, origin=where(line))


def attach(mine: str, to: str, *, turn: float = 0.0, gap: float = 0.0, line: int = 1) -> Attach:
    """An attachment. `mine` starts with the name of the component itself."""
    return Attach(mount=ref(mine, line), to=ref(to, line), turn=turn, gap=gap, origin=where(line))


def laid(to: str, matrix: Array, *, line: int = 1) -> At:
    return At(to=ref(to, line), pose=as_pose(matrix), origin=where(line))


def component(
    name: str,
    definition: PartDefinition | AssemblyDefinition | str | None,
    placement: Attach | At | None = None,
    *,
    line: int = 1,
    frame: bool = False,
    material: Material | None = None,
    mounts: Mapping[str, Array] | None = None,
    bom: BomEntry | None = None,
    **overrides: Any,
) -> Component:
    return Component(
        name=name,
        key=name,
        definition=part(definition) if isinstance(definition, str) else definition,
        frame=frame,
        placement=placement,
        material=material,
        overrides=Overrides(**overrides),
        bom=bom or BomEntry(),
        origin=where(line),
        mounts={key: ExtraMount(pose=as_pose(m), interface=None, origin=where(line + 1)) for key, m in (mounts or {}).items()},
    )


def stated(*value: float, source: str = "stated", line: int = 1) -> StatedValue:
    return StatedValue(value=tuple(value), source=source, origin=where(line))


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    *,
    lower: float | None = -3.0,
    upper: float | None = 3.0,
    effort: float | None = None,
    velocity: float | None = None,
    turn: float = 0.0,
    gap: float = 0.0,
    offset: float = 0.0,
    drive: Drive | None = None,
    mimic: Mimic | None = None,
    line: int = 1,
    **dynamics: float,
) -> Joint:
    moves = kind in ("revolute", "prismatic")
    return Joint(
        name=CoordinateName(name),
        kind=KINDS[kind],
        twist=next(iter(KINDS[kind].twists), None),
        parent=ref(parent, line),
        child=ref(child, line),
        limit=Limit(lower=lower if moves else None, upper=upper if moves else None, effort=effort, velocity=velocity),
        dynamics=Dynamics(**dynamics),
        turn=turn,
        gap=gap,
        offset=offset,
        drive=drive,
        mimic=mimic,
        origin=where(line),
        spans={"limit.effort": where(line + 1)[0]},
    )


def coordinates_of(name: str, parent: str, child: str, kind: str, **said: Any) -> list[Joint]:
    """The coordinates of a joint of any kind. A screw has the lead `LEAD`."""
    found = KINDS[kind]
    twists = found.with_lead(LEAD) if found.leads else found.twists
    one = joint(name, parent, child, kind, **said)
    if len(twists) < 2:
        return [replace(one, twist=next(iter(twists), None))]
    return [replace(one, name=one.name.with_number(k), twist=twist) for k, twist in enumerate(twists)]


def mimic(leader: str, multiplier: float, offset: float = 0.0, higher: tuple[float, ...] = ()) -> Mimic:
    return Mimic(joint=CoordinateName(leader), multiplier=multiplier, offset=offset, higher=higher, origin=where(1))


def pose(name: str, line: int = 300, **values: float) -> NamedPose:
    """A named pose. Joint paths are keywords with `__` for `/`."""
    by_path = {key.replace("__", "/"): value for key, value in values.items()}
    origins = {key: where(line + 1 + k) for k, key in enumerate(by_path)}
    return NamedPose(name=name, values=by_path, origins=origins, origin=where(line))


def mode(name: str, root: Reference, base: str = "fixed", *, at: Array | None = None, line: int = 200, **over: Any) -> Mode:
    plain = {
        "gravity": (0.0, 0.0, -9.81),
        "pose": None,
        "poses": (),
        "actuators": None,
        "exclude": (),
        "adhesion": (),
        "simulation": {},
    }
    return Mode(
        **{
            **plain,
            "name": name,
            "root": root,
            "base": base,
            "at": as_pose(np.eye(4) if at is None else at),
            "origin": where(line),
            **over,
        }
    )


def assembly(
    name: str,
    components: Iterable[Component],
    joints: Iterable[Joint] = (),
    *,
    materials: Iterable[Material] = (PETG,),
    links: Mapping[str, str] | None = None,
    mounts: Mapping[str, str] | None = None,
    poses: Iterable[NamedPose] = (),
    modes: Iterable[Mode] | None = None,
    raw: Iterable[tuple[tuple[str, ...], str]] = (),
    document: str | None = None,
    text: str | None = None,
    line: int = 100,
) -> AssemblyDefinition:
    inside = tuple(components)
    bases = [c.name for c in inside if c.placement is None]
    return AssemblyDefinition(
        document=document or f"{name}.yaml",
        name=name,
        description="",
        parameters=(),
        text=text or name,
        label=text or name,
        materials={m.name: m for m in materials},
        components=inside,
        joints=tuple(joints),
        links=tuple(
            LinkName(name=key, component=whole(value), origin=where(line + 10 + k))
            for k, (key, value) in enumerate((links or {}).items())
        ),
        mounts={key: ref(value, line + 20 + k) for k, (key, value) in enumerate((mounts or {}).items())},
        poses=tuple(poses),
        modes=tuple(modes) if modes is not None else (mode("default", whole(bases[0])),),
        simulation={},
        raw=tuple(RawAttribute(target="mjcf", path=path, value=value, origin=where(line + 30)) for path, value in raw),
        origin=where(line),
    )


def occurrence(
    index: int,
    path: str,
    definition: PartDefinition | None,
    made: PartRecord | None,
    *,
    origin: Origin,
    material: Material | None = None,
    overrides: Overrides | None = None,
    bom: BomEntry | None = None,
    **said: Any,
) -> Occurrence:
    """An occurrence of a part, or of a frame. By default it has no mass, no colour and only the mount `origin`."""
    component = Component(
        name=path.rpartition("/")[2],
        key=path.rpartition("/")[2],
        definition=definition,
        frame=definition is None,
        placement=None,
        material=material,
        overrides=overrides or Overrides(),
        mounts={},
        bom=bom or BomEntry(),
        origin=origin,
    )
    if definition is None:
        known = Definition(text="frame", label="frame", reference="frame", kind="frame")
    else:
        kind = "part" if definition.kind == "code" else "file"
        known = Definition(text=definition.text, label=definition.label, reference=definition.reference, kind=kind)
    blank = {
        "color": None,
        "properties": MassProperties(mass=0.0),
        "mass_source": "derived",
        "mounts": {"origin": MountRecord(pose=NO_POSE)},
    }
    return Occurrence(
        path=path,
        index=index,
        definition=known,
        component=component,
        record=made,
        material=material,
        overrides=component.overrides,
        bom=component.bom,
        origin=origin,
        **{**blank, **said},
    )


# --- running -------------------------------------------------------------------------------------------------------


def linked(model: AssemblyDefinition, *records: PartRecord, but: Collection[Code] = ()) -> Assembly:
    """Link a model and assert that it has no diagnostics, except those in `but`, which random models may have."""
    report = Report()
    found = link(model, {record.text: record for record in records}, report)
    assert [d.message for d in report.diagnostics if d.code not in but] == []
    assert found is not None
    return found


def poses(assembly: Assembly, q: Mapping[str, float], base: Pose = NO_POSE) -> tuple[Pose, ...]:
    """Return the poses of all occurrences in document order, given the pose `base` of the assembly's base occurrence.

    `q` maps joint paths to positions [rad or m]. Positions of joints that are not in `q` are computed from mimics, or are 0.
    """
    full = coordinates(joints_of(assembly), q)
    count = len(assembly.occurrences)
    at = forward_kinematics(assembly.mates, neighbourhood(count, assembly.mates), assembly.base, base, full)
    return tuple(at[index] for index in range(count))


def faults(model: AssemblyDefinition, *records: PartRecord | PartFailure) -> Report:
    """Link a model that has errors and return the report."""
    report = Report()
    found = link(model, {r.subject if isinstance(r, PartFailure) else r.text: r for r in records}, report)
    assert found is None
    assert report.failed
    return report


def said(report: Report) -> list[tuple[str, str, str | None, int | None]]:
    """Code name, message, help and line of every diagnostic."""
    return [(d.code.name, d.message, d.help, d.span.line if d.span else None) for d in report.diagnostics]


def warnings(model: AssemblyDefinition, *records: PartRecord) -> Report:
    """Link a model that has only warnings and return the report."""
    report = Report()
    assert link(model, {record.text: record for record in records}, report) is not None
    assert all(d.severity is Severity.WARNING for d in report.diagnostics)
    return report


__all__ = [
    "FILE",
    "MATE",
    "PETG",
    "ActuatorRecord",
    "Array",
    "Component",
    "DeclaredValue",
    "Drive",
    "Joint",
    "MountExpectation",
    "PartFailure",
    "PartRecord",
    "PartWarning",
    "Process",
    "Reference",
    "as_matrix",
    "as_pose",
    "assembly",
    "attach",
    "bare",
    "box",
    "box_inertia",
    "component",
    "faults",
    "inv",
    "joint",
    "laid",
    "linked",
    "mated",
    "material",
    "mimic",
    "mode",
    "motion",
    "part",
    "pose",
    "ref",
    "rx",
    "ry",
    "rz",
    "said",
    "stated",
    "t",
    "warnings",
    "where",
    "whole",
]


PLATE = box("p:Plate", mounts={"servo_seat": t(0, 0, 0.02), "foot": rx(np.pi) @ t(0, 0, 0.02)})
CAP = box("p:Cap", mounts={"top": t(0, 0, 0.02), "foot": rx(np.pi) @ t(0, 0, 0.02)})


def notes(report: Report, index: int = 0) -> list[tuple[str, str | None, int | None]]:
    """Message, file and line of each note of one diagnostic."""
    return [
        (n.message, n.span.file if n.span else None, n.span.line if n.span else None) for n in report.diagnostics[index].notes
    ]


def mass_properties(robot: Robot, q: Mapping[str, float]) -> MassProperties:
    """Compute the total mass [kg], the centre of mass [m] and the inertia [kg m^2] of a robot, in the frame of the root link.

    The inertia is about the centre of mass.
    """
    links = robot.assembly.links
    placed = body_poses(robot, q, NO_POSE)
    return total(links[body.link].properties.seen_from(pose) for body, pose in zip(robot.bodies, placed))


def link_names(robot: Robot) -> tuple[str, ...]:
    """Return the link names of all bodies, in the order of `robot.bodies`."""
    return tuple(robot.assembly.links[body.link].name for body in robot.bodies)

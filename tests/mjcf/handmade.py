"""Robots for tests of the MJCF emitter: boxes and cylinders whose properties are computed without thingc.

Poses of bodies are 4 x 4 numpy matrices, so the tests' own chains of matrices are the oracle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from msgspec.structs import replace

from graph import builder
from graph.builder import as_pose, binary_stl, kept, where
from thingc.base.diagnostics import Report
from thingc.base.inertia import MassProperties
from thingc.base.joints.kinds import KINDS
from thingc.base.joints.twist import Twist
from thingc.base.pose import NO_POSE
from thingc.base.primitives import Primitive
from thingc.base.source import Origin
from thingc.geometry.record import PartDefinition, PartRecord
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import (
    ActuatorModel,
    Adhesion,
    Assembly,
    JointEdge,
    Link,
    LinkedMode,
    LinkedMount,
    Mate,
    Occurrence,
)
from thingc.model.resolve.coordinates import CoordinateName, Dynamics, Limit, Mimic
from thingc.model.resolve.types import Material, NamedPose, Overrides, RawAttribute
from thingc.model.robot.types import Body, Keyframe, Robot, Site, TreeJoint
from thingc.targets.request import EmitRequest

FILE = "/somewhere/robot.yaml"


def at(line: int) -> Origin:
    """Origin of an element on a line of the document."""
    return where(line, FILE)


def matrix(xyz: Any = (0.0, 0.0, 0.0), rotation: Any = None) -> np.ndarray:
    out = np.eye(4)
    out[:3, 3] = xyz
    if rotation is not None:
        out[:3, :3] = rotation
    return out


def spin(axis: Any, angle: float) -> np.ndarray:
    """Rotation about an axis by Rodrigues' formula."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


# --- parts --------------------------------------------------------------------------------------------------------

_CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
_CUBE_FACES = (
    (0, 1, 3),
    (0, 3, 2),
    (4, 6, 7),
    (4, 7, 5),
    (0, 4, 5),
    (0, 5, 1),
    (2, 3, 7),
    (2, 7, 6),
    (0, 2, 6),
    (0, 6, 4),
    (1, 5, 7),
    (1, 7, 3),
)


def box_vertices(low: Any, high: Any) -> np.ndarray:
    return np.asarray(low) + _CUBE * (np.asarray(high) - np.asarray(low))


def obj(vertices: Any, faces: Any) -> bytes:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices).tolist()]
    return "\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces)]).encode() + b"\n"


@dataclass(frozen=True)
class Part:
    """A part with its analytic mass properties at a density [kg/m^3] of 1000."""

    definition: PartDefinition
    record: PartRecord
    properties: MassProperties


def box_part(store: Store, low: Any, high: Any, **changes: Any) -> Part:
    """A box between two corners [m] in the part's own frame. It is not centred, so that errors of re-centring are visible."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    size, vertices = high - low, box_vertices(low, high)
    volume = float(np.prod(size))
    mass = 1000.0 * volume
    moments = [mass / 12 * (float(size @ size) - float(s * s)) for s in size]
    text = f"boxes:Box(high={high.tolist()!r}, low={low.tolist()!r})"
    flat = bool((size == 0).any())
    return _part(
        store,
        text,
        "boxes:Box",
        vertices,
        _CUBE_FACES,
        mass,
        (low + high) / 2,
        np.diag(moments),
        (low, high),
        Primitive(shape="box", size=tuple((size / 2).tolist()), pose=as_pose(matrix((low + high) / 2))),
        flat=flat,
        **changes,
    )


def cylinder_part(store: Store, radius: float, length: float, **changes: Any) -> Part:
    """A cylinder [m] along z with its centre at the origin; its mesh has 24 sides."""
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.stack([radius * np.cos(angles), radius * np.sin(angles)], axis=1)
    half = length / 2
    vertices = np.vstack([np.c_[ring, np.full(24, -half)], np.c_[ring, np.full(24, half)], [[0, 0, -half], [0, 0, half]]])
    faces = [
        f
        for k in range(24)
        for f in (
            (k, (k + 1) % 24, 24 + (k + 1) % 24),
            (k, 24 + (k + 1) % 24, 24 + k),
            (48, (k + 1) % 24, k),
            (49, 24 + k, 24 + (k + 1) % 24),
        )
    ]
    mass = 1000.0 * np.pi * radius**2 * length
    across = mass * (3 * radius**2 + length**2) / 12
    box = (np.array([-radius, -radius, -half]), np.array([radius, radius, half]))
    return _part(
        store,
        f"boxes:Rod(length={length!r}, radius={radius!r})",
        "boxes:Rod",
        vertices,
        faces,
        mass,
        np.zeros(3),
        np.diag([across, across, mass * radius**2 / 2]),
        box,
        Primitive(shape="cylinder", size=(radius, half), pose=NO_POSE),
        **changes,
    )


def _part(
    store: Store,
    text: str,
    reference: str,
    vertices: Any,
    faces: Any,
    mass: float,
    centre: Any,
    inertia: Any,
    box: Any,
    fit: Primitive,
    *,
    flat: bool = False,
    **changes: Any,
) -> Part:
    solid = obj(vertices, faces)
    count = (len(vertices), len(faces))
    said = {
        "volume": mass / 1000,
        "centre": tuple(centre.tolist()),
        "inertia": _rows(inertia),
        "box": (tuple(box[0].tolist()), tuple(box[1].tolist())),
        "fits": {fit.shape: fit},
        "meshes": {
            "visual": kept(store, solid, *count, flat=flat),
            "hull": kept(store, solid, *count, flat=flat),
            "mesh": kept(store, solid, *count, flat=flat),
            "print": kept(store, binary_stl(vertices, faces), *count, flat=flat),
        },
    }
    return Part(
        definition=PartDefinition(reference=reference, kind="code", parameters=(), text=text, label=text.partition("(")[0]),
        record=builder.record(text, **{**said, **changes}),
        properties=MassProperties(mass=mass, centre=tuple(centre.tolist()), inertia=_rows(inertia)),
    )


def _rows(m: Any) -> Any:
    return tuple(tuple(row) for row in np.asarray(m, dtype=float).tolist())


# --- robots -------------------------------------------------------------------------------------------------------


@dataclass
class Piece:
    """An occurrence: its path, its part and its pose in its link."""

    path: str
    part: Part
    pose: np.ndarray = field(default_factory=lambda: np.eye(4))
    material: Material | None = None
    color: str | None = None
    overrides: Overrides = field(default_factory=Overrides)


@dataclass
class Segment:
    """A body of the tree: its pieces, the index of its parent, its pose in the parent at q = 0, and its joint."""

    name: str
    pieces: list[Piece]
    parent: int | None = None
    pose: np.ndarray = field(default_factory=lambda: np.eye(4))
    joint: str | None = None
    kind: str = "hinge"
    axis: Any = (0.0, 0.0, 1.0)
    anchor: Any = (0.0, 0.0, 0.0)
    limit: Limit = field(default_factory=Limit)
    dynamics: Dynamics = field(default_factory=Dynamics)
    mimic: Mimic | None = None
    actuator: ActuatorModel | None = None


def material(name: str = "petg", **values: Any) -> Material:
    return builder.material(name, **{"origin": at(90), **values})


def drive(kind: str = "position", **values: Any) -> ActuatorModel:
    blank = {"kp": 20.0 if kind == "position" else None, "kv": None, "effort": None, "velocity": None, "origin": at(70)}
    return ActuatorModel(kind=kind, **{**blank, **values})


def raw(line: int, path: str, value: str) -> RawAttribute:
    return RawAttribute(target="mjcf", path=tuple(path.split(" ")), value=value, origin=at(line))


def total(properties: Any) -> MassProperties:
    """Combine bodies in one frame, computed with numpy: the oracle of `inertia.total`."""
    mass = sum(p.mass for p in properties)
    centre = sum(p.mass * np.array(p.centre) for p in properties) / mass
    inertia = np.zeros((3, 3))
    for p in properties:
        d = np.array(p.centre) - centre
        inertia += np.array(p.inertia) + p.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return MassProperties(mass=float(mass), centre=tuple(centre.tolist()), inertia=_rows((inertia + inertia.T) / 2))


def moved(properties: MassProperties, x: np.ndarray) -> MassProperties:
    r = x[:3, :3]
    centre = r @ np.array(properties.centre) + x[:3, 3]
    return MassProperties(
        mass=properties.mass, centre=tuple(centre.tolist()), inertia=_rows(r @ np.array(properties.inertia) @ r.T)
    )


@dataclass
class Made:
    """A robot with one or more modes, built from the same segments."""

    segments: list[Segment]
    name: str = "arm"
    sites: tuple[tuple[str, int, np.ndarray], ...] = ()
    keyframes: tuple[tuple[str, dict[str, float]], ...] = ()
    excluded: tuple[tuple[int, int], ...] = ()
    adhesions: tuple[tuple[str, str, float], ...] = ()  # path, occurrence's path, force
    control: dict[str, float] = field(default_factory=dict)
    raw: tuple[RawAttribute, ...] = ()
    simulation: dict[str, float | str] = field(default_factory=dict)
    present: tuple[str, ...] | None = None
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)

    def assembly(self) -> Assembly:
        occurrences: list[Occurrence] = []
        links: list[Link] = []
        for index, segment in enumerate(self.segments):
            members = []
            for piece in segment.pieces:
                members.append(len(occurrences))
                occurrences.append(self.occurrence(len(occurrences), piece))
            bodies = [moved(piece.part.properties, piece.pose) for piece in segment.pieces]
            links.append(
                Link(
                    name=segment.name,
                    index=index,
                    frame=members[0] if members else 0,
                    members=tuple(members),
                    poses=tuple(as_pose(piece.pose) for piece in segment.pieces),
                    properties=total(bodies) if sum(b.mass for b in bodies) > 0 else MassProperties(mass=0.0),
                    origin=at(10 + index),
                )
            )
        paths = {o.path: o.index for o in occurrences}
        mates = tuple(
            Mate(
                parent=0,
                child=0,
                parent_mount="a",
                child_mount="b",
                X_PJ=NO_POSE,
                X_JC=NO_POSE,
                origin=at(30),
                name=s.joint,
                joints=(JointEdge(
                    name=CoordinateName(s.joint.replace("/", ".")),
                    kind=KINDS["revolute"],
                    twist=KINDS["revolute"].twists[0],
                    limit=s.limit,
                    dynamics=s.dynamics,
                    offset=0.0,
                    mimic=s.mimic,
                    actuator=s.actuator,
                    origin=at(30),
                ),),
            )
            for s in self.segments
            if s.joint is not None
        )
        definition = replace(
            builder.assembly(self.name, (), materials=(), modes=(), document="robots/arm.yaml"),
            simulation={"timestep": 0.001},
            raw=self.raw,
        )
        return Assembly(
            name=self.name,
            definition=definition,
            base=0,
            occurrences=tuple(occurrences),
            mates=mates,
            links=tuple(links),
            link_of=tuple(i for i, s in enumerate(self.segments) for _ in s.pieces),
            rest=(),
            exported=(),
            poses=tuple(NamedPose(name=n, values=q, origins={}, origin=at(60)) for n, q in self.keyframes),
            modes=(),
            adhesions=tuple(
                Adhesion(path=path, occurrence=paths[occurrence], mount="sole", pose=NO_POSE, force=force)
                for path, occurrence, force in self.adhesions
            ),
            raw=self.raw,
        )

    def occurrence(self, index: int, piece: Piece) -> Occurrence:
        return builder.occurrence(
            index,
            piece.path,
            piece.part.definition,
            piece.part.record,
            origin=at(20 + index),
            material=piece.material,
            overrides=piece.overrides,
            color=piece.color,
            properties=piece.part.properties,
        )

    def robot(self, assembly: Assembly, name: str = "bench", base: str = "fixed") -> Robot:
        mode = LinkedMode(
            name=name,
            root=LinkedMount(occurrence=0, mount="origin", pose=NO_POSE, path="plate/origin"),
            base=base,
            at=NO_POSE,
            gravity=self.gravity,
            poses=(),
            actuators=None,
            exclude=(),
            adhesion=self.control,
            simulation=self.simulation,
            origin=at(50),
        )
        bodies = []
        for index, s in enumerate(self.segments):
            joints: tuple[TreeJoint, ...] = ()
            if s.joint is not None:
                axis, anchor = tuple(map(float, s.axis)), tuple(map(float, s.anchor))
                joints = (TreeJoint(
                    name=CoordinateName(s.joint.replace("/", ".")),
                    kind=KINDS["revolute" if s.kind == "hinge" else "prismatic"],
                    twist=Twist(angular=axis, anchor=anchor) if s.kind == "hinge" else Twist(linear=axis),
                    reversed=False,
                    offset=0.0,
                    limit=s.limit,
                    dynamics=s.dynamics,
                    mimic=s.mimic,
                    actuator=s.actuator,
                    mate=0,
                    origin=at(30 + index),
                ),)
            bodies.append(Body(link=index, parent=s.parent, X_PL=as_pose(s.pose), joints=joints))
        present = tuple(s.joint for s in self.segments if s.joint is not None and s.actuator is not None)
        return Robot(
            name=self.name,
            mode=mode,
            assembly=assembly,
            base=base,
            gravity=self.gravity,
            bodies=tuple(bodies),
            sites=tuple(Site(path=p, body=b, pose=as_pose(x), origin=at(80)) for p, b, x in self.sites),
            excluded=self.excluded,
            keyframes=tuple(Keyframe(name=n, q=q, origin=at(60 + k)) for k, (n, q) in enumerate(self.keyframes)),
            present=present if self.present is None else self.present,
            adhesion=self.control,
        )

    def request(self, store: Store, *modes: tuple[str, str]) -> EmitRequest:
        """A request for modes, each `(name, base)`."""
        assembly = self.assembly()
        robots = tuple(self.robot(assembly, name, base) for name, base in modes or (("bench", "fixed"),))
        return EmitRequest(
            assembly=assembly,
            robots=robots,
            store=store,
            geometry=None,
            workspace=None,
            report=Report(),  # type: ignore[arg-type]
        )

    def placed(self, q: dict[str, float]) -> list[np.ndarray]:
        """World poses of all links by a chain of matrices: `X_PL`, then the motion about the anchor."""
        found: list[np.ndarray] = []
        for s in self.segments:
            x = (np.eye(4) if s.parent is None else found[s.parent]) @ s.pose
            if s.joint is not None:
                value, anchor = q.get(s.joint, 0.0), np.asarray(s.anchor, dtype=float)
                unit = np.asarray(s.axis) / np.linalg.norm(s.axis)
                if s.kind == "hinge":
                    x = x @ matrix(anchor) @ matrix(rotation=spin(unit, value)) @ matrix(-anchor)
                else:
                    x = x @ matrix(unit * value)
            found.append(x)
        return found

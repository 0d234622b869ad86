"""A robot assembled from contract types: a plate, two servos, two equal braces, a nested hand, a board and a marker.

    plate -- yaw (revolute) -- bracket = servo -- lift (prismatic) -- hand/palm = hand/cap, board, marker, motor"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from graph import builder
from graph.builder import binary_stl, kept, where
from thingc.base.diagnostics import Report
from thingc.base.inertia import MassProperties
from thingc.base.joints.kinds import KINDS
from thingc.base.pose import NO_POSE, Pose, make_pose
from thingc.base.source import Span
from thingc.documents.workspace import DEFAULT_MESH, DEFAULT_SIMULATION, Workspace
from thingc.geometry.record import PartDefinition, PartRecord, Value, definition_text
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import (
    Assembly,
    JointEdge,
    Link,
    LinkedMode,
    LinkedMount,
    Mate,
    Occurrence,
)
from thingc.model.resolve.coordinates import CoordinateName, Dynamics, Limit
from thingc.model.resolve.types import BomEntry, Material, NamedPose, Overrides, Process
from thingc.model.robot.kinematic_tree import root
from thingc.model.robot.types import Robot
from thingc.targets.request import EmitRequest

DOCUMENT = "/w/arm.yaml"
ORDER = ("plate", "servo_a", "brace_a", "servo_b", "brace_b", "hand/palm", "hand/cap", "board", "marker", "motor")


def span(line: int) -> Span:
    return where(line, DOCUMENT)[0]


QUADS = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
TRIANGLES = [t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))]


def box_corners(x: float, y: float, z: float) -> list[tuple[float, float, float]]:
    return [(x * (k & 1), y * (k >> 1 & 1), z * (k >> 2)) for k in range(8)]


def box_stl(x: float, y: float, z: float) -> bytes:
    """A closed box from the origin as binary STL: 12 triangles, facing outwards."""
    return binary_stl(box_corners(x, y, z), TRIANGLES)


def box_obj(x: float, y: float, z: float) -> bytes:
    """The same box as OBJ."""
    vertices = "".join(f"v {a!r} {b!r} {c!r}\n" for a, b, c in box_corners(x, y, z))
    return (vertices + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in TRIANGLES)).encode()


def part(
    reference: str, values: Mapping[str, Value] | None = None, defaults: Mapping[str, Value] | None = None,
) -> PartDefinition:
    parameters = {**(defaults or {}), **(values or {})}
    text = definition_text(reference, parameters, dict(defaults or {}))
    kind = "file" if "/" in reference else "code"
    return PartDefinition(reference=reference, kind=kind, parameters=tuple(sorted(parameters.items())), text=text, label=text)


def record(store: Store, text: str, size: tuple[float, float, float] | None, bom: dict[str, str] | None = None) -> PartRecord:
    """Record of a box of this size [mm] from the origin, or of a Thing without geometry if `size` is None."""
    said: dict[str, Any] = {"material": "petg", "bom": bom or {}, "code": ("parts/arm.py", 3)}
    if size is None:
        return builder.record(text, **said)
    x, y, z = (v / 1000 for v in size)
    meshes = {"print": kept(store, box_stl(*size), 8, 12), "visual": kept(store, box_obj(x, y, z), 8, 12)}
    shape = {"meshes": meshes, "brep": store.put(b"brep of " + text.encode())}
    return builder.box(text, (x, y, z), centre=(x / 2, y / 2, z / 2), **said, **shape)


def petg(kind: str | None = "fdm") -> Material:
    process = Process(kind=kind) if kind else None
    return builder.material("petg", 1270.0, color="#e6e6fa", process=process, origin=where(90, DOCUMENT))


def occurrence(
    index: int, path: str, definition: PartDefinition | None, made: PartRecord | None, *, mass: float = 0.0,
    source: str = "derived", material: Material | None = None, bom: BomEntry | None = None, overrides: Overrides | None = None,
) -> Occurrence:
    stated = {key: value for key, value in made.bom.items() if key != "name"} if made is not None else {}
    merged = (bom or BomEntry()).merge_over(BomEntry(**stated))
    return builder.occurrence(
        index, path, definition, made, material=material, bom=merged, overrides=overrides, origin=where(10 + index, DOCUMENT),
        color="#e6e6fa" if made is not None else None, properties=MassProperties(mass=mass), mass_source=source,
    )


def occurrences(store: Store) -> tuple[Occurrence, ...]:
    brace = part("arm:Brace", {"length": 0.12}, {"length": 0.1})
    servo, plate, palm, cap = (part(name) for name in ("stock:XM430", "arm:Plate", "arm:Palm", "arm:Cap"))
    motor = part("cad/motor.step")
    servo_record = record(store, servo.text, (28.5, 46.5, 34.0), {"make": "buy", "supplier": "Robotis", "cost": "289 EUR"})
    brace_record = record(store, brace.text, (120, 30, 4))
    plastic = petg()
    return (
        occurrence(0, "plate", plate, record(store, plate.text, (100, 100, 6)), mass=0.0762, material=plastic),
        occurrence(1, "servo_a", servo, servo_record, mass=0.082, source="vendor"),
        occurrence(2, "brace_a", brace, brace_record, mass=0.018288, material=plastic),
        occurrence(3, "servo_b", servo, servo_record, mass=0.082, source="vendor"),
        occurrence(4, "brace_b", brace, brace_record, mass=0.018288, material=plastic),
        occurrence(5, "hand/palm", palm, record(store, palm.text, (40, 40, 8)), mass=0.016256, material=plastic),
        occurrence(6, "hand/cap", cap, record(store, cap.text, (20, 20, 5)), mass=0.00254, material=plastic),
        occurrence(7, "board", None, None, mass=0.012, source="measured"),
        occurrence(8, "marker", None, None),
        occurrence(9, "motor", motor, record(store, motor.text, (30, 30, 50)), mass=0.2, source="measured", material=petg(None)),
    )


YAW = JointEdge(
    name=CoordinateName("yaw"), kind=KINDS["revolute"], twist=KINDS["revolute"].twists[0],
    limit=Limit(lower=-2.0, upper=2.0), dynamics=Dynamics(), offset=0.3,
    mimic=None, actuator=None, origin=(span(40),),
)
LIFT = replace(
    YAW, name=CoordinateName("hand.lift"), kind=KINDS["prismatic"], twist=KINDS["prismatic"].twists[0], offset=0.01,
    limit=Limit(lower=0.0, upper=0.05),
)

X_PLATE_J = make_pose((0.01, 0.02, 0.03), (0.2, -0.4, 1.1))
X_J_BRACKET = make_pose((-0.02, 0.0, 0.05), (1.4, 0.3, -0.2))
X_BRACE_J = make_pose((0.1, -0.03, 0.0), (-0.7, 0.5, 0.1))
X_J_PALM = make_pose((0.0, 0.01, 0.02), (0.1, 2.2, 0.6))
X_SERVO_BRACE = make_pose((0.0, 0.03, 0.01), (0.0, 0.0, 0.5))


def motion(kind: str, value: float) -> Pose:
    return make_pose((0, 0, 0), (0, 0, value)) if kind == "revolute" else Pose(translation=(0.0, 0.0, value))


def mates() -> tuple[Mate, ...]:
    """The mates: yaw connects plate and servo_a; servo_a = brace_a; lift connects brace_a and hand/palm; the others are rigid, on the
    palm."""
    def mate(parent: int, child: int, X_PJ: Pose, X_JC: Pose, joint: JointEdge | None = None) -> Mate:
        return Mate(
            parent=parent, child=child, parent_mount="a", child_mount="b", X_PJ=X_PJ, X_JC=X_JC, joints=() if joint is None else (joint,),
            name=None if joint is None else joint.path, origin=(span(50),),
        )

    return (
        mate(0, 1, X_PLATE_J, X_J_BRACKET, YAW),
        mate(1, 2, NO_POSE, X_SERVO_BRACE),
        mate(2, 5, X_BRACE_J, X_J_PALM, LIFT),
        *(mate(5, k, NO_POSE, make_pose((0.01 * k, 0, 0), (0, 0, 0))) for k in (3, 4, 6, 7, 8, 9)),
    )


def links() -> tuple[Link, ...]:
    def link(name: str, index: int, members: tuple[int, ...], poses: tuple[Pose, ...]) -> Link:
        return Link(
            name=name, index=index, frame=members[0], members=members, poses=poses, properties=MassProperties(mass=1.0),
            origin=(span(1),),
        )

    on_palm = tuple(mate for mate in mates() if mate.parent == 5)
    return (
        link("base", 0, (0,), (NO_POSE,)),
        link("servo_a", 1, (1, 2), (NO_POSE, X_SERVO_BRACE)),
        link("palm", 2, (5, *(mate.child for mate in on_palm)), (NO_POSE, *(mate.X_JC for mate in on_palm))),
    )


def modes() -> tuple[LinkedMode, ...]:
    """Modes rooted at each link, with each kind of base."""
    def mode(name: str, occurrence: int, path: str, base: str) -> LinkedMode:
        return LinkedMode(
            name=name, root=LinkedMount(occurrence=occurrence, mount="origin", pose=NO_POSE, path=path), base=base,
            at=make_pose((0.1, 0.2, 0.5), (0.3, 0.0, 0.1)), gravity=(0.0, 0.0, -9.81), poses=("start", "home"), actuators=None,
            exclude=(), adhesion={}, simulation={}, origin=(span(60),),
        )

    return (
        mode("bench", 0, "plate/origin", "fixed"),
        mode("drawing", 5, "hand/palm/origin", "held"),
        mode("adrift", 1, "servo_a/origin", "free"),
    )


def assembly(store: Store) -> Assembly:
    things = occurrences(store)
    definition = builder.assembly("arm", (), materials=(), modes=())
    pose = [
        NamedPose(name=name, values=values, origins={}, origin=(span(70),))
        for name, values in (("home", {"yaw": 1.0}), ("start", {"hand/lift": 0.02, "yaw": -0.5}))
    ]
    return Assembly(
        name="arm", definition=definition, base=0, occurrences=things,
        mates=mates(), links=links(), link_of=(0, 1, 1, 2, 2, 2, 2, 2, 2, 2),
        rest=tuple(make_pose((0.1 * k, 0, 0), (0, 0, 0.2 * k)) for k in range(len(things))), exported=(), poses=tuple(pose),
        modes=modes(), adhesions=(), raw=(),
    )


def robots(whole: Assembly) -> tuple[Robot, ...]:
    """Compute the robot of every mode with the compiler's own pass."""
    report = Report()
    found = [root(whole, mode, report) for mode in whole.modes]
    assert report.diagnostics == []
    return tuple(robot for robot in found if robot is not None)


WORKSPACE = Workspace(
    root="/w", parts=("/w/parts",), packages=(), build="/w/build", part_timeout=120.0, mesh=DEFAULT_MESH, simulation=DEFAULT_SIMULATION,
)


def request(whole: Assembly, store: Store, geometry: object = None) -> EmitRequest:
    """The request that an emitter receives. Only `step` needs the geometry service."""
    return EmitRequest(
        assembly=whole, robots=robots(whole), store=store, geometry=geometry, workspace=WORKSPACE,  # type: ignore[arg-type]
        report=Report(),
    )

"""The linked robot before any root is chosen: occurrences, the mate graph and links."""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.export_names import JointPath, LinkPath, SensorPath, SitePath, TendonPath
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import MassProperties, total
from thingc.base.joints.twist import Twist
from thingc.base.numeric import sum_of
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.pose import NO_POSE, Pose, Vector
from thingc.base.primitives import Primitive
from thingc.base.sensor_kinds import Measurement
from thingc.base.source import Origin
from thingc.geometry.record import DriveType, Mesh, PartRecord
from thingc.model.assembly.hag import Definition, Hag, hag_of
from thingc.model.resolve.coordinates import Coordinate, Dynamics, Limit
from thingc.model.resolve.types import (
    AssemblyDefinition,
    BomEntry,
    Component,
    Material,
    ModeSettings,
    NamedPose,
    Overrides,
    RawAttribute,
    RawElement,
    Reference,
    Test,
    Wrap,
)


class MountFrame(OneLineRepr, FrozenStruct):
    """A mount on an occurrence: its frame in the occurrence's frame."""

    pose: Pose
    interface: str | None = None


class Surface(OneLineRepr, FrozenStruct):
    """A shape of an occurrence that is drawn or touched: `solid` at `pose` in the occurrence's frame, of what it is made and in which
    colour (`#rrggbb`, `#rrggbbaa`; None: of its own). Of a mesh that a link lists `name` is what its file may be called, `volume` [m^3]
    what it holds, `own` the bytes that it was read from (SHA-256 and size) where MuJoCo reads them with the factors `scale`. `title` is the
    name of a listed shape in files, without the path of nested documents."""

    solid: Mesh | Primitive
    material: Material | None
    color: str | None
    pose: Pose = NO_POSE
    name: str = ""
    volume: float = 0.0
    own: tuple[str, int] | None = None
    scale: Vector | None = None
    title: str | None = None


class Listed(OneLineRepr, FrozenStruct):
    """The geometry of a link, whose shapes are listed, in its frame: what is drawn, what touches, of which `solids` it is taken to be made,
    and the `box` around all of it (two corners [m]; None: there is nothing, or nobody has measured it yet)."""

    drawn: tuple[Surface, ...]
    touching: tuple[Surface, ...]
    solids: tuple[Surface, ...]
    box: tuple[Vector, Vector] | None


class PartInstance(OneLineRepr, FrozenStruct):
    """A component that is a part, a link or a frame. `record` is that of a part, `listed` is of a link; a frame has neither.

    `properties` and `mounts` (with `origin`) are in its own frame; `mass_source` is `measured | vendor | stated | derived | estimated`,
    `estimate` how one with an infill was estimated (`layers | skin`), else None. `sound` is False where its mass is wrong and that has been
    reported. `color` is `#rrggbb`.
    """

    component: Component
    definition: Definition
    record: PartRecord | None
    material: Material | None
    color: str | None
    bom: BomEntry
    properties: MassProperties
    mass_source: str
    mounts: dict[str, MountFrame]
    estimate: str | None = None
    listed: Listed | None = None
    sound: bool = True


class Occurrence(PartInstance):
    """A part, a link or a frame at a path of the unrolled HAG (`hand/cap`). `index` is its place in document order."""

    path: str
    index: int
    overrides: Overrides
    origin: Origin

    def name_in_files(self, surface: Surface) -> str | None:
        """The name that the document gives to one of its shapes, behind the path of the document; None if it gives none."""
        return None if surface.title is None else self.path[: self.path.rfind("/") + 1] + surface.title

    @property
    def drawn(self) -> tuple[Surface, ...]:
        """What simulators and viewers draw, in its own frame; nothing where the document wants none, and without geometry."""
        if self.listed is not None:
            return self.listed.drawn
        mesh = self.record.meshes.get("visual") if self.record is not None and self.overrides.visual else None
        return () if mesh is None else (self._surface(mesh),)

    @property
    def touching(self) -> tuple[Surface, ...]:
        """The shapes that simulators collide, in its own frame, of a part as its `collision` chooses: of a mesh the convex hull. Empty for
        `none`, without geometry, and where there is no such shape of the part."""
        if self.listed is not None:
            return self.listed.touching
        record, choice = self.record, self.overrides.collision
        if record is None or not record.meshes:
            return ()
        if choice == "part":
            return tuple(self._surface(piece) for piece in record.pieces)
        if choice == "decompose":
            return tuple(self._surface(piece) for piece in record.convex)
        shape = record.simulated if choice == "mesh" else record.fits.get(choice) or record.meshes.get(choice)
        return () if shape is None else (self._surface(shape),)

    @property
    def collides(self) -> bool:
        """Whether it may touch anything, as far as that is known without its meshes."""
        return bool(self.listed.touching) if self.listed is not None else self.overrides.collision != "none"

    @property
    def solids(self) -> tuple[Surface, ...]:
        """What it is made of, in its own frame, however it is drawn or touched: of a part its mesh, of a link the shapes that touch, else
        those that are drawn."""
        if self.listed is not None:
            return self.listed.solids
        mesh = self.record.meshes.get("mesh") if self.record is not None else None
        return () if mesh is None else (self._surface(mesh),)

    def _surface(self, solid: Mesh | Primitive) -> Surface:
        """A shape of a part, which is of one material."""
        return Surface(solid=solid, material=self.material, color=self.color)

    @property
    def box(self) -> tuple[Vector, Vector] | None:
        """The box around its geometry, in its own frame: two corners [m]; None without any, and where it is not known exactly."""
        return self.listed.box if self.listed is not None else self.record.box if self.record is not None else None


class ActuatorModel(OneLineRepr, FrozenStruct):
    """A joint's drive with defaults from the Thing's actuator filled in; SI. `effort` the force limit; `axis` of a drive of a ball is
    the one about which it turns it, a unit vector that is fixed in the child, in the parent mount's axes at q = 0. `name` is what files
    call it where that is not what they call the joint."""

    kind: DriveType
    kp: float | None
    kv: float | None
    effort: float | None
    velocity: float | None
    origin: Origin
    axis: Vector | None = None
    name: str | None = None


class JointEdge(Coordinate):
    """A coordinate of a mate, by its `name` in the top document (`hand.wrist[0]`), all defaults worked out.

    `twist` is what it does, seen in the frame that the coordinates before it in the mate have moved. `mimic.joint`
    is of the top document, too. `limit.effort` and `.velocity` and `dynamics.armature` carry the drive's defaults.
    """

    twist: Twist
    actuator: ActuatorModel | None


class Mate(OneLineRepr, FrozenStruct):
    """An edge of the mate graph between occurrences `parent` and `child` (indices).

    `X_PC(q) = X_PJ @ exp(twist_0 (q_0 + offset_0)) @ exp(twist_1 (q_1 + offset_1)) ... @ X_JC` over its `joints`; rigid without any.
    `name` is the path of the joint, as its document calls it (None: rigid).
    `parent_mount` and `child_mount` are the names of the mounts mated (`origin` for `at`). `loop` is the path of a joint that
    closes a loop: it places nothing, and is no edge of the tree that the documents' placements make.
    """

    parent: int
    child: int
    parent_mount: str
    child_mount: str
    X_PJ: Pose
    X_JC: Pose
    joints: tuple[JointEdge, ...]
    origin: Origin
    name: JointPath | None = None
    loop: JointPath | None = None


class Link(OneLineRepr, FrozenStruct):
    """Occurrences joined rigidly: one body in every simulator.

    `frame` is the index of the occurrence whose frame is the link's; `poses[k]` is the pose of `members[k]` in it;
    `properties` are summed, in the link's frame.
    """

    name: LinkPath
    index: int
    frame: int
    members: tuple[int, ...]
    poses: tuple[Pose, ...]
    properties: MassProperties
    origin: Origin


class MountAt(OneLineRepr, FrozenStruct):
    """A mount of an occurrence."""

    occurrence: int
    mount: str


class LinkedMount(MountAt):
    """A mount that a document names, by the path of its site: `hand/tip`, or `hand/origin` for a component."""

    path: SitePath

    @property
    def of_component(self) -> bool:
        """Whether a component is named, whose origin is laid on a pose, and not a mount, which is mated to it.

        A mount of an assembly may be the origin of one of its components, so `mount` does not tell.
        """
        return self.path.rpartition("/")[2] == "origin"


class ExportedMount(LinkedMount):
    """A mount that an assembly exports, by its path there (`tip`, `hand/tip`)."""

    origin: Origin


class Adhesion(LinkedMount):
    """A magnet: a mount that pulls. `force` [N] is its largest in any mode."""

    force: float


class LinkedHold(OneLineRepr, FrozenStruct):
    """A hold of a mode: `mount` is mated to the world frame moved to `pose` (None: where the mode's own pose puts it), or with
    `turns` only its origin is laid there."""

    mount: LinkedMount
    pose: Pose | None
    origin: Origin
    turns: bool = False


class Foot(OneLineRepr, FrozenStruct):
    """A mount that a floating mode stands on, with the sliding friction between it and the floor."""

    mount: LinkedMount
    friction: float
    origin: Origin


class LinkedSensor(Measurement):
    """A sensor at its path (`leg/imu`), with its references worked out: `joint` and `tendon` are paths, `touching` the indices of links.
    `parts` says which readings files have a name of its own for."""

    path: SensorPath
    at: LinkedMount | None = None
    seen_from: LinkedMount | None = None
    joint: JointPath | None = None
    tendon: TendonPath | None = None
    touching: tuple[int, ...] = ()
    parts: dict[str, str] = {}

    @property
    def mounts(self) -> tuple[LinkedMount, ...]:
        """Those that it speaks of."""
        return tuple(one for one in (self.at, self.seen_from) if one is not None)

    @property
    def site(self) -> str | None:
        """The path of the mount that it sits on."""
        return None if self.at is None else self.at.path

    def part(self, reading: str) -> str:
        """What the sensor of one reading is called (`gyro`) where a format has one for each."""
        return self.parts.get(reading, f"{self.path}:{reading}")


class TendonStep(Wrap):
    """A step of a path, with its mounts worked out."""

    mount: LinkedMount | None
    side: LinkedMount | None


class LinkedTendon(OneLineRepr, FrozenStruct):
    """A tendon at its path (`hand/grip`): `moves` by joint path how much longer it gets per unit of q, `turns` whether its length is an
    angle [rad], else it is [m]. One on a path has `steps`, and a `width` [m] if one is stated; its spring rests where it is stated, else
    where its length is that at q = 0."""

    path: TendonPath
    moves: dict[JointPath, float]
    turns: bool
    limit: Limit
    dynamics: Dynamics
    actuator: ActuatorModel | None
    origin: Origin
    steps: tuple[TendonStep, ...] = ()
    width: float | None = None

    @property
    def mounts(self) -> tuple[LinkedMount, ...]:
        """Those that it speaks of."""
        return tuple(one for step in self.steps for one in (step.mount, step.side) if one is not None)

    def length(self, q: Mapping[str, float]) -> float:
        """How long one over joints is at `q` (every joint by path, rad or m)."""
        return sum_of(factor * q[path] for path, factor in self.moves.items())


class LinkedMode(ModeSettings):
    """A mode of the top document with its references worked out; `exclude` are pairs of link indices, `adhesion` by path.

    `pose` is the mode's own, the first of `poses`; `cut` the joints (by path) it wants loops cut at. Of a mode that is `on_floor` the
    height of `at` is 0 until the pass `stand` has found it, which then adds where `at` is in its poses to
    `at_in`, which has those that the document states.
    """

    root: LinkedMount
    exclude: tuple[tuple[int, int], ...]
    adhesion: dict[SitePath, float]
    holds: tuple[LinkedHold, ...] = ()
    feet: tuple[Foot, ...] = ()


class FileNames(OneLineRepr, FrozenStruct):
    """What files call things that have another path: components (which is what links are called after), exported mounts, whole joints,
    tendons, drives by the coordinate or tendon that they drive, equalities by the joint that mimics or closes a loop, sensors (or a part of
    one, `imu:gyro`) and poses."""

    components: dict[str, str] = {}
    mounts: dict[str, str] = {}
    joints: dict[str, str] = {}
    tendons: dict[str, str] = {}
    actuators: dict[str, str] = {}
    equalities: dict[str, str] = {}
    sensors: dict[str, str] = {}
    poses: dict[str, str] = {}


class LinkedTest(OneLineRepr, FrozenStruct):
    """A test of the top document with its references worked out: mounts, and components to all occurrences that they hold."""

    test: Test
    mounts: dict[Reference, MountAt]
    components: dict[Reference, tuple[int, ...]]


class Connected(OneLineRepr, FrozenStruct):
    """What hangs together with what, before anything has a place.

    `link_of[i]` is the link of occurrence i. `between` are the links (by index) that only join two joints of another one: they weigh
    nothing, and show nothing.
    """

    occurrences: tuple[Occurrence, ...]
    mates: tuple[Mate, ...]
    links: tuple[Link, ...]
    link_of: tuple[int, ...]
    exported: tuple[ExportedMount, ...]
    modes: tuple[LinkedMode, ...]
    adhesions: tuple[Adhesion, ...]
    tendons: tuple[LinkedTendon, ...] = ()
    sensors: tuple[LinkedSensor, ...] = ()
    between: frozenset[int] = frozenset()


class Assembly(Connected):
    """The output of `link`: everything about the robot that does not depend on a root.

    `base` is the occurrence whose frame is the assembly's; `rest[i]` the pose of occurrence i in it at q = 0.
    `mates` without those that close loops has one edge fewer than there are occurrences.
    `names` is None where files call everything by its path. `raw` has nested documents' joint and body names already prefixed with their
    path.
    """

    name: str
    definition: AssemblyDefinition
    base: int
    rest: tuple[Pose, ...]
    poses: tuple[NamedPose, ...]
    raw: tuple[RawAttribute, ...]
    added: tuple[RawElement, ...] = ()
    tests: tuple[LinkedTest, ...] = ()
    names: FileNames | None = None
    free_joint: JointPath = "root"

    @property
    def hag(self) -> Hag:
        """The hierarchical assembly graph, worked out when it is asked for."""
        return hag_of(self.definition)

    @property
    def drives(self) -> dict[str, str]:
        """What files call drives, by the paths of the coordinates and tendons that they drive."""
        driven: list[JointEdge | LinkedTendon] = [*(joint for mate in self.mates for joint in mate.joints), *self.tendons]
        return {one.path: one.actuator.name or one.path for one in driven if one.actuator is not None}

    @property
    def properties(self) -> MassProperties:
        """The whole robot at q = 0, in the base component's frame."""
        return total(o.properties.seen_from(self.rest[o.index]) for o in self.occurrences)

"""Data types of the linked robot before a root is chosen: occurrences, the mate graph, links, sensors, tendons and modes."""

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
    """A named mount of a part, a link or a frame, with its pose in the frame of the occurrence."""

    pose: Pose
    interface: str | None = None


class Surface(OneLineRepr, FrozenStruct):
    """A shape of an occurrence for display or collision: `solid` at `pose` in the occurrence's frame, with a material and a colour.

    `color` is `#rrggbb` or `#rrggbbaa`, or None for the colour of the mesh. For a mesh that a link lists, `name` is the file name without
    extension and `volume` [m^3] the volume. `scale` contains the scale factors if MuJoCo reads the original file. `title` is the name of a
    listed shape in files, without the path of nested documents.
    """

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
    """The geometry of a link whose shapes are listed in the document, in the frame of the link.

    `Listed` contains the shapes for display, for collision, and for the mass (`solids`). `box` is the bounding box (two corners [m]), or
    None if there are no shapes or if a mesh file has not been read.
    """

    drawn: tuple[Surface, ...]
    touching: tuple[Surface, ...]
    solids: tuple[Surface, ...]
    box: tuple[Vector, Vector] | None


class PartInstance(OneLineRepr, FrozenStruct):
    """A component that is a part, a link or a frame. `record` is set for a part, and `listed` for a link.

    `properties` and `mounts` (with `origin`) are in its own frame. `mass_source` is `measured | vendor | stated | derived | estimated`.
    `estimate` is the method for infill (`layers | skin`), otherwise None. `sound` is False if the mass of the component is invalid (an
    error is then reported). `color` is `#rrggbb`.
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
    """One use of a part, a link or a frame in the robot, at a path such as `hand/cap`.

    `index` is the position of the occurrence in document order.
    """

    path: str
    index: int
    overrides: Overrides
    origin: Origin

    def name_in_files(self, surface: Surface) -> str | None:
        """Return the name that a shape has in output files, with the path of its document.

        Return None if the document does not specify a name.
        """
        return None if surface.title is None else self.path[: self.path.rfind("/") + 1] + surface.title

    @property
    def drawn(self) -> tuple[Surface, ...]:
        """The shapes for display, in the occurrence's frame.

        The tuple is empty if there is no geometry or the document disables display.
        """
        if self.listed is not None:
            return self.listed.drawn
        mesh = self.record.meshes.get("visual") if self.record is not None and self.overrides.visual else None
        return () if mesh is None else (self._surface(mesh),)

    @property
    def touching(self) -> tuple[Surface, ...]:
        """The collision shapes, in the occurrence's frame. For a part, the setting `collision` of the component selects the shape.

        For a mesh file that a link lists, the collision shape is the convex hull of the mesh.

        The result is empty for `none`, if there is no geometry, and if the part has no such shape.
        """
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
        """Whether the occurrence may collide, according to the information that is available without meshes."""
        return bool(self.listed.touching) if self.listed is not None else self.overrides.collision != "none"

    @property
    def solids(self) -> tuple[Surface, ...]:
        """The shapes that determine the volume of the occurrence, in its own frame.

        For a part, the result contains the mesh of the part. For a link, the result contains the collision shapes, or the display shapes if
        there are no collision shapes.
        """
        if self.listed is not None:
            return self.listed.solids
        mesh = self.record.meshes.get("mesh") if self.record is not None else None
        return () if mesh is None else (self._surface(mesh),)

    def _surface(self, solid: Mesh | Primitive) -> Surface:
        """Return a solid of the part as a shape with the material of the part."""
        return Surface(solid=solid, material=self.material, color=self.color)

    @property
    def box(self) -> tuple[Vector, Vector] | None:
        """The bounding box of the occurrence in its own frame (two corners [m]).

        None if there is no geometry or the box is not known exactly.
        """
        return self.listed.box if self.listed is not None else self.record.box if self.record is not None else None


class ActuatorModel(OneLineRepr, FrozenStruct):
    """A drive of a joint or tendon in SI units, including defaults from the Thing's actuator.

    `effort` is the limit of its force or torque.

    For a drive of a ball joint, `axis` is a unit vector that is fixed in the child, in the parent mount's axes at q = 0. `name` is the name
    in files if it differs from the joint's name.
    """

    kind: DriveType
    kp: float | None
    kv: float | None
    effort: float | None
    velocity: float | None
    origin: Origin
    axis: Vector | None = None
    name: str | None = None


class JointEdge(Coordinate):
    """A coordinate of the joint in a mate, including all default values.

    `name` is the name of the coordinate in the top document (`hand.wrist[0]`).

    `twist` is the motion of the joint, in the frame that the preceding coordinates of the mate have moved. `mimic.joint` is also a name in
    the top document. `limit.effort`, `limit.velocity` and `dynamics.armature` include the drive's defaults.
    """

    twist: Twist
    actuator: ActuatorModel | None


class Mate(OneLineRepr, FrozenStruct):
    """An edge of the mate graph between occurrences `parent` and `child` (indices).

    Over the coordinates in `joints`, `X_PC(q) = X_PJ @ exp(twist_0 (q_0 + offset_0)) @ exp(twist_1 (q_1 + offset_1)) ... @ X_JC`. A mate
    without joints is rigid. `name` is the path of the joint (None if rigid). `parent_mount` and `child_mount` are the names of the mated
    mounts (`origin` for `at`). `loop` is the path of a joint that closes a loop. A mate with a `loop` does not place its child and is not
    an edge of the tree of placements.
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
    """A set of rigidly connected occurrences, which are one body in every simulator.

    `frame` is the index of the occurrence whose frame is the link's frame. `poses[k]` is the pose of `members[k]` in the link's frame.
    `properties` are the combined mass properties in the link's frame.
    """

    name: LinkPath
    index: int
    frame: int
    members: tuple[int, ...]
    poses: tuple[Pose, ...]
    properties: MassProperties
    origin: Origin


class MountAt(OneLineRepr, FrozenStruct):
    """A mount in the linked assembly, identified by its occurrence and its name."""

    occurrence: int
    mount: str


class LinkedMount(MountAt):
    """A mount or component to which a document refers, with the path of its site in the robot.

    The path is for example `hand/tip`, or `hand/origin` for a component.
    """

    path: SitePath

    @property
    def of_component(self) -> bool:
        """Whether the reference is to a component, not to a mount. At a pose, a component has its origin, but a mount is mated to the pose.

        This property cannot be derived from `mount`, because a mount of an assembly may be the origin of one of its components.
        """
        return self.path.rpartition("/")[2] == "origin"


class ExportedMount(LinkedMount):
    """A mount that an assembly exports, with its path in the robot.

    The path is `tip` in the top document, or `hand/tip` in the nested assembly `hand`.
    """

    origin: Origin


class Adhesion(LinkedMount):
    """A magnet at a mount. `force` [N] is the largest force that any mode specifies for the magnet."""

    force: float


class LinkedHold(OneLineRepr, FrozenStruct):
    """A mount that a mode holds to the world. The mount is mated to the frame `pose` in the world.

    If `pose` is None, the hold is at the place of the mount in the mode's own pose.

    If the hold `turns`, only the origin of the mount is fixed.
    """

    mount: LinkedMount
    pose: Pose | None
    origin: Origin
    turns: bool = False


class Foot(OneLineRepr, FrozenStruct):
    """A mount on which a mode with a free base stands, with the coefficient of sliding friction between the mount and the floor."""

    mount: LinkedMount
    friction: float
    origin: Origin


class LinkedSensor(Measurement):
    """A sensor with its path in the robot (`leg/imu`) and with resolved references.

    `joint` and `tendon` are paths, and `touching` contains indices of links.

    `parts` contains the readings that have their own names in files.
    """

    path: SensorPath
    at: LinkedMount | None = None
    seen_from: LinkedMount | None = None
    joint: JointPath | None = None
    tendon: TendonPath | None = None
    touching: tuple[int, ...] = ()
    parts: dict[str, str] = {}

    @property
    def mounts(self) -> tuple[LinkedMount, ...]:
        """The mounts to which the sensor refers."""
        return tuple(one for one in (self.at, self.seen_from) if one is not None)

    @property
    def site(self) -> str | None:
        """The path of the site at which the sensor is mounted."""
        return None if self.at is None else self.at.path

    def part(self, reading: str) -> str:
        """Return the name of one reading of the sensor (`gyro`) for formats with separate sensors."""
        return self.parts.get(reading, f"{self.path}:{reading}")


class TendonStep(Wrap):
    """A step of the path of a tendon: a mount that the tendon passes, a shape that it wraps, or a pulley.

    The references to mounts are resolved.
    """

    mount: LinkedMount | None
    side: LinkedMount | None


class LinkedTendon(OneLineRepr, FrozenStruct):
    """A tendon with its path in the robot (`hand/grip`) and with resolved references to joints and mounts.

    `moves` maps joint paths to the change of its length per unit of q. The length is in [rad] if the tendon `turns`, otherwise in [m]. A
    spatial tendon has `steps`, and a `width` [m] if the document specifies it. The default rest length of its spring is its length at q =
    0.
    """

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
        """The mounts through which the path of the tendon passes, and the mounts of the shapes that it wraps."""
        return tuple(one for step in self.steps for one in (step.mount, step.side) if one is not None)

    def length(self, q: Mapping[str, float]) -> float:
        """Compute the length [rad or m] of a tendon over joints. `q` maps the paths of all joints to their positions [rad or m]."""
        return sum_of(factor * q[path] for path, factor in self.moves.items())


class LinkedMode(ModeSettings):
    """A mode of the top document with resolved references. `exclude` are pairs of link indices, `adhesion` is by path.

    `pose` is the mode's own pose, the first of `poses`. `cut` are the joints (by path) at which loops should be cut. For a mode that is
    `on_floor`, the height of `at` is 0 until the pass `stand` computes it. The pass `stand` also adds the placements in other poses to
    `at_in`, which otherwise contains the placements that the document specifies.
    """

    root: LinkedMount
    exclude: tuple[tuple[int, int], ...]
    adhesion: dict[SitePath, float]
    holds: tuple[LinkedHold, ...] = ()
    feet: tuple[Foot, ...] = ()


class FileNames(OneLineRepr, FrozenStruct):
    """The names of elements in output files that differ from the path of the element.

    Names of components also apply to links. Drives are keyed by their joint coordinate or tendon, and equalities by the joint that mimics
    or closes a loop. A key of a sensor may include a reading (`imu:gyro`).
    """

    components: dict[str, str] = {}
    mounts: dict[str, str] = {}
    joints: dict[str, str] = {}
    tendons: dict[str, str] = {}
    actuators: dict[str, str] = {}
    equalities: dict[str, str] = {}
    sensors: dict[str, str] = {}
    poses: dict[str, str] = {}


class LinkedTest(OneLineRepr, FrozenStruct):
    """A test of the top document with resolved references.

    References to mounts become mounts, and references to components become their occurrences.
    """

    test: Test
    mounts: dict[Reference, MountAt]
    components: dict[Reference, tuple[int, ...]]


class Connected(OneLineRepr, FrozenStruct):
    """The linked robot before the poses of its occurrences at q = 0 are computed.

    `link_of[i]` is the index of the link to which the occurrence with index i belongs. `between` contains the indices of massless
    intermediate links, which have exactly two joints and neither mass nor shapes.
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
    """The output of the pass `link`: all properties of the robot that do not depend on a root.

    `base` is the occurrence that defines the assembly's frame. `rest[i]` is the pose of occurrence i in this frame at q = 0. The number of
    mates, except for mates that close loops, is one less than the number of occurrences. `names` is None if all names in files are paths.
    In `raw`, the names of joints and bodies of nested documents have the path of their document as a prefix.
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
        """The hierarchical assembly graph of the robot. The graph is computed at each access."""
        return hag_of(self.definition)

    @property
    def drives(self) -> dict[str, str]:
        """The names of drives in output files, keyed by the path of the joint coordinate or tendon that the drive moves."""
        driven: list[JointEdge | LinkedTendon] = [*(joint for mate in self.mates for joint in mate.joints), *self.tendons]
        return {one.path: one.actuator.name or one.path for one in driven if one.actuator is not None}

    @property
    def properties(self) -> MassProperties:
        """The mass properties of the whole robot at q = 0, in the base component's frame."""
        return total(o.properties.seen_from(self.rest[o.index]) for o in self.occurrences)

"""Data types of the linked robot before a root is chosen: placed components, the mate graph, links, sensors, tendons and modes."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from msgspec.structs import asdict, replace

from thingc.base.diagnostics import Note
from thingc.base.export_names import JointPath, LinkPath, SensorPath, SitePath, TendonPath
from thingc.base.inertia import MassProperties, total
from thingc.base.joints.twist import Twist
from thingc.base.numeric import sum_of
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import NO_POSE, Pose, Vector
from thingc.base.primitives import Primitive
from thingc.base.sensor_kinds import Measurement
from thingc.base.source import Origin
from thingc.geometry.record import DriveType, Mesh, MountRecord, PartRecord
from thingc.model.assembly.hag import Definition, Hag, hag_of
from thingc.model.assembly.report import written_at
from thingc.model.resolve import types as resolved
from thingc.model.resolve.coordinates import Coordinate, DriveValues


class Surface(OneLineStruct):
    """A shape of a component for display or collision.

    `solid` is placed at `pose` in the frame of the component, with a material and a colour. `color` is `#rrggbb` or `#rrggbbaa`, or None
    for the colour of the mesh. For a mesh file that a link lists, `name` is the file name without extension, and `volume` is the volume
    [m^3]. `scale` contains the scale factors if MuJoCo reads the original mesh file. `title` is the name that a document specifies for the
    shape in output files, without the path of nested documents. `own` identifies the original mesh file. `origin` is the location of a
    shape that a document lists.
    """

    solid: Mesh | Primitive
    material: resolved.Material | None
    color: str | None
    pose: Pose = NO_POSE
    name: str = ""
    volume: float = 0.0
    own: tuple[str, int] | None = None
    scale: Vector | None = None
    title: str | None = None
    origin: Origin = ()


class Listed(OneLineStruct):
    """The geometry of a link whose shapes are listed in the document, in the frame of the link.

    `drawn` contains the shapes for display, `touching` the shapes for collision, and `solids` the shapes that determine the mass. `box` is
    the bounding box (two corners [m]). `box` is None if there are no shapes, or if a mesh file has not been read.
    """

    drawn: tuple[Surface, ...]
    touching: tuple[Surface, ...]
    solids: tuple[Surface, ...]
    box: tuple[Vector, Vector] | None


class PartInstance(OneLineStruct):
    """A component that is a part, a link or a frame. `record` is set for a part, and `listed` for a link.

    The mass `properties` and the `mounts` (including `origin`) are in the frame of the component. `mass_source` is `measured | vendor |
    stated | derived | estimated`. `estimate` is the method of estimation for a part with infill (`layers | skin`), otherwise None. `sound`
    is False if the mass of the component is invalid, which is reported as an error. `color` is `#rrggbb`. `contacts` contains the collision
    shapes that the document lists below `collision`, by their path there.
    """

    component: resolved.Component
    definition: Definition
    record: PartRecord | None
    material: resolved.Material | None
    color: str | None
    bom: resolved.BomEntry
    properties: MassProperties
    mass_source: str
    mounts: dict[str, MountRecord]
    estimate: str | None = None
    listed: Listed | None = None
    contacts: dict[resolved.ChoicePath, tuple[Surface, ...]] = {}
    sound: bool = True

    @property
    def exact(self) -> bool:
        """Whether the properties of the component are known exactly (see `PartRecord.exact`)."""
        return self.record is None or self.record.exact

    @property
    def written(self) -> tuple[Note, ...]:
        """A note with the location of the part class, if it is known."""
        return written_at(f"`{self.definition.label}`", self.record.code) if self.record is not None else ()


class Unit(OneLineStruct):
    """A nested assembly at a path such as `hand` that the bill of materials lists as one part."""

    path: str
    definition: Definition
    bom: resolved.BomEntry


class Occurrence(PartInstance):
    """One use of a part, a link or a frame in the robot, at a path such as `hand/cap`.

    `index` is the position in the list of all occurrences in document order. `unit` is the nested assembly that the bill of materials lists
    in place of the occurrence, if any. `detail` contains the levels of detail to which the occurrence belongs, and `omitted_in` the modes
    in which the current format omits the shapes.
    """

    path: str
    index: int
    overrides: resolved.Overrides
    origin: Origin
    unit: Unit | None = None
    detail: frozenset[str] = frozenset()
    omitted_in: frozenset[str] = frozenset()

    @property
    def name(self) -> str:
        """The path as documents write it, such as `hand.cap`."""
        return self.path.replace("/", ".")

    def name_in_files(self, surface: Surface) -> str | None:
        """Return the name that a document specifies for a shape in output files, including the path of the document.

        Return None if the document does not specify a name for the shape.
        """
        return None if surface.title is None else self.path[: self.path.rfind("/") + 1] + surface.title

    @property
    def drawn(self) -> tuple[Surface, ...]:
        """The shapes for display, in the occurrence's frame.

        The tuple is empty if there is no geometry, or if the document disables the display of the component.
        """
        if self.listed is not None:
            return self.listed.drawn if self.overrides.visual else ()
        mesh = self.record.meshes.get("visual") if self.record is not None and self.overrides.visual else None
        return () if mesh is None else (self._surface(mesh),)

    @property
    def touching(self) -> tuple[Surface, ...]:
        """The collision shapes, in the occurrence's frame.

        The setting `collision` of the component selects the shapes of a part, or replaces those of a link. For a mesh file that a document
        lists, the shapes are the convex hull of the mesh, or its convex pieces. The tuple is empty if `collision` is `none`, if there is no
        geometry, or if the part does not have the selected shape.
        """
        record, choice = self.record, self.overrides.collision
        if choice == "shapes":
            return self.contacts.get((), ())
        if self.listed is not None and choice != "none":
            return self.listed.touching
        if record is None or not record.meshes or choice == "none":
            return ()
        if choice == "part":
            return tuple(self._surface(piece) for piece in record.pieces)
        if choice == "decompose":
            return tuple(self._surface(piece) for piece in record.convex.get(self.overrides.pieces, ()))
        shape = record.simulated if choice == "mesh" else record.fits.get(choice) or record.meshes.get(choice)
        return () if shape is None else (self._surface(shape),)

    @property
    def collides(self) -> bool:
        """Whether the occurrence may collide. Only information that is available without meshes is used."""
        return bool(self.touching) if self.listed is not None else self.overrides.collision != "none"

    def in_target(self, target: str, omitted: Mapping[resolved.ChoicePath, Collection[str]]) -> Occurrence:
        """Return the occurrence with the shapes that the document selects for the format `target`.

        `omitted` contains the levels of detail that formats and modes omit. It is only used for formats that it contains.
        """
        paths = [path for path, levels in omitted.items() if (target,) in omitted and not self.detail.isdisjoint(levels)]
        if (target,) in paths:
            return self._without_shapes()
        chosen = self.choose(("targets", target))
        modes = frozenset(path[1] for path in paths if path[0] == "modes")
        return replace(chosen, omitted_in=modes) if modes else chosen

    def in_mode(self, mode: str) -> Occurrence:
        """Return the occurrence with the collision shapes that the document selects for a mode, or without shapes if it omits them."""
        return self._without_shapes() if mode in self.omitted_in else self.choose(("modes", mode))

    def _without_shapes(self) -> Occurrence:
        return replace(self, overrides=replace(self.overrides, variants={}, visual=False, collision="none"))

    def choose(self, path: resolved.ChoicePath) -> Occurrence:
        """Return the occurrence with the collision shapes that the document selects at a path below `collision`, if there are any.

        The shapes of a mode take precedence over the shapes of a format.
        """
        choice = self.overrides.variants.get(path)
        if choice is None:
            return self
        others = {other: one for other, one in self.overrides.variants.items() if other[:1] == ("modes",) and path[:1] == ("targets",)}
        contacts = {**self.contacts, (): self.contacts.get(path, ())}
        return replace(self, overrides=replace(self.overrides, variants=others, **asdict(choice)), contacts=contacts)

    def in_nested_mode(self, mode: str | None) -> Occurrence:
        """Return the occurrence with the collision shapes of the mode in which its document is nested, in all modes of the robot."""
        chosen = self if mode is None else self.choose(("modes", mode))
        others = {path: choice for path, choice in chosen.overrides.variants.items() if path[:1] == ("targets",)}
        return replace(chosen, overrides=replace(chosen.overrides, variants=others)) if others != chosen.overrides.variants else chosen

    @property
    def has_contacts(self) -> bool:
        """Whether the occurrence is a part or a link that may collide."""
        return self.collides and (self.record is not None or self.listed is not None)

    @property
    def solids(self) -> tuple[Surface, ...]:
        """The shapes that determine the volume of the occurrence, in its own frame.

        For a part, the result is the mesh of the part. For a link, the result is the collision shapes, or the display shapes if there are
        no collision shapes.
        """
        if self.listed is not None:
            return self.listed.solids
        mesh = self.record.meshes.get("mesh") if self.record is not None else None
        return () if mesh is None else (self._surface(mesh),)

    def _surface(self, solid: Mesh | Primitive) -> Surface:
        """Convert a solid of the part to a `Surface` with the material of the part."""
        return Surface(solid=solid, material=self.material, color=self.color)

    @property
    def box(self) -> tuple[Vector, Vector] | None:
        """The bounding box of the occurrence in its own frame (two corners [m]).

        The box is None if there is no geometry, or if the size is not known exactly.
        """
        return self.listed.box if self.listed is not None else self.record.box if self.record is not None else None


class ActuatorModel(DriveValues):
    """A drive of a joint or tendon. Missing values come from the actuator of the Thing.

    `name` is the name of the drive in output files if it differs from the name of the joint. `transmission` is the path of the transmission
    between the actuator and the joint, `ratio` is its ratio, and `backlash` [rad or m] its play at the joint. All other values are at the
    joint. The torque-speed line `stall` contains the effort at rest and the speed at which the effort is 0.
    """

    kind: DriveType
    name: str | None = None
    transmission: str | None = None
    ratio: float | None = None
    backlash: float | None = None
    stall: tuple[float, float] | None = None


class JointEdge(Coordinate):
    """One coordinate of the joint of a mate, including all default values.

    `name` is the name of the coordinate in the top document (`hand.wrist[0]`).

    `twist` is the motion of the coordinate, in the frame of the joint after the motions of the preceding coordinates. `mimic.joint` is also
    a name in the top document. `limit.effort`, `limit.velocity` and `dynamics.armature` include the default values from the drive.
    """

    twist: Twist
    actuator: ActuatorModel | None

    @property
    def turns(self) -> bool:
        """Whether the coordinate is an angle [rad]. Otherwise, it is a length [m]."""
        return self.twist.turns


class Mate(OneLineStruct):
    """An edge of the mate graph between two placed components, whose indices are `parent` and `child`.

    With the coordinates in `joints`, the pose of the child in the frame of the parent is `X_PC(q) = X_PJ @ exp(twist_0 (q_0 + offset_0)) @
    exp(twist_1 (q_1 + offset_1)) ... @ X_JC`. A mate without joints is rigid. `name` is the path of the joint, or None for a rigid mate.
    `parent_mount` and `child_mount` are the names of the mated mounts (`origin` for `at`). `loop` is the path of a joint that closes a
    loop. A mate with a `loop` does not place its child component. The sides of a rigid mate with `keep` are separate links, which the fixed
    joint `name` connects. `base` is True for the joint of the base of a nested assembly in a mode.
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
    keep: bool = False
    base: bool = False

    @property
    def separates(self) -> bool:
        """Whether the two sides of the mate are different links."""
        return bool(self.joints) or self.loop is not None or self.keep

    @property
    def free(self) -> bool:
        """Whether the joint of the mate does not constrain the motion of the child."""
        return bool(self.joints) and self.joints[0].kind.free


class Link(OneLineStruct):
    """A set of rigidly connected occurrences, which are one body in every simulator. A mate with `keep` separates two links.

    `frame` is the index of the occurrence whose frame is also the frame of the link. `poses[k]` is the pose of `members[k]` in the link's
    frame. `properties` contains the total mass properties in the frame of the link.
    """

    name: LinkPath
    index: int
    frame: int
    members: tuple[int, ...]
    poses: tuple[Pose, ...]
    properties: MassProperties
    origin: Origin


class MountAt(OneLineStruct):
    """A mount in the linked assembly, given by the index of its occurrence, its name, and its pose in the frame of the occurrence.

    In an assembly that is mirrored along x or z, the pose of the mount `origin` is not the identity: its y axis is reversed, as in other
    mounts.
    """

    occurrence: int
    mount: str
    pose: Pose


class LinkedMount(MountAt):
    """A mount or a component to which a document refers, with the path of the corresponding site in the robot.

    The path is for example `hand/tip`, or `hand/origin` for a component.
    """

    path: SitePath

    @property
    def of_component(self) -> bool:
        """Whether the reference is to a component and not to a mount.

        If the reference is placed at a pose, the origin of a component is at this pose, but a mount is mated to this pose. The field
        `mount` is not sufficient, because a mount of an assembly can be the origin of one of its components.
        """
        return self.path.rpartition("/")[2] == "origin"


class ExportedMount(LinkedMount):
    """A mount that an assembly exports, with its path in the robot.

    For the mount `tip`, the path is `tip` in the top document, and `hand/tip` in the nested assembly `hand`.
    """

    origin: Origin


class Adhesion(LinkedMount):
    """A magnet at a mount. `force` [N] is the largest force that any mode specifies for the magnet."""

    force: float


class Foot(OneLineStruct):
    """A mount on which a mode with a free base stands, with the coefficient of sliding friction between the mount and the floor."""

    mount: LinkedMount
    friction: float
    origin: Origin


class LinkedSensor(Measurement):
    """A sensor with its path in the robot (`leg/imu`) and with resolved references.

    `joint` and `tendon` are paths in the robot, and `touching` contains indices of links.

    `parts` maps readings to their names in output files, if a document specifies these names.
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
        return tuple(mount for mount in (self.at, self.seen_from) if mount is not None)

    @property
    def site(self) -> str | None:
        """The path of the site at which the sensor is mounted."""
        return None if self.at is None else self.at.path

    def part(self, reading: str) -> str:
        """Return the name in output files of a reading such as `gyro`, for formats in which each reading is a separate sensor."""
        return self.parts.get(reading, f"{self.path}:{reading}")


class TendonStep(resolved.Wrap):
    """A step of the path of a tendon: a mount that the tendon passes, a shape that it wraps, or a pulley.

    References to mounts are resolved.
    """

    mount: LinkedMount | None
    side: LinkedMount | None


class LinkedTendon(resolved.TendonLength):
    """A tendon with its path in the robot (`hand/grip`) and with resolved references to joints and mounts.

    `moves` maps joint paths to the change of the tendon's length per unit of q. A tendon along a path has `steps`. The default for the rest
    length of its spring is the length at q = 0.
    """

    path: TendonPath
    moves: dict[JointPath, float]
    actuator: ActuatorModel | None
    steps: tuple[TendonStep, ...] = ()

    @property
    def name(self) -> str:
        """The path as documents write it, such as `hand.grip`."""
        return self.path.replace("/", ".")

    @property
    def transmission(self) -> str | None:
        """The path of the differential, if the tendon is the drive of a differential."""
        return None if self.actuator is None else self.actuator.transmission

    @property
    def mounts(self) -> tuple[LinkedMount, ...]:
        """The mounts through which the tendon passes, and the mounts of the shapes around which the tendon wraps."""
        return tuple(mount for step in self.steps for mount in (step.mount, step.side) if mount is not None)

    def length(self, q: Mapping[str, float]) -> float:
        """Compute the length [rad or m] of a tendon whose length is a sum of joint coordinates.

        `q` maps the paths of all joints to their positions [rad or m].
        """
        return sum_of(factor * q[path] for path, factor in self.moves.items())


class LinkedMode(resolved.ModeSettings):
    """A mode of the top document with resolved references.

    `exclude` contains pairs of link indices, and `adhesion` maps paths of magnets to forces. `pose` is the start pose of the mode, which is
    the first of `poses`. `cut` contains the paths of the joints at which loops should be cut. If the mode is `on_floor`, the height in `at`
    is 0 until the function `stand` computes it. The function `stand` also adds the root poses of other keyframes to `at_in`.
    """

    root: LinkedMount
    exclude: tuple[tuple[int, int], ...]
    adhesion: dict[SitePath, float]
    pairs: tuple[resolved.ContactPair[int], ...] = ()
    groups: tuple[resolved.ContactGroup[int], ...] = ()
    holds: tuple[resolved.Hold[LinkedMount], ...] = ()
    feet: tuple[Foot, ...] = ()

    def has_drive(self, path: str) -> bool:
        """Return whether a drive of the robot exists in the mode. `path` is the path of its joint or tendon."""
        return self.actuators is None or path in self.actuators


class FileNames(OneLineStruct):
    """The names of elements in output files, for elements whose name differs from their path.

    The name of a component is also the name of its link. Drives are keyed by their joint coordinate or tendon, and equalities by the joint
    that mimics or closes a loop. The key of a sensor can be followed by a reading (`imu:gyro`).
    """

    components: dict[str, str] = {}
    mounts: dict[str, str] = {}
    joints: dict[str, str] = {}
    tendons: dict[str, str] = {}
    actuators: dict[str, str] = {}
    equalities: dict[str, str] = {}
    sensors: dict[str, str] = {}
    poses: dict[str, str] = {}


class LinkedTest(OneLineStruct):
    """A test of the top document with resolved references.

    References to mounts are replaced by mounts, and references to components by the indices of their parts, links and frames.
    """

    test: resolved.Test
    mounts: dict[resolved.Reference, MountAt]
    components: dict[resolved.Reference, tuple[int, ...]]


class Connected(OneLineStruct):
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

    `base` is the index of the base occurrence, whose frame is the frame of the assembly. `rest[i]` is the pose of the occurrence with index
    i in this frame at q = 0. The mates that do not close loops form a tree: their number is one less than the number of occurrences.
    `names` is None if every element is named after its path in output files. In `raw`, names of elements in nested documents begin with the
    path of the document.
    """

    name: str
    definition: resolved.AssemblyDefinition
    base: int
    rest: tuple[Pose, ...]
    poses: tuple[resolved.NamedPose, ...]
    raw: tuple[resolved.RawAttribute, ...]
    added: tuple[resolved.RawElement, ...] = ()
    tests: tuple[LinkedTest, ...] = ()
    names: FileNames | None = None
    free_joint: JointPath = "root"

    def start_pose(self, mode: LinkedMode) -> resolved.NamedPose:
        """Return the pose in which a mode starts. If it is not in `poses`, all joints start at 0."""
        at_zero = resolved.NamedPose(name="at_zero", values={}, origins={}, origin=mode.origin, stated=False)
        return next((pose for pose in self.poses if pose.name == mode.pose), at_zero)

    def in_target(self, target: str) -> Assembly:
        """Return the assembly with the shapes that the document selects for a format, without the omitted levels of detail."""
        omitted = self.definition.omitted
        if not any(omitted.values()) and not any(("targets", target) in occurrence.overrides.variants for occurrence in self.occurrences):
            return self
        return replace(self, occurrences=tuple(occurrence.in_target(target, omitted) for occurrence in self.occurrences))

    def in_mode(self, mode: str) -> Assembly:
        """Return the assembly with the shapes that the document selects for a mode."""
        if not any(("modes", mode) in one.overrides.variants or mode in one.omitted_in for one in self.occurrences):
            return self
        return replace(self, occurrences=tuple(one.in_mode(mode) for one in self.occurrences))

    @property
    def hag(self) -> Hag:
        """The hierarchical assembly graph of the robot. The graph is computed each time."""
        return hag_of(self.definition)

    @property
    def drives(self) -> dict[str, str]:
        """The names of drives in output files, keyed by the path of the joint coordinate or tendon that the drive moves."""
        driven: list[JointEdge | LinkedTendon] = [*(joint for mate in self.mates for joint in mate.joints), *self.tendons]
        return {element.path: element.actuator.name or element.path for element in driven if element.actuator is not None}

    @property
    def properties(self) -> MassProperties:
        """The mass properties of the whole robot at q = 0, in the frame of the base component."""
        return total(occurrence.properties.seen_from(self.rest[occurrence.index]) for occurrence in self.occurrences)

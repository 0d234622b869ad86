"""Data types of the model that the pass `resolve` creates.

All names, units and expressions of documents are resolved. Values are in SI units. References to mounts of parts are not resolved, because
the mounts depend on the geometry of the part. Such a reference contains only the name of the mount, which `model/assembly` checks.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Generic, Literal, TypeVar

from msgspec.structs import replace

from thingc.base.diagnostics import Note, make_notes
from thingc.base.export_names import JointPath, PoseName, RawAttributes, RawPath
from thingc.base.joints.kinds import BaseType
from thingc.base.joints.twist import Twist
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import NO_POSE, Pose, Vector
from thingc.base.sensor_kinds import Measurement
from thingc.base.source import Origin, Span
from thingc.geometry.print_slices import BRIDGE_FLOW, OVERLAP, UPRIGHT, PrintDirection, Slicing
from thingc.geometry.record import DriveType, MountRecord, PartDefinition, Value, WantedPieces
from thingc.model.resolve.coordinates import Coordinate, CoordinateName, DriveValues, Dynamics, Gear, Limit
from thingc.model.resolve.link_definition import LinkDefinition

COUNTED = "this `count` determines how often the reference is repeated"
"""The text of a note that shows the count of a `repeat`, if an indexed reference in the `repeat` is invalid."""


class Reference(OneLineStruct):
    """A reference to a component or to a mount, such as `hand.cap.pen`.

    `path` contains the names of the component and its parent components, and `mount` is the name of the mount.

    If `mount` is None, the reference is to the component itself, as in `links`, in `drive` and in the root of a mode. If a nested assembly
    exports the mount, `path` ends at this assembly. `repeat_origin` is the location of the count of the enclosing `repeat`, if the
    reference contains the index of an item after the first item.
    """

    path: tuple[str, ...]
    mount: str | None
    origin: Origin
    repeat_origin: Origin = ()

    @property
    def text(self) -> str:
        """The reference in the notation of documents, with dots: `hand.cap.pen`."""
        return ".".join((*self.path, self.mount) if self.mount is not None else self.path)


class Process(OneLineStruct):
    """The manufacturing process of a part. `kind` is the type of the process, such as `fdm`. Line widths and layer heights are in metres.

    Infill and overlap are between 0 and 1. `speed` [m/s] and `layer_time` [s] determine the printing time.

    `bridge_flow` is the ratio of material flow in bridges to normal flow. `tolerance` [m] and `tilt` [rad] are the largest deviations of
    mounts along and about each axis of the part. `estimate` is the method for estimating the mass of a part with infill, `layers | skin`
    (None: the default of the process). `origins` contains the locations of the settings in the document. `wrong`
    contains the names of invalid settings, which have been reported.
    """

    kind: str | None = None
    walls: int | None = None
    line_width: float | None = None
    layer: float | None = None
    top: int | None = None
    bottom: int | None = None
    infill: float | None = None
    overlap: float | None = None
    bridge_flow: float | None = None
    speed: float | None = None
    layer_time: float | None = None
    tolerance: float | None = None
    tilt: float | None = None
    estimate: str | None = None
    origins: dict[str, Origin] = {}
    wrong: frozenset[str] = frozenset()

    def merge_over(self, defaults: Process) -> Process:
        """Return this process, with missing settings taken from `defaults`."""
        specified = {name: value for name in Process.__struct_fields__ if (value := getattr(self, name)) is not None}
        invalid = self.wrong | (defaults.wrong - specified.keys())
        return replace(defaults, **{**specified, "origins": {**defaults.origins, **self.origins}, "wrong": invalid})

    @property
    def technique(self) -> str:
        """The kind of process of a print: `kind`, or `fdm` if it is not specified."""
        return self.kind or "fdm"

    @property
    def estimation(self) -> str | None:
        """The method for estimating the printed volume of a part, `layers` or `skin`. None for a solid part."""
        if self.infill is None or self.infill >= 1.0:
            return None
        return self.estimate or ("layers" if self.kind == "fdm" else "skin")

    @property
    def missing_keys(self) -> tuple[str, ...]:
        """The missing settings without which the mass of a part cannot be estimated, such as `("walls",)`."""
        return tuple(key for key in _NEEDED.get(self.estimation or "", ()) if getattr(self, key) is None)

    @property
    def unspecified_keys(self) -> tuple[str, ...]:
        """The missing settings that must be reported to the user.

        Invalid settings are omitted, because they have already been reported. If `kind` or `estimate` is invalid, the result is empty.
        """
        return tuple(key for key in self.missing_keys if key not in self.wrong) if self.wrong.isdisjoint(("kind", "estimate")) else ()

    @property
    def layers_too_high(self) -> bool:
        """Whether the layer height exceeds the line width."""
        return self.layer is not None and self.line_width is not None and self.layer > self.line_width

    def slicing(self, up: PrintDirection | None) -> Slicing | None:
        """Return the slicing settings of a part that is printed in the direction `up`.

        Return None if settings are missing, or if the mass is not estimated from layers.
        """
        if self.estimation != "layers" or self.missing_keys or self.layers_too_high:
            return None
        return Slicing(
            up=up or UPRIGHT, layer=self.layer or 0.0, line_width=self.line_width or 0.0, walls=self.walls or 0, top=self.top or 0,
            bottom=self.bottom or 0, overlap=OVERLAP if self.overlap is None else self.overlap, bridge_flow=self.bridge_flow or BRIDGE_FLOW,
        )


_NEEDED = {"skin": ("walls", "line_width"), "layers": ("walls", "line_width", "layer", "top", "bottom")}


class Material(OneLineStruct):
    """A material that components of a document can use.

    `density` is in [kg/m^3], `color` is `#rrggbb` or `#rrggbbaa`, `price_per_kg` is an amount with a currency, and `slide` is the sliding
    friction. The other fields contain the coefficients of torsional and rolling friction. `process_origin` is the location of the key
    `process` of the material in the document (empty without this key). `density_origin` is the location of the density in the document.
    """

    name: str
    density: float | None
    origin: Origin
    color: str | None = None
    price_per_kg: str | None = None
    slide: float | None = None
    torsion: float | None = None
    roll: float | None = None
    process: Process | None = None
    process_origin: Origin = ()
    density_origin: Origin = ()


class StatedValue(OneLineStruct):
    """A mass property that a document specifies, with its source and its location.

    The value is a mass [kg], a centre of mass [m], or an inertia ixx iyy izz ixy ixz iyz [kg m^2].

    If `stand_in` is True, the document specifies an invalid value, which has been reported, and `value` is a placeholder. If `computed` is
    True, the document does not specify the value, which was computed from the parts of a lump.
    """

    value: tuple[float, ...]
    source: str
    origin: Origin
    stand_in: bool = False
    computed: bool = False


class ExtraMount(MountRecord):
    """A mount that a document adds to a component."""

    origin: Origin


ChoicePath = tuple[str, ...]
"""The path of collision shapes below the key `collision`: `()`, `("targets", "mjcf")` for a format or `("modes", "bench")` for a mode."""


class CollisionChoice(OneLineStruct):
    """The collision shapes of a part: a kind, or `shapes` for the list `shapes`.

    `pieces` is the largest number of pieces of `decompose`, or 0 for any number.
    """

    collision: str = "hull"
    pieces: int = 0
    shapes: LinkDefinition | None = None


class Overrides(CollisionChoice):
    """The values in a document that override properties of a component. A value is None if it is not overridden.

    `variants` contains the collision shapes in single formats and modes. `up` is the direction away from the bed of a printer, in the axes
    of the component.
    """

    mass: StatedValue | None = None
    com: StatedValue | None = None
    inertia: StatedValue | None = None
    variants: dict[ChoicePath, CollisionChoice] = {}
    visual: bool = True
    process: Process | None = None
    up: PrintDirection | None = None

    @property
    def choices(self) -> dict[ChoicePath, CollisionChoice]:
        """All collision shapes, by their path below `collision`."""
        return {(): self, **self.variants}

    @property
    def fully_stated(self) -> bool:
        """Whether mass, centre of mass and inertia are all specified, so that they need not be computed from the geometry."""
        return self.mass is not None and self.com is not None and self.inertia is not None

    def process_with(self, material: Material | None) -> Process:
        """Return the manufacturing process. Its own settings take precedence over settings of the material."""
        return (self.process or Process()).merge_over(material and material.process or Process())


class BomEntry(OneLineStruct):
    """An entry of the bill of materials. `make` is `buy | print | machine`.

    `cost` is the price per piece, such as `12.50 EUR`, and `prices` contains prices with the smallest quantities for which they apply, in
    ascending order. Only one of the two is set. `picture` is the path of a file in the workspace. `one` is True for a nested assembly that
    is one bought part.
    """

    number: str | None = None
    supplier: str | None = None
    cost: str | None = None
    make: str | None = None
    link: str | None = None
    picture: str | None = None
    prices: tuple[tuple[int, str], ...] = ()
    one: bool = False

    def merge_over(self, defaults: BomEntry) -> BomEntry:
        """Return this entry, with missing values taken from `defaults`. `cost` and `prices` come from the same entry."""
        price_source = self if self.cost is not None or self.prices else defaults
        texts = {name: first if (first := getattr(self, name)) is not None else getattr(defaults, name) for name in _BOM_TEXTS}
        return BomEntry(**texts, cost=price_source.cost, prices=price_source.prices, one=self.one)

    def price(self, quantity: int) -> str | None:
        """Return the price per piece for a quantity, or None if it is unknown."""
        return next((price for least, price in reversed(self.prices) if least <= quantity), self.cost)


_BOM_TEXTS = ("number", "supplier", "make", "link", "picture")


class Attach(OneLineStruct):
    """A rigid mate between a mount of this component and the mount `to`.

    `turn` is the rotation angle [rad] about the z axis of `to`, and `gap` is the distance [m] along this axis.

    The path of the reference `mount` begins with the name of this component.
    """

    mount: Reference
    to: Reference
    turn: float
    gap: float
    origin: Origin
    keep: bool = False


class At(OneLineStruct):
    """The placement of a component's origin at `pose` in the frame of the mount `to`. No mounts are mated."""

    to: Reference
    pose: Pose
    origin: Origin
    keep: bool = False


class Component(OneLineStruct):
    """A component of a resolved assembly: a part, a file, a link, a frame or a nested assembly.

    `definition` is the definition of a part, a link or a nested assembly. `frame` is True for a frame, which does not have a definition. If
    a component has no definition and is not a frame, it is invalid and has been reported. Later passes skip invalid components. `placement`
    is None for the base and for components that a joint places. `material` is the material that the document specifies for the component.
    If `material` is None, later passes use the default material of the Thing, if the `materials` of the assembly contain it. For a
    component of a mirror image, `image_of` is the original component. If the part equals its mirror image, `mounts_mirrored` is the axis
    along which its mounts are mirrored. `key` is the key of the component in the document. All items of a `repeat` have the same key.
    `detail` contains the levels of detail to which the component belongs. `mode` is the mode of a nested assembly, or None.
    """

    name: str
    key: str
    definition: PartDefinition | LinkDefinition | AssemblyDefinition | None
    frame: bool
    placement: Attach | At | None
    material: Material | None
    overrides: Overrides
    mounts: dict[str, ExtraMount]
    bom: BomEntry
    origin: Origin
    detail: frozenset[str] = frozenset()
    mode: str | None = None
    image_of: Component | None = None
    mounts_mirrored: str | None = None

    @property
    def label(self) -> str:
        """The displayed name of the definition of the component."""
        return self.definition.label if self.definition is not None else "frame"

    def full_origin(self, inner: Origin, use: Origin) -> Origin:
        """Return the location `inner` of a value of this component, followed by the locations of the documents that contain the component.

        `use` is the location of an occurrence of the component.
        """
        return inner + use[len(self.origin):]


class Drive(DriveValues):
    """A drive of a joint or tendon. `component` is a component whose Thing declares an actuator, or None for an inline drive.

    With a `gear`, all other values are those of the actuator, on the motor side of the transmission. `stall` is the effort at rest of the
    torque-speed line. `spans` contains the locations of values, by key.
    """

    component: Reference | None
    kind: DriveType | None = None
    armature: float | None = None
    gear: Gear | None = None
    stall: float | None = None
    spans: dict[str, Span] = {}


class Joint(Coordinate):
    """A joint, or one coordinate of a joint, in a resolved document.

    The joint places the component of its child mount, unless the joint closes a loop. A joint with several coordinates is represented by a
    sequence of these objects. `name` is the name of the coordinate (`wrist[0]`). `twist` is its motion in the frame of the parent mount
    after the motions of the preceding coordinates (None for a `fixed` joint). For diagnostics, `spans` contains the spans of values of the
    joint by path (`limit.lower`), and `written` contains these values. If the joint has an `axis` (a unit vector in the frame of the parent
    mount), the mounts coincide at q = 0 instead of facing each other. Without `axis`, a `mirrored` joint moves in a frame that is the frame
    of the parent mount after a rotation by pi about x. If `reverse` is True, `twist` is the reversed motion. `geared` is True if a
    transmission drives the joint, alone or together with other joints. If the joint is the `base` of a nested assembly in a mode, the frame
    at `pose` in the parent mount replaces the frame of the parent mount.
    """

    twist: Twist | None
    parent: Reference
    child: Reference
    turn: float
    gap: float
    drive: Drive | None
    spans: dict[str, Span]
    written: dict[str, str] = {}
    loop: bool = False
    keep: bool = False
    mirrored: bool = False
    reverse: bool = False
    axis: Vector | None = None
    geared: bool = False
    base: bool = False
    pose: Pose = NO_POSE

    @property
    def settable(self) -> bool:
        """Whether the coordinate is a single number that poses and tests can set. It does not mimic another joint."""
        return self.mimic is None and self.twist is not None and not self.kind.at_once

    def origin_of(self, key: str, origin: Origin) -> Origin:
        """Return the location of a value of the joint, such as `limit.effort`, or the location of the joint if the value is missing.

        `origin` is the location of the joint, followed by the locations of the documents that contain its document.
        """
        return (self.spans[key], *origin[1:]) if key in self.spans else origin

    def definition_note(self, name: str) -> tuple[Note, ...]:
        """Return a note with the location of the joint, which is called `name` in the message."""
        return make_notes(f"`{name}` is defined here", self.origin)


class Wrap(OneLineStruct):
    """A step of a tendon's path, where the tendon passes through a mount, wraps around a shape, or runs over a pulley.

    A `shape` has a `radius` [m]. If `side` is given, the tendon passes the shape on the side of this mount. A step without a mount is a
    pulley. Lengths after the pulley are divided by `divisor`.
    """

    shape: Literal["sphere", "cylinder"] | None = None
    radius: float | None = None
    divisor: float | None = None
    origin: Origin


class PathStep(Wrap):
    """A step of a tendon's path in a document. The mounts are references whose parts are not yet known."""

    mount: Reference | None = None
    side: Reference | None = None


class TendonLength(OneLineStruct):
    """The length of a tendon. The limit and the dynamics of the tendon apply to this length.

    If `turns` is True, the length is an angle [rad], otherwise a length [m]. MuJoCo draws a tendon along a path with the diameter `width`
    [m].
    """

    turns: bool
    limit: Limit
    dynamics: Dynamics
    origin: Origin
    width: float | None = None


class Tendon(TendonLength):
    """A tendon of a document, whose length is a weighted sum of joint coordinates, or the length of a path.

    `moves` contains the factor of each coordinate [per unit of q]. The drive acts on the length.
    """

    name: str
    moves: tuple[tuple[CoordinateName, float], ...]
    drive: Drive | None
    path: tuple[PathStep, ...] = ()


class LinkName(OneLineStruct):
    """An entry of the section `links:`, such as `{base_link: plate}`.

    The entry contains the name of a link, and the component whose frame is the frame of the link.
    """

    name: str
    component: Reference
    origin: Origin


NamedKind = Literal["components", "mounts", "joints", "tendons", "actuators", "equalities", "sensors", "poses"]


class NameInFiles(OneLineStruct):
    """An entry of the section `names:`, such as `{joints: {joint_1: "1"}}`: the name of an element in output files.

    `own` is the name of the element in the document. For a coordinate, `own` is the default name in files (`wrist_0`).
    """

    kind: NamedKind
    own: str
    name: str
    origin: Origin


class NamedPose(OneLineStruct):
    """A named pose of a document, with patterns and poses of nested documents resolved to joints.

    The pose maps each joint path (`hand/finger`) to the position q [rad or m] and to the location of the value in the document.

    Joints that are not in the pose are at 0, or follow the joints that they mimic. `stated` is False for a pose that the document does not
    contain, in which modes without a pose start.
    """

    name: PoseName
    values: dict[JointPath, float]
    origins: dict[JointPath, Origin]
    origin: Origin
    stated: bool = True


class NamedMotion(OneLineStruct):
    """A motion of the joints: the positions q [rad or m] of joints by path, at increasing `times` [s].

    If `smooth` is True, the positions lie on natural cubic splines. Otherwise, the robot rests at each time, and each joint moves between
    two times with minimum jerk. Joints that the motion does not contain are at 0.
    """

    name: str
    times: tuple[float, ...]
    values: dict[JointPath, tuple[float, ...]]
    smooth: bool
    origin: Origin


class Sensor(Measurement):
    """A sensor of a robot. If `seen_from` is given, the sensor measures the pose or the velocity of its mount relative to this mount.

    `joint` is the path of the measured or driven joint (`leg/knee`), and `tendon` is the name of the measured or driven tendon. `touching`
    contains the component whose contacts the sensor measures, and optionally the other component of the contact.
    """

    name: str
    at: Reference | None = None
    seen_from: Reference | None = None
    joint: str | None = None
    tendon: str | None = None
    touching: tuple[Reference, ...] = ()


Member = TypeVar("Member")
"""The type of a component or mount in a mode: a `Reference` before the pass `link`, then the index of an occurrence or a `LinkedMount`."""


class Hold(OneLineStruct, Generic[Member]):
    """A mount that a mode holds to the world, in addition to the root of the mode.

    The mount is mated to the frame `pose` in the world.

    If `pose` is None, the document specifies `here`: the mount is held at its pose in the start pose of the mode. If `mount` is a reference
    to a component, its origin is at `pose`. If `turns` is True, the hold transmits only a force, and the link can rotate about the fixed
    origin of the mount.
    """

    mount: Member
    pose: Pose | None
    origin: Origin
    turns: bool = False


class Standing(OneLineStruct):
    """The mounts on which a robot with a free base stands. The floor can push these mounts but not pull them.

    If `friction` is None, the friction of the materials at the mounts is used.
    """

    mounts: tuple[Reference, ...]
    friction: float | None
    origin: Origin


class Cut(OneLineStruct):
    """The path of a joint at which a mode should cut a kinematic loop, and its location in the document."""

    joint: JointPath
    origin: Origin


class ModeSettings(OneLineStruct):
    """The settings of a mode that do not refer to elements of the document.

    `at` is the pose of the root in the world. If `on_floor` is True, the height in `at` is not yet known. `at_in` maps some named poses of
    the robot to a different pose of the root. `gravity` is a vector [m/s^2] in the world frame. `poses` contains the names of the
    keyframes, in order. The start pose `pose` comes first. `actuators` contains the paths of the driven joints, or is None for all joints
    with a drive. `stated` is False for the default mode of a document that does not define modes.
    """

    name: str
    base: BaseType
    at: Pose
    gravity: Vector
    poses: tuple[PoseName, ...]
    actuators: tuple[JointPath, ...] | None
    simulation: dict[str, float | str]
    origin: Origin
    pose: PoseName | None = None
    cut: tuple[Cut, ...] = ()
    on_floor: bool = False
    stated: bool = True
    at_in: dict[PoseName, Pose] = {}


class ContactPair(OneLineStruct, Generic[Member]):
    """A pair of components that always collide.

    The settings are friction (sliding, torsional, rolling), margin [m] and gap [m], each None for the default.
    """

    one: Member
    other: Member
    friction: tuple[float | None, float | None, float | None]
    margin: float | None
    gap: float | None
    origin: Origin


OTHERS = "others"
"""Name of the contact group of all components without a group, of the floor, and of other objects in a scene."""


class ContactGroup(OneLineStruct, Generic[Member]):
    """A group of components that collide only with the groups in `collides`."""

    name: str
    members: tuple[Member, ...]
    collides: tuple[str, ...]


class Mode(ModeSettings):
    """A mode, including the settings of the modes that it extends. If `root.mount` is None, the root is a component.

    `exclude` contains pairs of references to components that do not collide. `adhesion` maps mounts to adhesion forces [N]. `step_origin`
    and `gravity_origin` are the locations of `timestep` and of numeric `gravity` in the mode, or empty. `has_expressions` is True if the
    mode contains expressions, so that its values depend on parameters.
    """

    root: Reference
    exclude: tuple[tuple[Reference, Reference], ...]
    adhesion: tuple[tuple[Reference, float], ...]
    pairs: tuple[ContactPair[Reference], ...] = ()
    groups: tuple[ContactGroup[Reference], ...] = ()
    holds: tuple[Hold[Reference], ...] = ()
    standing: Standing | None = None
    step_origin: Origin = ()
    gravity_origin: Origin = ()
    has_expressions: bool = False


class RawAttribute(OneLineStruct):
    """An attribute in the section `raw` of a document, such as `raw: {mjcf: {joint: {yaw: {solreflimit: 0.01 1}}}}`.

    For this example, `target` is `mjcf`, `path` is `("joint", "yaw", "solreflimit")`, and `value` is a string. For `usd`, which has typed
    attributes, the string is JSON. `origin` is the location of the value, and `keys` contains the locations of the keys.
    """

    target: str
    path: RawPath
    value: str
    origin: Origin
    keys: tuple[Span, ...] = ()

    @property
    def dotted(self) -> str:
        """The path of the attribute with dots, such as `raw.mjcf.joint.yaw.solreflimit`."""
        return ".".join(("raw", self.target, *self.path))

    def at_key(self, index: int) -> Origin:
        """Return the location of the key with the index `index` in `path`.

        If the index is after the last key, return the location of the value.
        """
        return self.keys[index : index + 1] + self.origin[1:] if index < len(self.keys) else self.origin


class RawElement(OneLineStruct):
    """An element that `raw: {mjcf: {add: ...}}` adds to a `section` of a MuJoCo model, with its child elements."""

    section: str
    tag: str
    attributes: RawAttributes
    children: tuple[RawElement, ...]
    origin: Origin

    @property
    def dotted(self) -> str:
        """The path of the element with dots, such as `raw.mjcf.add.tendon.grip`.

        For an element without a name, the path contains its tag.
        """
        return ".".join(("raw.mjcf.add", self.section, self.attributes.get("name", self.tag)))

    @property
    def text(self) -> str:
        """The whole element as text on one line, for display."""
        text = " ".join((self.tag, *(f"{name}={value}" for name, value in self.attributes.items())))
        return text + "".join(f" ({child.text})" for child in self.children)


class JointRange(OneLineStruct):
    """A joint that a test moves: its path, and the range of its positions from `lower` to `upper` [rad or m]."""

    joint: str
    lower: float
    upper: float


class Test(OneLineStruct):
    """A resolved document test, which runs in each of its `modes` and `poses`. `modes` is empty for tests that do not depend on a mode.

    `kind` is the type of the test, such as `reach`. In `poses`, None represents the start pose of the mode. If `every_pose` is True, the
    test runs in all keyframes of the mode, and `poses` is empty. `poses` is also empty for tests that do not depend on the pose. `check` is
    the specification of the test in SI units, as an immutable struct. Later passes find references in this struct by their type. For
    diagnostics, `spans` contains the locations of values of the test by path (`within.x`).
    """

    name: str
    kind: str
    check: Any
    modes: tuple[str, ...]
    poses: tuple[str | None, ...]
    every_pose: bool
    origin: Origin
    spans: dict[str, Span]


class AssemblyDefinition(OneLineStruct):
    """The definition of an assembly: a document with the values of its parameters.

    Equal definitions are one node of the hierarchical assembly graph.

    `document` is the path of the document in the workspace, and `parameters` contains all parameters in canonical form. `text` contains the
    parameters that differ from the values in the document (`end_effector(pen_diameter=0.02)`). `label` is the text for display
    (`end_effector(pen_diameter=20 mm)`). `materials` contains all materials that the document can use, by name. `poses` contains only the
    poses of this document, with joint paths relative to this document. `modes`, `motions`, `simulation` and `tests` are only used for the
    top document. `materials_known` is False if a materials document could not be read. Unknown materials are then not reported. `whole` is
    False if validation removed invalid entries from the document. `loose` contains the valid references of elements that were omitted
    because of another, invalid reference. `step_origin` is the location of the setting `timestep` in the document. A mirror image is a
    separate definition, such as `leg(mirror=y)`. `mirror` is the axis along which it is mirrored, and `plain` is the original definition.
    `catalog` contains the entries of the catalogue of the document, by order number. `omitted` contains the levels of detail that each
    simulation target omits (`("mjcf",)`), and that single modes omit (`("modes", "bench")`). It is only used for the top document. `order`
    contains components in the order of assembly. A `lump` is a nested assembly that becomes one rigid body in the start pose of its only
    mode.
    """

    document: str
    name: str
    description: str
    parameters: tuple[tuple[str, Value], ...]
    text: str
    label: str
    materials: dict[str, Material]
    components: tuple[Component, ...]
    joints: tuple[Joint, ...]
    links: tuple[LinkName, ...]
    mounts: dict[str, Reference]
    poses: tuple[NamedPose, ...]
    modes: tuple[Mode, ...]
    simulation: dict[str, float | str]
    raw: tuple[RawAttribute, ...]
    origin: Origin
    materials_known: bool = True
    whole: bool = True
    added: tuple[RawElement, ...] = ()
    tendons: tuple[Tendon, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    names: tuple[NameInFiles, ...] = ()
    tests: tuple[Test, ...] = ()
    motions: tuple[NamedMotion, ...] = ()
    step_origin: Origin = ()
    loose: tuple[Reference, ...] = ()
    mirror: str | None = None
    plain: AssemblyDefinition | None = None
    catalog: dict[str, BomEntry] = {}
    omitted: dict[ChoicePath, frozenset[str]] = {}
    order: tuple[Reference, ...] = ()
    lump: bool = False

    def assemblies(self) -> Iterator[AssemblyDefinition]:
        """Yield this definition, then the definitions of all nested assemblies without duplicates."""
        waiting, met = [self], {id(self)}
        for definition in waiting:
            yield definition
            for component in definition.components:
                inner = component.definition
                if isinstance(inner, AssemblyDefinition) and id(inner) not in met:
                    met.add(id(inner))
                    waiting.append(inner)

    def decompositions(self) -> WantedPieces:
        """Return the convex decompositions of the parts whose components set `collision: decompose`."""
        requested: dict[str, set[int]] = {}
        for component in (component for definition in self.assemblies() for component in definition.components):
            pieces = {choice.pieces for choice in component.overrides.choices.values() if choice.collision == "decompose"}
            if isinstance(component.definition, PartDefinition) and pieces:
                requested.setdefault(component.definition.text, set()).update(pieces)
        return {text: tuple(sorted(several)) for text, several in requested.items()}

    def part_definitions(self, *, lumps: bool = False) -> tuple[PartDefinition, ...]:
        """Return the part definitions without duplicates, in document order. A nested document is traversed at its first use.

        With `lumps`, the result includes the parts of lumps, which are not built.
        """
        definitions: dict[PartDefinition, None] = {}
        seen: set[tuple[str, object, str | None]] = set()

        def visit(assembly: AssemblyDefinition) -> None:
            for component in assembly.components:
                definition = component.definition
                if isinstance(definition, PartDefinition):
                    definitions.setdefault(definition)
                    if component.image_of is not None and definition.plain is not None:  # the part may equal its mirror image
                        definitions.setdefault(definition.plain)
                elif isinstance(definition, AssemblyDefinition) and (lumps or not definition.lump):
                    key = (definition.document, definition.parameters, definition.mirror)
                    if key not in seen:
                        seen.add(key)
                        visit(definition)

        visit(self)
        return tuple(definitions)

"""Data types of the resolved model: documents in which all names, units and expressions are resolved. Values are in SI units.

The mounts of a part are not resolved, because they depend on the geometry of the part. A reference to such a mount contains only its name,
which `model/assembly` checks.
"""

from __future__ import annotations

from typing import Any, Literal

from thingc.base.export_names import JointPath, PoseName, RawAttributes, RawPath
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.kinds import BaseType
from thingc.base.joints.twist import Twist
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.pose import Pose, Vector
from thingc.base.sensor_kinds import Measurement
from thingc.base.source import Origin, Span
from thingc.geometry.record import DriveType, PartDefinition, Value
from thingc.model.resolve.coordinates import Coordinate, CoordinateName, Dynamics, Limit
from thingc.model.resolve.link_definition import LinkDefinition

COUNTED = "the reference is repeated this often"
"""The text of a note at the count of a `repeat` whose indexed reference is invalid."""


class Reference(OneLineRepr, FrozenStruct):
    """A reference to a component or to a mount, such as `hand.cap.pen`.

    `path` contains the names of the nested components, and `mount` is the last name.

    If `mount` is None, the reference is to the component itself (`links`, `drive`, a mode's root). A mount may be exported by a nested
    assembly (then `path` ends at that assembly) or belong to a part. `repeat_origin` is the place of the count of the enclosing `repeat`,
    if the reference uses the index of an item after the first item.
    """

    path: tuple[str, ...]
    mount: str | None
    origin: Origin
    repeat_origin: Origin = ()

    @property
    def text(self) -> str:
        """The reference in the notation of documents, with dots: `hand.cap.pen`."""
        return ".".join((*self.path, self.mount) if self.mount is not None else self.path)


class Process(OneLineRepr, FrozenStruct):
    """The manufacturing process of a part. `kind` is the type of the process, such as `fdm`. Line widths and layer heights are in [m].

    Infill and overlap are between 0 and 1.

    `bridge_flow` is the ratio of material flow in bridges to normal flow. `estimate` is the method for the mass of a part with infill,
    `layers | skin` (None: by kind). `origins` contains the locations of the settings in the document. Settings in `wrong` are invalid and
    have been reported.
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
    estimate: str | None = None
    origins: dict[str, Origin] = {}
    wrong: frozenset[str] = frozenset()


class Material(OneLineRepr, FrozenStruct):
    """A material that components of a document can use.

    `density` is in [kg/m^3], `color` is `#rrggbb` or `#rrggbbaa`, and `slide` is the sliding friction. Other fields contain the
    coefficients of torsional and rolling friction. `process_origin` is the place of the material's `process` in the document (empty for a
    material without a process). `density_origin` is the location of the density in the document.
    """

    name: str
    density: float | None
    origin: Origin
    color: str | None = None
    slide: float | None = None
    torsion: float | None = None
    roll: float | None = None
    process: Process | None = None
    process_origin: Origin = ()
    density_origin: Origin = ()


class StatedValue(OneLineRepr, FrozenStruct):
    """A mass property that a document specifies, with its source and its location: mass [kg], centre of mass [m], or inertia ixx iyy izz
    ixy ixz iyz [kg m^2].

    If `stand_in` is True, the value is a placeholder for an invalid value that has been reported.
    """

    value: tuple[float, ...]
    source: str
    origin: Origin
    stand_in: bool = False


class ExtraMount(OneLineRepr, FrozenStruct):
    """A mount that a document adds to a component."""

    pose: Pose
    interface: str | None
    origin: Origin


class Overrides(OneLineRepr, FrozenStruct):
    """The values in a document that override properties of a component. A value that is not overridden is None.

    `up` is the direction away from the bed of a printer, a unit vector in the component's axes.
    """

    mass: StatedValue | None = None
    com: StatedValue | None = None
    inertia: StatedValue | None = None
    collision: str = "hull"
    visual: bool = True
    process: Process | None = None
    up: Vector | None = None


class BomEntry(OneLineRepr, FrozenStruct):
    """An entry of the bill of materials. `make` is `buy | print | machine`, and `cost` is a string such as `12.50 EUR`."""

    number: str | None = None
    supplier: str | None = None
    cost: str | None = None
    make: str | None = None


class Attach(OneLineRepr, FrozenStruct):
    """A rigid mate between a mount of this component and the mount `to`.

    `turn` [rad] is about the z axis of `to`, and `gap` [m] is along this axis.

    `mount` is a reference whose path starts with this component's own name.
    """

    mount: Reference
    to: Reference
    turn: float
    gap: float
    origin: Origin


class At(OneLineRepr, FrozenStruct):
    """The placement of a component's origin at `pose` in the frame of the mount `to`. The placement does not mate two mounts."""

    to: Reference
    pose: Pose
    origin: Origin


class Component(OneLineRepr, FrozenStruct):
    """A component of a resolved assembly: a part, a file, a link, a frame or a nested assembly.

    Either `definition` is a part, a link or a nested assembly, or `frame` is True. If neither is set, the component is invalid and has been
    reported. Later passes skip invalid components. `placement` is None for the base and for components that a joint places. `material` is
    the material that the document specifies for the component. If `material` is None, later passes look up the default material of the
    Thing in the assembly's `materials`. In the mirror image of a document, `image_of` is the original component. If the part equals its
    mirror image, `mounts_mirrored` is the axis along which its mounts are mirrored. `key` is the key of the component in the document. All
    items of a `repeat` have the same key.
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
    image_of: Component | None = None
    mounts_mirrored: str | None = None

    @property
    def label(self) -> str:
        """The label of the component's definition, for display."""
        return self.definition.label if self.definition is not None else "frame"


class Drive(OneLineRepr, FrozenStruct):
    """A drive of a joint: a `component` whose Thing declares an actuator, or an inline drive (`component` None).

    For a ball joint, `axis` is a unit vector that is fixed in the child, in the parent mount's axes at q = 0.
    """

    component: Reference | None
    kind: DriveType | None = None
    kp: float | None = None
    kv: float | None = None
    effort: float | None = None
    velocity: float | None = None
    armature: float | None = None
    origin: Origin = ()
    axis: Vector | None = None


class Joint(Coordinate):
    """A joint in a resolved document. Unless the joint closes a loop, it places the component to which its child mount belongs.

    A joint with several coordinates is a sequence of these objects: `name` is the name of the coordinate (`wrist[0]`), `twist` its motion
    in the parent mount's frame, which the preceding coordinates have moved (None for a `fixed` joint). For diagnostics, `spans` contains
    places within the joint by dotted key (`limit.lower`), and `written` contains the values at these places. With an `axis` (a unit vector
    in the parent mount's frame), the mounts coincide at q = 0 instead of facing each other. Otherwise, a `mirrored` joint moves in the
    parent mount's frame after a rotation by pi about x.
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
    mirrored: bool = False
    axis: Vector | None = None


class Wrap(OneLineRepr, FrozenStruct):
    """A step of a tendon's path, where the tendon passes through a mount, wraps around a shape, or runs over a pulley.

    The tendon passes a `shape` with a `radius` [m] on the side of the mount `side`, if specified. A step without a mount is a pulley, after
    which lengths are divided by `divisor`.
    """

    shape: Literal["sphere", "cylinder"] | None = None
    radius: float | None = None
    divisor: float | None = None
    origin: Origin


class PathStep(Wrap):
    """A step of a tendon's path in a document. Its mounts are references that are not yet resolved to parts."""

    mount: Reference | None = None
    side: Reference | None = None


class Tendon(OneLineRepr, FrozenStruct):
    """A tendon.

    Its length is a weighted sum of joint coordinates, or the length of a path. Limit, dynamics and drive act along the tendon.

    `moves` contains the factor of each coordinate [per unit of q]. If the tendon `turns`, its length is an angle [rad], otherwise a length
    [m]. MuJoCo draws a tendon along a `path` with the `width` [m].
    """

    name: str
    moves: tuple[tuple[CoordinateName, float], ...]
    turns: bool
    limit: Limit
    dynamics: Dynamics
    drive: Drive | None
    origin: Origin
    path: tuple[PathStep, ...] = ()
    width: float | None = None


class LinkName(OneLineRepr, FrozenStruct):
    """`links: {base_link: plate}`: the name of a link, and the component whose frame it uses."""

    name: str
    component: Reference
    origin: Origin


NamedKind = Literal["components", "mounts", "joints", "tendons", "actuators", "equalities", "sensors", "poses"]


class NameInFiles(OneLineRepr, FrozenStruct):
    """`names: {joints: {joint_1: "1"}}`: the name of an element in files.

    `own` is its name in the document; for a coordinate, the name in files (`wrist_0`).
    """

    kind: NamedKind
    own: str
    name: str
    origin: Origin


class NamedPose(OneLineRepr, FrozenStruct):
    """A named pose of a document, after patterns of joint names and poses of nested documents are resolved.

    The pose maps joint paths (`hand/finger`) to the position q [rad or m] and the location of the value in the document.

    Joints that are not in the pose are at 0.
    """

    name: PoseName
    values: dict[JointPath, float]
    origins: dict[JointPath, Origin]
    origin: Origin


class Sensor(Measurement):
    """A sensor at a mount. Some sensors measure the pose or the velocity of their mount relative to another mount, `seen_from`.

    `joint` is the path of the measured or driven joint (`leg/knee`), `tendon` the name of the measured or driven tendon. `touching`
    contains the component whose contacts the sensor measures and, if specified, the other component of the contact.
    """

    name: str
    at: Reference | None = None
    seen_from: Reference | None = None
    joint: str | None = None
    tendon: str | None = None
    touching: tuple[Reference, ...] = ()


class Hold(OneLineRepr, FrozenStruct):
    """A mount that a mode holds to the world, in addition to its root.

    The mount is mated to the frame `pose` in the world, in the same way as a root is mated to `at`.

    If `pose` is None, the document specifies `here`, which is the place of the mount in the mode's own pose. If `mount.mount` is None, the
    hold is on a component, whose origin is at `pose`. With `turns`, the hold transmits only force: the origin is fixed, and the link may
    rotate about the origin.
    """

    mount: Reference
    pose: Pose | None
    origin: Origin
    turns: bool = False


class Standing(OneLineRepr, FrozenStruct):
    """The mounts on which a mode with a free base stands: points where the floor can push but not pull.

    If `friction` is None, the friction of their materials is used.
    """

    mounts: tuple[Reference, ...]
    friction: float | None
    origin: Origin


class Cut(OneLineRepr, FrozenStruct):
    """The path of a joint at which a mode should cut a kinematic loop, and its location in the document."""

    joint: JointPath
    origin: Origin


class ModeSettings(OneLineRepr, FrozenStruct):
    """The settings of a mode that do not refer to elements of the document.

    `at` is the pose of the root in the world (without the height if `on_floor`). `at_in` contains the poses of the root for some poses of
    the robot. `gravity` [m/s^2] is in the world frame. `poses` contains the names of poses in the order of keyframes, with the mode's own
    `pose` first. `actuators` contains joint paths, or is None for all actuators. `stated` is False for the default mode of a document
    without modes.
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


class Mode(ModeSettings):
    """A mode, including the settings of the modes that it extends. If `root.mount` is None, the root is a component.

    `exclude` contains pairs of references to components without collisions. `adhesion` maps mounts to adhesion forces [N]. `step_origin`
    and `gravity_origin` are the places of the mode's own `timestep` and numeric gravity, or empty. `worked_out` means that the mode
    contains expressions and depends on parameters.
    """

    root: Reference
    exclude: tuple[tuple[Reference, Reference], ...]
    adhesion: tuple[tuple[Reference, float], ...]
    holds: tuple[Hold, ...] = ()
    standing: Standing | None = None
    step_origin: Origin = ()
    gravity_origin: Origin = ()
    worked_out: bool = False


class RawAttribute(OneLineRepr, FrozenStruct):
    """A raw attribute, such as `raw: {mjcf: {joint: {yaw: {solreflimit: 0.01 1}}}}`: the target, the keys, and the value as a string.

    For this example `target` is `mjcf` and `path` is `("joint", "yaw", "solreflimit")`. Values for `usd`, which has typed attributes, are
    JSON. `origin` is the place of the value, `keys` are the places of the keys.
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
        """Return the location of the key with this index in `path`. For an index after the last key, return the location of the value."""
        return self.keys[index : index + 1] + self.origin[1:] if index < len(self.keys) else self.origin


class RawElement(OneLineRepr, FrozenStruct):
    """An element that `raw: {mjcf: {add: ...}}` adds to a `section` of the model, with its children."""

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
        """The whole element on one line, for display."""
        words = " ".join((self.tag, *(f"{name}={value}" for name, value in self.attributes.items())))
        return words + "".join(f" ({child.text})" for child in self.children)


class JointRange(OneLineRepr, FrozenStruct):
    """The path of a joint that a test moves, and the range of its positions from `lower` to `upper` [rad or m]."""

    joint: str
    lower: float
    upper: float


class Test(OneLineRepr, FrozenStruct):
    """A resolved document test, which runs in each of its `modes` and `poses`. `modes` is empty for tests that do not depend on a mode.

    `kind` is the type of the test, such as `reach`. In `poses`, None represents the initial pose of the mode. `every_pose` requests all
    keyframes of the mode; `poses` is then empty, as for tests that do not depend on the pose. `check` is the specification of the test in
    SI units, an immutable struct. Later passes find the references in the struct by their type. `spans` are the places of values in the
    test by dotted key (`within.x`), for diagnostics.
    """

    name: str
    kind: str
    check: Any
    modes: tuple[str, ...]
    poses: tuple[str | None, ...]
    every_pose: bool
    origin: Origin
    spans: dict[str, Span]


class AssemblyDefinition(OneLineRepr, FrozenStruct):
    """The definition of an assembly: a document with the values of its parameters.

    Equal definitions are one node of the hierarchical assembly graph.

    `document` is its path in the workspace, `parameters` are all its parameters in canonical form. `text` contains the parameters that
    differ from the document's own values (`end_effector(pen_diameter=0.02)`), and `label` is its display form
    (`end_effector(pen_diameter=20 mm)`). `materials` contains all materials that the document can use, by name. `poses` contains only the
    poses of this document, with paths relative to it. `modes`, `simulation` and `tests` are only used for the top document.
    `materials_known` is False if a document of materials could not be read; unknown materials are then not reported. `whole` is False if
    validation removed invalid entries from the document. `loose` are valid references of elements that were omitted because another
    reference is invalid. `step_origin` is the location of the setting `timestep`. A mirror image is a separate definition
    (`leg(mirror=y)`): `mirror` is the axis of its frame along which it is mirrored, and `plain` is the original definition.
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
    step_origin: Origin = ()
    loose: tuple[Reference, ...] = ()
    mirror: str | None = None
    plain: AssemblyDefinition | None = None

"""The resolved model: documents with every name, unit and expression worked out, in SI.

Mounts of parts depend on geometry: references carry their names, which `model/assembly` checks.
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
"""The note on the count of a `repeat` whose index leads nowhere."""


class Reference(OneLineRepr, FrozenStruct):
    """`hand.cap.pen`: `path` the component names from this document down, `mount` the last word.

    `mount` None means the component itself (`links`, `drive`, a mode's root). A mount may be one that a nested
    assembly exports (then `path` ends at that assembly) or a part's own. `repeat_origin` is where the items of the surrounding
    `repeat` are counted, if it is written with the index of one that is not the first.
    """

    path: tuple[str, ...]
    mount: str | None
    origin: Origin
    repeat_origin: Origin = ()

    @property
    def text(self) -> str:
        """As written, with dots."""
        return ".".join((*self.path, self.mount) if self.mount is not None else self.path)


class Process(OneLineRepr, FrozenStruct):
    """How a part is made. `kind` such as `fdm`; widths and layer [m]; infill and overlap 0..1, bridge flow a ratio; `estimate` is how
    the mass of a part with an infill is worked out, `layers | skin` (None: by the kind). `origins` are where the keys are written; those in
    `wrong` are written, and what is wrong with them has been said."""

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
    """A material in scope. `density` [kg/m^3]; `color` `#rrggbb` or `#rrggbbaa`; `slide` the sliding friction (torsional and
    rolling likewise); `process_origin` is where its `process` is written, empty where it has none, `density_origin` the same of its
    density."""

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
    """A number a document states (mass [kg], com [m], inertia [kg m^2] as ixx iyy izz ixy ixz iyz), its source and place. One that
    was wrong, which has been reported, is a `stand_in`."""

    value: tuple[float, ...]
    source: str
    origin: Origin
    stand_in: bool = False


class ExtraMount(OneLineRepr, FrozenStruct):
    """A mount that the document adds to a component."""

    pose: Pose
    interface: str | None
    origin: Origin


class Overrides(OneLineRepr, FrozenStruct):
    """What a document says about one component on top of what its part says. None: not said. `up` is the direction away from the
    bed of a printer, a unit vector in the component's axes."""

    mass: StatedValue | None = None
    com: StatedValue | None = None
    inertia: StatedValue | None = None
    collision: str = "hull"
    visual: bool = True
    process: Process | None = None
    up: Vector | None = None


class BomEntry(OneLineRepr, FrozenStruct):
    """Of the bill of materials. `make` is `buy | print | machine`; `cost` as written (`12.50 EUR`)."""

    number: str | None = None
    supplier: str | None = None
    cost: str | None = None
    make: str | None = None


class Attach(OneLineRepr, FrozenStruct):
    """The rigid mate: this component's `mount` onto `to`; `turn` [rad] and `gap` [m] along the other mount's z.

    `mount` is a reference whose path starts with this component's own name.
    """

    mount: Reference
    to: Reference
    turn: float
    gap: float
    origin: Origin


class At(OneLineRepr, FrozenStruct):
    """Plain placement: this component's frame at `pose` in the frame `to`."""

    to: Reference
    pose: Pose
    origin: Origin


class Component(OneLineRepr, FrozenStruct):
    """A node placed in an assembly.

    Exactly one of: `definition` a part, a link or a nested assembly, or `frame` True. `definition` None without
    `frame` means that it was wrong and has been reported; later passes leave it out silently. `placement` is None for
    the base and for what a joint places. `material` is what the document says (None: the Thing's default, looked up
    in the assembly's `materials`). In the mirror image of a document `image_of` is the component that it is the image of,
    and where that part is its own image `mounts_mirrored` the axis along which its mounts are mirrored all the same. `key` is the
    name in the document, which the items of a `repeat` share.
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
        """What it is, for people: the label of its definition."""
        return self.definition.label if self.definition is not None else "frame"


class Drive(OneLineRepr, FrozenStruct):
    """What moves a joint: `component` whose Thing declares an actuator, or an inline one (`component` None); of a ball about an `axis`
    (a unit vector fixed in the child, in the parent mount's axes at q = 0)."""

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
    """An edge that moves (or a `fixed` one): it places the component that `child` belongs to, unless it closes a `loop`.

    One that has several coordinates is as many of these, next to each other: `name` is the coordinate's (`wrist[0]`), `twist` what that
    does in the parent mount's frame as those before it have moved it (None: it has none).
    `spans` gives places within the joint by dotted key (`limit.lower`), `written` the values that stand there, for diagnostics. Where it
    has an `axis` (a unit vector in the parent mount's frame), the mounts coincide at q = 0 and do not face each other; else one that is
    `mirrored` turns and slides in the parent mount's frame upside down, turned by pi about x.
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
    """Of the path of a tendon: a `mount` that it goes through, or, with a `shape` of a `radius` [m], that it goes around, on the side of
    the mount `side` if there is one; or (without a mount) a pulley, behind which lengths are divided by `divisor`."""

    shape: Literal["sphere", "cylinder"] | None = None
    radius: float | None = None
    divisor: float | None = None
    origin: Origin


class PathStep(Wrap):
    """A step of a path, with its mounts as the document names them."""

    mount: Reference | None = None
    side: Reference | None = None


class Tendon(OneLineRepr, FrozenStruct):
    """A sum of coordinates, its length: `moves` has the factor of each [by the units of q], `turns` says whether the length is an angle
    [rad], else it is [m]. Or the length of a `path`, drawn with a `width` [m]. Limit, dynamics and drive are along it."""

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
    """`links: {base_link: plate}`: names a link and picks its frame."""

    name: str
    component: Reference
    origin: Origin


NamedKind = Literal["components", "mounts", "joints", "tendons", "actuators", "equalities", "sensors", "poses"]


class NameInFiles(OneLineRepr, FrozenStruct):
    """`names: {joints: {joint_1: "1"}}`: what files call a thing of the document. `own` is what the document calls it, of coordinates as
    artifacts have it (`wrist_0`)."""

    kind: NamedKind
    own: str
    name: str
    origin: Origin


class NamedPose(OneLineRepr, FrozenStruct):
    """A pose with its globs and nested poses worked out: joint path (`hand/finger`) to q [rad or m], and where each
    value was written. Joints not named are at 0."""

    name: PoseName
    values: dict[JointPath, float]
    origins: dict[JointPath, Origin]
    origin: Origin


class Sensor(Measurement):
    """By its kind it sits `at` a mount, and is seen from another; `joint` is the path of the joint (`leg/knee`) that is measured or driven,
    `tendon` the name of such a tendon; `touching` are the component whose link is touched, and the one that touches it, if it is not
    anything."""

    name: str
    at: Reference | None = None
    seen_from: Reference | None = None
    joint: str | None = None
    tendon: str | None = None
    touching: tuple[Reference, ...] = ()


class Hold(OneLineRepr, FrozenStruct):
    """A further mount that a mode holds to the world: mated to the world frame moved to `pose`, as a root is mated to `at`.

    `pose` None: `here`, where the mode's own pose puts it. `mount.mount` None: a component, whose origin lies on `pose`. One that
    `turns` carries force alone: its origin stays, and it may turn about it.
    """

    mount: Reference
    pose: Pose | None
    origin: Origin
    turns: bool = False


class Standing(OneLineRepr, FrozenStruct):
    """The mounts that a floating mode stands on, points that the floor pushes and does not pull. `friction` None: that of their
    materials."""

    mounts: tuple[Reference, ...]
    friction: float | None
    origin: Origin


class Cut(OneLineRepr, FrozenStruct):
    """A joint (its path) at which a mode wants a loop to be cut."""

    joint: JointPath
    origin: Origin


class ModeSettings(OneLineRepr, FrozenStruct):
    """What a mode is before and after its references are worked out.

    `at` is the world side's pose (without its height if `on_floor`), `at_in` that in some poses; `gravity` [m/s^2] in the world frame;
    `poses` in keyframe order, the mode's own `pose` first; `actuators` joint paths, None for all. A document without modes has one that is
    not `stated`.
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
    """One simulation model. `extends` has been merged. `root.mount` None: a component root.

    `exclude` are pairs of component references; `adhesion` [N] per mount. `step_origin` and `gravity_origin` are where its own
    `timestep` and a gravity in numbers are written, else empty. `worked_out` modes have expressions, and depend on parameters.
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
    """`raw: {mjcf: {joint: {yaw: {solreflimit: 0.01 1}}}}`: the target, the keys on the way, and the value as text (of `usd`, whose
    attributes have types, as JSON).

    For that example `target` is `mjcf`, `path` `("joint", "yaw", "solreflimit")`; origin is the value's place, `keys` are
    those of the keys.
    """

    target: str
    path: RawPath
    value: str
    origin: Origin
    keys: tuple[Span, ...] = ()

    @property
    def dotted(self) -> str:
        """`raw.mjcf.joint.yaw.solreflimit`."""
        return ".".join(("raw", self.target, *self.path))

    def at_key(self, index: int) -> Origin:
        """The origin of one of its keys, or of its value where there are no more."""
        return self.keys[index : index + 1] + self.origin[1:] if index < len(self.keys) else self.origin


class RawElement(OneLineRepr, FrozenStruct):
    """An element that `raw: {mjcf: {add: ...}}` adds to a `section` of the model, with what it has in it."""

    section: str
    tag: str
    attributes: RawAttributes
    children: tuple[RawElement, ...]
    origin: Origin

    @property
    def dotted(self) -> str:
        """`raw.mjcf.add.tendon.grip`, by its tag where it has no name."""
        return ".".join(("raw.mjcf.add", self.section, self.attributes.get("name", self.tag)))

    @property
    def text(self) -> str:
        """All of it in one line, for people."""
        words = " ".join((self.tag, *(f"{name}={value}" for name, value in self.attributes.items())))
        return words + "".join(f" ({child.text})" for child in self.children)


class JointRange(OneLineRepr, FrozenStruct):
    """A joint (its path) to move from `lower` to `upper` [rad or m]."""

    joint: str
    lower: float
    upper: float


class Test(OneLineRepr, FrozenStruct):
    """A test of a document, to be run in each of its `modes` (none: it does not depend on the mode) and `poses`.

    `kind` is the key in the document. In `poses` None is where the mode starts; `every_pose` asks for all keyframes of the mode,
    and `poses` is empty then, as where the test does not depend on the pose. `check` is what its kind has read of it, a frozen
    dataclass in SI; references in it are found by their type. `spans` are the places of values in the test by
    dotted key (`within.x`), for diagnostics.
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
    """A document with its parameters worked out: equal definitions are one node of the HAG.

    `document` is its path in the workspace, `parameters` the complete canonical ones; `text` prints those that differ
    from the document's own values (`end_effector(pen_diameter=0.02)`), `label` does for people
    (`end_effector(pen_diameter=20 mm)`). `materials` is its scope by name. Poses are of
    this document, over paths relative to it. `modes`, `simulation` and `tests` count only at the top. `materials_known`
    is False where a document of materials could not be read: then a name that is not in `materials` is no news. `whole` is
    False where validation has left something out of the document; `loose` are sound references of what was left out because another
    one in it was wrong. `step_origin` is where its `timestep` is written. A mirror image is a definition of its own (`leg(mirror=y)`):
    `mirror` is the axis of its frame that it is mirrored along, `plain` the definition that it mirrors.
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

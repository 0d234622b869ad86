"""The source model, which represents an imported robot independently of its file format. It uses SI units and contains source locations.

Readers of file formats return it, and the writer converts it to a document. A link is a rigid body. An `Attachment` attaches a link to its
parent by a sequence of joints. The sequence is empty if the link is fixed, has at most one joint in URDF, and can have several joints in
MJCF. The source model contains the default values of the format explicitly. All names are the names in the source.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import MassProperties
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.pose import NO_POSE, Pose, Quaternion, Vector, rotate
from thingc.base.sensor_kinds import SensorType
from thingc.base.source import Span

Kind = Literal["revolute", "continuous", "prismatic", "planar", "ball", "screw"]
SourceBase = Literal["fixed", "free", "held"]
ShapeKind = Literal["box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "mesh"]
Sizes = Vector | tuple[float, float] | tuple[float]
Raw = tuple[tuple[str, str], ...]
"""Attributes that documents cannot express, with their values as text, for the simulator of the source."""
SOURCE_MODE = "source"
"""Name of the mode that corresponds to the source."""
FAR = 1000.0
"""Limit [m] of a slide that has no limits in the source. Documents require a limit."""


class SourceThing(FrozenStruct):
    """A named element of an imported robot, and its location in the source file."""

    name: str
    where: Span


class Weight(FrozenStruct):
    """The mass properties of a link, in the frame of the link, and their location in the source file."""

    properties: MassProperties
    where: Span


class SourceShape(FrozenStruct):
    """A visual or collision shape of an imported link.

    Attributes:
        size: The dimensions [m], depending on `kind`: the sides of a box, the radius of a sphere, the radius and the length along z of a
            cylinder or capsule, the half axes of an ellipsoid, the two sides of a plane, or the scale factors of a mesh.
        pose: The pose in the link. `rpy` [rad] are the angles of this pose in the source, if specified.
        mesh: The URI in the source.
        color: Red, green, blue and alpha from 0 to 1.
        friction: The specified coefficients, in the order sliding, torsional, rolling.
        raw: Other attributes of collision shapes.
        name: The name in the source, if any.
    """

    kind: ShapeKind
    use: Literal["visual", "collision"]
    size: Sizes
    pose: Pose
    where: Span
    rpy: Vector | None = None
    mesh: str | None = None
    color: tuple[float, float, float, float] | None = None
    friction: tuple[float, ...] = ()
    raw: Raw = ()
    name: str | None = None


class SourceSite(SourceThing):
    """A named frame on a link, such as a MuJoCo site. `others` are alternative names of the same frame in the source."""

    pose: Pose
    others: tuple[str, ...] = ()


class SourceLink(OneLineRepr, SourceThing):
    """A link of an imported robot, which is a rigid body. It is massless if `weight` is None.

    `frames` are additional names in the source of the frame of the link.
    """

    weight: Weight | None = None
    shapes: tuple[SourceShape, ...] = ()
    sites: tuple[SourceSite, ...] = ()
    frames: tuple[str, ...] = ()
    raw: Raw = ()

    @property
    def is_bare(self) -> bool:
        """Whether the link has no mass, no shapes and no named frames."""
        return not (self.weight or self.shapes or self.sites)


class SourceLimits(FrozenStruct):
    """The limits of a joint or tendon: position [rad or m], effort [N m or N] and velocity [rad/s or m/s]. None means not specified.

    For a ball joint, `upper` is the maximum angle of its cone. If `made_up` is true, the source has no limits, and the reader added limits
    to the slide.
    """

    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None
    made_up: bool = False

    def nearest(self, value: float) -> float:
        """Return the joint position within the limits that is nearest to the given position."""
        return min(max(value, -math.inf if self.lower is None else self.lower), math.inf if self.upper is None else self.upper)


class SourceMimic(FrozenStruct):
    """The coupling of a joint to another joint: its coordinate q is `multiplier * q(joint) + offset`, or the value of `polynomial` at
    q(joint).

    The coefficients of the polynomial start with the constant term. Their units are derived from rad and m. `name` is the name of the
    equality in MJCF.
    """

    joint: str
    multiplier: float
    offset: float
    where: Span
    polynomial: tuple[float, ...] = ()
    raw: Raw = ()
    name: str = ""

    def at(self, q: float) -> float:
        """Return the coordinate q of the coupled joint when the other joint has the coordinate `q`."""
        at = 0.0
        for one in reversed(self.polynomial or (self.offset, self.multiplier)):
            at = at * q + one
        return at


class SourceDrive(SourceThing):
    """The drive (motor) of a joint or tendon.

    It has gains [N m/rad or N/m, N m s/rad or N s/m], a maximum effort [N m or N] and a maximum velocity [rad/s or m/s].
    """

    kind: Literal["motor", "position", "velocity"]
    kp: float | None = None
    kv: float | None = None
    effort: float | None = None
    velocity: float | None = None
    raw: Raw = ()


class SourceMotion(OneLineRepr, SourceThing):
    """The dynamic properties of a joint or tendon. They refer to the coordinate q of the joint, or to the length of the tendon.

    The properties are limits, drive, `damping` [N m s/rad or N s/m], `friction` [N m or N], `armature` [kg m^2 or kg], and the `stiffness`
    [N m/rad or N/m] of a spring that is relaxed at `rest` [rad or m].
    """

    ends: SourceLimits = SourceLimits()
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    drive: SourceDrive | None = None
    raw: Raw = ()


class SourceJoint(SourceMotion):
    """A joint that moves a link about or along the unit vector `axis` through the point `anchor` [m].

    The axis and the point are in the frame of the link at q = `start`. If `start` [rad or m] is within the limits, the robot starts at q =
    `start`, else at q = `begin` (None: the middle of the limits). `lead` is the travel of a screw joint per turn [m].
    """

    kind: Kind
    axis: Vector
    anchor: Vector = (0.0, 0.0, 0.0)
    start: float = 0.0
    begin: float | None = None
    follows: SourceMimic | None = None
    lead: float = 0.0


class SourceAround(FrozenStruct):
    """A shape that a tendon wraps around: a sphere or an infinite cylinder along z.

    Its `radius` is in metres, and its `pose` is in the frame of `link`. If `side` is given, the tendon passes the shape on the side of this
    site, else along the shorter path. `name` is the name of the shape.
    """

    name: str
    link: str
    kind: Literal["sphere", "cylinder"]
    pose: Pose
    radius: float
    side: str | None = None


class SourceStep(FrozenStruct):
    """One step of the path of a tendon: a `site`, a shape that the tendon wraps `around`, or a pulley.

    The `divisor` of a pulley applies to the steps that follow it.
    """

    site: str | None = None
    around: SourceAround | None = None
    divisor: float | None = None


class SourceTendon(SourceMotion):
    """A tendon of an imported robot. A tendon either couples joints (`moves`) or runs along a path (`steps`).

    The length of a tendon that couples joints is the sum of the joint coordinates q, each multiplied by a factor. If `turns` is true, this
    length is an angle. `width` is the diameter of the tendon [m].
    """

    moves: tuple[tuple[str, float], ...] = ()
    turns: bool = False
    steps: tuple[SourceStep, ...] = ()
    width: float | None = None


class Attachment(SourceThing):
    """The attachment of the link `child` to the link `parent` by a sequence of joints.

    `pose` is the pose of the child when all joints are at `start`. `name` is the name in the source, and `rpy` [rad] are the angles of the
    pose in the source, if specified. If `floating` is true, the child can move freely, and the parent must be the world.
    """

    parent: str
    child: str
    pose: Pose
    rpy: Vector | None = None
    joints: tuple[SourceJoint, ...] = ()
    floating: bool = False

    def turned(self) -> Attachment:
        """Return the same attachment with parent and child exchanged.

        The joint coordinate q keeps its meaning. The attachment must have at most one joint.
        """
        joints = tuple(
            replace(
                joint, anchor=self.pose.apply(joint.anchor),
                axis=rotate(self.pose.rotation, (0.0 - joint.axis[0], 0.0 - joint.axis[1], 0.0 - joint.axis[2])),
            ) for joint in self.joints
        )
        return replace(self, parent=self.child, child=self.parent, pose=self.pose.inverse(), rpy=None, joints=joints)


class SourceLoop(SourceThing):
    """A constraint that closes a kinematic loop.

    It connects two points, frames or z axes on two links, each given in the frame of its link. `equality` is the name of the equality
    constraint in MJCF, if any.
    """

    kind: Literal["ball", "fixed", "continuous", "prismatic", "screw"]
    ends: tuple[tuple[str, Pose], tuple[str, Pose]]
    raw: Raw = ()
    equality: str = ""


class SourceAdhesion(SourceThing):
    """An adhesion of a link, which pulls the link towards a surface that it touches. The maximum force is `force` [N]."""

    link: str
    force: float
    raw: Raw = ()


class SourceTarget(FrozenStruct):
    """A reference to an element of the imported robot, such as a joint or a site, by the name of the element in the source."""

    kind: Literal["joint", "site", "tendon", "body", "geom", "actuator"]
    name: str


class SourceAdded(SourceThing):
    """A MuJoCo element that is copied to the generated MuJoCo model, because documents cannot express it.

    It has a section, a tag, a `name` and XML attributes.
    """

    section: Literal["contact", "equality", "actuator", "sensor"]
    tag: str
    attributes: tuple[tuple[str, str | SourceTarget], ...]


class SourceSensor(SourceThing):
    """A sensor at a `site`, of a `joint` or of a `tendon`, or a camera at `pose` in the frame of `link`.

    `seen_from` is the reference site. `fovy` is the vertical field of view of a camera [rad]. `volume` is a shape and its size, as in
    `SourceShape`. `noise` and `cutoff` map readings to values in SI units. `parts` are pairs of a sensor in the source and the reading that
    this sensor provides.
    """

    kind: SensorType
    site: str | None = None
    seen_from: str | None = None
    joint: str | None = None
    tendon: str | None = None
    link: str | None = None
    pose: Pose = NO_POSE
    fovy: float = 0.0
    volume: tuple[ShapeKind, Sizes] | None = None
    noise: Mapping[str, float] = {}
    cutoff: Mapping[str, float] = {}
    parts: tuple[tuple[str, str], ...] = ()


class SourcePose(SourceThing):
    """A named state of an imported robot.

    It maps joints to coordinates q, and drives and adhesions to controls, by their names in the source. The unit of q is rad or m, and q of
    a ball joint is a unit quaternion (w, x, y, z). `at` is the pose of the base if this pose differs from the pose of the robot.
    """

    q: Mapping[str, float | Quaternion]
    controls: Mapping[str, float]
    at: Pose | None = None


class SourceLoss(FrozenStruct):
    """Information in the source that the import could not represent.

    `what` describes the part of the source that is lost, and `why` is the reason.
    """

    what: str
    why: str
    where: Span


class SourceRobot(OneLineRepr, SourceThing):
    """An imported robot. Its link `root` is at `pose` in the world. `links` and the attachments `hangings` are in source order.

    Attributes:
        excluded: Pairs of links that never touch.
        gravity: The gravitational acceleration [m/s^2], or None for 9.81 downwards.
        simulation: The options that documents support.
        options: MuJoCo's other options, by path.
        added: Elements for the MuJoCo model only.
        order: The names of actuators and sensors, in source order.
        free_joint: The name of the joint of a free base.
        files: Meshes that have no file in the source, by the URI in their shapes.
        mesh_folder: A further folder of meshes, relative to the file.
    """

    root: str
    links: tuple[SourceLink, ...]
    hangings: tuple[Attachment, ...]
    base: SourceBase = "fixed"
    pose: Pose = NO_POSE
    losses: tuple[SourceLoss, ...] = ()
    loops: tuple[SourceLoop, ...] = ()
    adhesions: tuple[SourceAdhesion, ...] = ()
    tendons: tuple[SourceTendon, ...] = ()
    sensors: tuple[SourceSensor, ...] = ()
    added: tuple[SourceAdded, ...] = ()
    order: Mapping[str, Sequence[str]] = {}
    free_joint: str = ""
    poses: tuple[SourcePose, ...] = ()
    excluded: tuple[tuple[str, str], ...] = ()
    gravity: Vector | None = None
    simulation: tuple[tuple[str, float | str], ...] = ()
    options: tuple[tuple[tuple[str, ...], str], ...] = ()
    files: Mapping[str, bytes] = {}
    mesh_folder: str | None = None

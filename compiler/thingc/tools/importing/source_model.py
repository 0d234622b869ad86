"""The source model, which represents an imported robot independently of its file format, in SI units and with source locations.

The readers of the file formats return a source model, and the writer converts the source model to a document. A link is a rigid body. An
`Attachment` attaches a link to its parent by a sequence of joints. For a fixed link, this sequence is empty. In URDF, the sequence has at
most one joint. In MJCF, the sequence can have several joints. The source model contains the default values of the file format explicitly.
All names are names in the source file.
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

Kind = Literal["revolute", "continuous", "prismatic", "planar", "ball", "screw", "free"]
SourceBase = Literal["fixed", "free", "held"]
ShapeKind = Literal["box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "mesh"]
Raw = tuple[tuple[str, str], ...]
"""Names and values of XML attributes that documents cannot express, and that are written only to models for the simulator of the source."""
SOURCE_MODE = "source"
"""Name of the mode with the root and the base of the source."""
FAR = 1000.0
"""Limit [m] of a prismatic joint without limits in the source, because documents require limits."""


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
        size: The size [m] of a `Primitive`, such as the half sides of a box, or the scale factors of a mesh.
        pose: The pose in the link. `rpy` [rad] are the angles of this pose in the source, if specified.
        mesh: The URI of the mesh in the source.
        color: Red, green, blue and alpha from 0 to 1.
        friction: The specified coefficients of sliding, torsional and rolling friction, in this order.
        raw: Further MuJoCo attributes of a collision shape.
        name: The name in the source, if any.
    """

    kind: ShapeKind
    use: Literal["visual", "collision"]
    size: tuple[float, ...]
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
    """A link of an imported robot, which is a rigid body. A link without `weight` is massless.

    `frames` are further source names for the frame of the link.
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
    """The limits of a joint or tendon: position [rad or m], effort [N m or N] and velocity [rad/s or m/s].

    A limit that is not specified is None. For a ball joint, `upper` is the maximum angle of its cone. If `made_up` is true, the source has
    no limits, and the reader added the limits of a prismatic joint.
    """

    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None
    made_up: bool = False

    def nearest(self, value: float) -> float:
        """Return the joint coordinate within the limits that is nearest to the given value."""
        return min(max(value, -math.inf if self.lower is None else self.lower), math.inf if self.upper is None else self.upper)


class SourceMimic(FrozenStruct):
    """The coupling of a joint to another joint `joint`.

    The coordinate of the coupled joint is a polynomial in q(joint), with at least two `coefficients` in units of rad and m. The constant
    term is the first coefficient. `name` is the name of the equality in MJCF.
    """

    joint: str
    coefficients: tuple[float, ...]
    where: Span
    raw: Raw = ()
    name: str = ""

    def at(self, q: float) -> float:
        """Return the coordinate of the coupled joint for the coordinate `q` of the other joint."""
        at = 0.0
        for coefficient in reversed(self.coefficients):
            at = at * q + coefficient
        return at


class SourceDrive(SourceThing):
    """The drive (motor) of a joint or tendon.

    A drive has gains [N m/rad or N/m, N m s/rad or N s/m], a maximum effort [N m or N] and a maximum velocity [rad/s or m/s]. `stall` has
    the unit of the effort, `delay` is in [s], and `deadband` and `noise` have the unit of the command.
    """

    kind: Literal["motor", "position", "velocity"]
    kp: float | None = None
    kv: float | None = None
    effort: float | None = None
    velocity: float | None = None
    stall: float | None = None
    delay: float | None = None
    deadband: float | None = None
    noise: float | None = None
    raw: Raw = ()


class SourceMotion(OneLineRepr, SourceThing):
    """The dynamic properties of a joint or tendon. All values refer to the coordinate q of the joint, or to the length of the tendon.

    `damping` is in [N m s/rad or N s/m], `friction` in [N m or N], and `armature` in [kg m^2 or kg]. A spring with `stiffness` [N m/rad or
    N/m] is relaxed at `rest` [rad or m].
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

    The axis and the point are in the frame of the link at q = `start`. The robot starts at q = `start` [rad or m]. If `start` is outside
    the limits, the robot starts at `begin`, or in the middle of the limits if `begin` is None. `lead` is the travel of a screw joint per
    turn [m].
    """

    kind: Kind
    axis: Vector
    anchor: Vector = (0.0, 0.0, 0.0)
    start: float = 0.0
    begin: float | None = None
    follows: SourceMimic | None = None
    lead: float = 0.0


class SourceAround(FrozenStruct):
    """A shape around which a tendon wraps: a sphere or an infinite cylinder along z.

    `radius` is in metres, and `pose` is relative to the frame of `link`. If the site `side` is given, the tendon passes the shape on the
    side of this site. Without `side`, the tendon follows the shorter path.
    """

    name: str
    link: str
    kind: Literal["sphere", "cylinder"]
    pose: Pose
    radius: float
    side: str | None = None


class SourceStep(FrozenStruct):
    """One step of the path of a tendon: a `site`, a shape that the tendon wraps `around`, or a pulley.

    The `divisor` of a pulley applies to the following steps.
    """

    site: str | None = None
    around: SourceAround | None = None
    divisor: float | None = None


class SourceTendon(SourceMotion):
    """A tendon of an imported robot. A tendon either couples joints (`moves`) or runs along a path (`steps`).

    If a tendon couples joints, its length is a linear combination of the joint coordinates q. If `turns` is true, this length is an angle.
    `width` is the diameter of the tendon [m].
    """

    moves: tuple[tuple[str, float], ...] = ()
    turns: bool = False
    steps: tuple[SourceStep, ...] = ()
    width: float | None = None


class Attachment(SourceThing):
    """The attachment of the link `child` to the link `parent` by a sequence of joints.

    `pose` is the pose of the child with all joints at `start`. `name` is the name in the source, and `rpy` [rad] are the angles of the pose
    in the source, if specified. If `floating` is true, the child can move freely, by a free joint unless the parent is the world.
    `ends` contains the locations of the names `parent` and `child` in the source, if known.
    """

    parent: str
    child: str
    pose: Pose
    rpy: Vector | None = None
    joints: tuple[SourceJoint, ...] = ()
    floating: bool = False
    ends: Mapping[str, Span] = {}

    def reverse(self) -> Attachment:
        """Return the same attachment with parent and child exchanged.

        The value of the joint coordinate q does not change. The attachment must have at most one joint.
        """
        joints = tuple(
            replace(
                joint, anchor=self.pose.apply(joint.anchor),
                axis=rotate(self.pose.rotation, (0.0 - joint.axis[0], 0.0 - joint.axis[1], 0.0 - joint.axis[2])),
            ) for joint in self.joints
        )
        return replace(self, parent=self.child, child=self.parent, pose=self.pose.inverse(), rpy=None, joints=joints)


class SourceLoop(SourceThing):
    """A constraint that closes a kinematic loop. The constraint connects two points, frames or z axes on two links.

    `ends` contains both links and the poses in their frames. `equality` is the name of the equality constraint in MJCF, if any.
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


class SourceTransmission(SourceThing):
    """A transmission between actuators and joints.

    Each row of the `matrix` contains the motion of an actuator per motion of each joint. For one joint, its only entry is the ratio.
    """

    joints: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


class SourceTarget(FrozenStruct):
    """A reference to an element of the imported robot, such as a joint or a site, by the name of the element in the source."""

    kind: Literal["joint", "site", "tendon", "body", "geom", "actuator"]
    name: str


class SourceAdded(SourceThing):
    """A MuJoCo element that is copied to the generated MuJoCo model, because documents cannot express it.

    The element has a section of the model, a tag, a `name` and XML attributes.
    """

    section: Literal["contact", "equality", "actuator", "sensor"]
    tag: str
    attributes: tuple[tuple[str, str | SourceTarget], ...]


class SourceSensor(SourceThing):
    """A sensor at a `site`, of a `joint` or of a `tendon`, or a camera at `pose` in the frame of `link`.

    `seen_from` is the reference site. `fovy` is the vertical field of view of a camera [rad]. `volume` is the kind and size of a shape, as
    in `SourceShape`. `noise` and `cutoff` map readings to values in SI units. `parts` contains pairs of a sensor name in the source and the
    reading of this sensor.
    """

    kind: SensorType
    site: str | None = None
    seen_from: str | None = None
    joint: str | None = None
    tendon: str | None = None
    link: str | None = None
    pose: Pose = NO_POSE
    fovy: float = 0.0
    volume: tuple[ShapeKind, tuple[float, ...]] | None = None
    noise: Mapping[str, float] = {}
    cutoff: Mapping[str, float] = {}
    parts: tuple[tuple[str, str], ...] = ()


class SourcePose(SourceThing):
    """A named state of an imported robot.

    `q` maps the source names of joints to coordinates [rad or m], to a unit quaternion (w, x, y, z) for a ball joint, or to the motion of a
    free joint from its initial pose. `controls` maps the source names of actuators to control values. `at` is the pose of the base if it
    differs from the pose of the robot.
    """

    q: Mapping[str, float | Quaternion | Pose]
    controls: Mapping[str, float]
    at: Pose | None = None


class SourceLoss(FrozenStruct):
    """Information in the source that the import could not represent. `what` describes the lost information, and `why` is the reason."""

    what: str
    why: str
    where: Span


class SourceRobot(OneLineRepr, SourceThing):
    """An imported robot. The link `root` has the pose `pose` in the world. `links` and `attachments` are in source order.

    Attributes:
        excluded: Pairs of links between which contacts are excluded.
        gravity: The gravitational acceleration [m/s^2], or None for 9.81 downwards.
        simulation: The simulation options that documents support.
        options: Further MuJoCo options, by path.
        added: Elements that are added only to the MuJoCo model.
        order: The names of actuators and sensors, in source order.
        free_joint: The name of the free joint of a free base.
        files: The contents of mesh files that do not exist in the source, by URI.
        mesh_folder: A further folder with meshes, relative to the folder of the source file.
    """

    root: str
    links: tuple[SourceLink, ...]
    attachments: tuple[Attachment, ...]
    base: SourceBase = "fixed"
    pose: Pose = NO_POSE
    losses: tuple[SourceLoss, ...] = ()
    loops: tuple[SourceLoop, ...] = ()
    adhesions: tuple[SourceAdhesion, ...] = ()
    tendons: tuple[SourceTendon, ...] = ()
    transmissions: tuple[SourceTransmission, ...] = ()
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

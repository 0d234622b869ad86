"""The source model: an imported robot as all readers return it and the writer needs it, in SI units, with source locations.

A link is a rigid body. An `Attachment` attaches it to its parent by a sequence of joints: none if it is fixed; at most one in URDF, several
in MJCF. Defaults of the format are resolved, and names are those of the source.
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
"""Attributes of the simulator of the source that documents cannot express, with their values as text."""
SOURCE_MODE = "source"
"""Name of the mode in which an imported robot is as in the source."""
FAR = 1000.0
"""Limit [m] for a slide without limits, since documents require one."""


class SourceThing(FrozenStruct):
    """An element with a name and a location in the source."""

    name: str
    where: Span


class Weight(FrozenStruct):
    """The mass properties of a link, in its frame, with their location."""

    properties: MassProperties
    where: Span


class SourceShape(FrozenStruct):
    """A visual or collision shape.

    `size` depends on the kind [m]: the three sides of a box, radius of a sphere, radius and length along z of a cylinder or capsule, half
    axes of an ellipsoid, the two sides of a plane, the scale of a mesh. `pose` is in the link; `rpy` [rad] are its angles as stated in the
    source. `mesh` is the URI in the source; `color` is red, green, blue and alpha from 0 to 1; `friction` is sliding, torsional and
    rolling, as far as stated; only collision shapes have `raw`. `name` is its name in the source, if any.
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
    """A named frame on a link; `others` are further names of it."""

    pose: Pose
    others: tuple[str, ...] = ()


class SourceLink(OneLineRepr, SourceThing):
    """A rigid body, massless if `weight` is None. `frames` are names of its frame in the source besides its own."""

    weight: Weight | None = None
    shapes: tuple[SourceShape, ...] = ()
    sites: tuple[SourceSite, ...] = ()
    frames: tuple[str, ...] = ()
    raw: Raw = ()

    @property
    def is_bare(self) -> bool:
        """Whether it has no mass, shapes and named frames."""
        return not (self.weight or self.shapes or self.sites)


class SourceLimits(FrozenStruct):
    """The limits of a joint or tendon: position [rad or m], effort [N m or N] and velocity [rad/s or m/s]; None if not stated.

    For a ball, `upper` is its cone. `made_up` are the limits of a slide that has none.
    """

    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None
    made_up: bool = False

    def nearest(self, value: float) -> float:
        """Return the position clamped to the limits."""
        return min(max(value, -math.inf if self.lower is None else self.lower), math.inf if self.upper is None else self.upper)


class SourceMimic(FrozenStruct):
    """A joint that follows another: q is `multiplier * q(joint) + offset`, or the `polynomial` of q(joint).

    The coefficients begin with that of q^0; units are rad and m. `name` is the name of the equality in MJCF.
    """

    joint: str
    multiplier: float
    offset: float
    where: Span
    polynomial: tuple[float, ...] = ()
    raw: Raw = ()
    name: str = ""

    def at(self, q: float) -> float:
        """Return q if the other joint is at `q`."""
        at = 0.0
        for one in reversed(self.polynomial or (self.offset, self.multiplier)):
            at = at * q + one
        return at


class SourceDrive(SourceThing):
    """The drive of a joint or tendon: gains [N m/rad or N/m, N m s/rad or N s/m] and the maximum effort [N m or N] and velocity [rad/s or
    m/s].
    """

    kind: Literal["motor", "position", "velocity"]
    kp: float | None = None
    kv: float | None = None
    effort: float | None = None
    velocity: float | None = None
    raw: Raw = ()


class SourceMotion(OneLineRepr, SourceThing):
    """The properties of q of a joint, or of the length of a tendon.

    Limits, drive, `damping` [N m s/rad or N s/m], `friction` [N m or N], `armature` [kg m^2 or kg], and the `stiffness` [N m/rad or N/m] of
    a spring, relaxed at `rest` [rad or m].
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
    """A motion of a link about or along the unit vector `axis` through `anchor` [m], both in the frame of the link at q = `start`.

    The robot starts at q = `start` [rad or m], or at `begin` if that is outside of the limits (None: in their middle). `lead` is the travel
    of a screw per turn [m].
    """

    kind: Kind
    axis: Vector
    anchor: Vector = (0.0, 0.0, 0.0)
    start: float = 0.0
    begin: float | None = None
    follows: SourceMimic | None = None
    lead: float = 0.0


class SourceAround(FrozenStruct):
    """A shape that a tendon wraps around: a sphere, or an infinite cylinder along z, of `radius` [m] at `pose` in `link`.

    The tendon passes on the side of the site `side`, else the shorter way. `name` is the name of the shape.
    """

    name: str
    link: str
    kind: Literal["sphere", "cylinder"]
    pose: Pose
    radius: float
    side: str | None = None


class SourceStep(FrozenStruct):
    """A step of the path of a tendon, exactly one of: a `site`, a shape that it goes `around`, or a pulley with the `divisor` of the rest.
    """

    site: str | None = None
    around: SourceAround | None = None
    divisor: float | None = None


class SourceTendon(SourceMotion):
    """A tendon. Its length is the sum of q times these factors for joints (`moves`; an angle if it `turns`), or that of a path with
    `steps`.

    `width` [m] is its diameter.
    """

    moves: tuple[tuple[str, float], ...] = ()
    turns: bool = False
    steps: tuple[SourceStep, ...] = ()
    width: float | None = None


class Attachment(SourceThing):
    """The attachment of the link `child` to the link `parent`: at `pose` in it when joints are at `start`, moved by them in sequence.

    `name` is the name in the source; `rpy` [rad] are the angles of the pose as stated there, if they are. A `floating` child is not
    attached; only the world may be its parent.
    """

    parent: str
    child: str
    pose: Pose
    rpy: Vector | None = None
    joints: tuple[SourceJoint, ...] = ()
    floating: bool = False

    def turned(self) -> Attachment:
        """Return the reversed attachment, with the same q. It may have at most one joint."""
        joints = tuple(
            replace(
                joint, anchor=self.pose.apply(joint.anchor),
                axis=rotate(self.pose.rotation, (0.0 - joint.axis[0], 0.0 - joint.axis[1], 0.0 - joint.axis[2])),
            ) for joint in self.joints
        )
        return replace(self, parent=self.child, child=self.parent, pose=self.pose.inverse(), rpy=None, joints=joints)


class SourceLoop(SourceThing):
    """A constraint between points, frames or axes (z) of two links, each given in its link.

    `equality` is its name in MJCF, if any.
    """

    kind: Literal["ball", "fixed", "continuous", "prismatic", "screw"]
    ends: tuple[tuple[str, Pose], tuple[str, Pose]]
    raw: Raw = ()
    equality: str = ""


class SourceAdhesion(SourceThing):
    """An adhesion, which pulls a link onto the touched surface with at most `force` [N]."""

    link: str
    force: float
    raw: Raw = ()


class SourceTarget(FrozenStruct):
    """A reference to an element by its name in the source."""

    kind: Literal["joint", "site", "tendon", "body", "geom", "actuator"]
    name: str


class SourceAdded(SourceThing):
    """An element to add to the MuJoCo model, which documents cannot express: its section, tag, `name` and attributes."""

    section: Literal["contact", "equality", "actuator", "sensor"]
    tag: str
    attributes: tuple[tuple[str, str | SourceTarget], ...]


class SourceSensor(SourceThing):
    """A sensor at a `site` (seen from another, `seen_from`), of a `joint` or `tendon`, or a camera at `pose` in `link`.

    `fovy` is the vertical field of view [rad]; `volume` is a shape and its size, as in `SourceShape`; `noise` and `cutoff` are by reading
    [SI]; `parts` are pairs of a sensor of the source and the reading that it is.
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
    """A named state: q of joints [rad or m; unit quaternion w, x, y, z for a ball], and controls of drives and adhesions.

    Both are by name in the source. `at` is the pose of the base if it is not that of the robot.
    """

    q: Mapping[str, float | Quaternion]
    controls: Mapping[str, float]
    at: Pose | None = None


class SourceLoss(FrozenStruct):
    """A loss. `what` describes the part of the source that the document does not contain, and `why` gives the reason."""

    what: str
    why: str
    where: Span


class SourceRobot(OneLineRepr, SourceThing):
    """An imported robot, with its link `root` at `pose` in the world. `links` and `hangings` are in source order.

    `excluded` are pairs of links that never touch. `gravity` [m/s^2] is None for 9.81 downwards. `simulation` are the options that
    documents support; `options` are others of MuJoCo, by path; `added` are whole elements. `order` lists the names of actuators and sensors
    in source order; `free_joint` is the name of the joint of a free base. `files` are meshes without a file of their own, by the URIs in
    shapes; `mesh_folder` is a further folder of meshes, relative to the file.
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

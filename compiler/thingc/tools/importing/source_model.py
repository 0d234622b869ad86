"""A robot as another format has it: what every reader gives, and all that the writer knows. SI; each thing with its place in the source.

A link is a rigid body; how it hangs on another is a `Attachment`, with the joints between them one after the other, none of a body that is
fixed (URDF has at most one, MJCF several). Defaults of the format are resolved, angles are radians, names are the source's own.
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
"""Attributes that a simulator of the source has and the language has not, with their values as they are written for it."""
SOURCE_MODE = "source"
"""The mode in which an imported robot stands as the source has it."""
FAR = 1000.0
"""Where a slide ends [m] that has no ends: the language wants some."""


class SourceThing(FrozenStruct):
    """What has a name in the source, and a place there."""

    name: str
    where: Span


class Weight(FrozenStruct):
    """What a link weighs, in its frame, and where that is said."""

    properties: MassProperties
    where: Span


class SourceShape(FrozenStruct):
    """What is drawn, or touches: `size` as its kind has it [m] (box: the three sides; sphere: radius; cylinder, capsule: radius, length
    along z; ellipsoid: half axes; plane: the two sides; of a mesh the scale), `pose` in the link, with the angles `rpy` [rad] that the
    source states it with. `mesh` is as the source names the file; `color` red, green, blue, alpha from 0 to 1; `friction` sliding,
    torsional and rolling, as many as are said; `raw` of what touches. `name` is its name in the source, if any."""

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
    """A frame on a link that has a name, and maybe `others`."""

    pose: Pose
    others: tuple[str, ...] = ()


class SourceLink(OneLineRepr, SourceThing):
    """A rigid body: it weighs nothing where `weight` is None. `frames` are names that the source has for its frame, besides its own."""

    weight: Weight | None = None
    shapes: tuple[SourceShape, ...] = ()
    sites: tuple[SourceSite, ...] = ()
    frames: tuple[str, ...] = ()
    raw: Raw = ()

    @property
    def is_bare(self) -> bool:
        """Whether it weighs nothing, shows nothing and has no frame of a name."""
        return not (self.weight or self.shapes or self.sites)


class SourceLimits(FrozenStruct):
    """Where a joint stops [rad or m], and what it is driven with at most [N m or N, rad/s or m/s]; None where nothing is said. Of a ball
    `upper` is its cone. Those of a slide that has none are `made_up`."""

    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None
    made_up: bool = False

    def nearest(self, value: float) -> float:
        """The value that is nearest to one of a hinge or a slide."""
        return min(max(value, -math.inf if self.lower is None else self.lower), math.inf if self.upper is None else self.upper)


class SourceMimic(FrozenStruct):
    """`name` is that of an equality.

    q is `multiplier * q(joint) + offset`, or the `polynomial` of q(joint) with these coefficients, from that of q^0 on, all in rad and
    m."""

    joint: str
    multiplier: float
    offset: float
    where: Span
    polynomial: tuple[float, ...] = ()
    raw: Raw = ()
    name: str = ""

    def at(self, q: float) -> float:
        """Where it is when the other joint is at `q`."""
        at = 0.0
        for one in reversed(self.polynomial or (self.offset, self.multiplier)):
            at = at * q + one
        return at


class SourceDrive(SourceThing):
    """What drives a joint or a tendon, by the `name` that it has in the source: gains [N m/rad or N/m, N m s/rad or N s/m] and the largest
    effort [N m or N] as they are there."""

    kind: Literal["motor", "position", "velocity"]
    kp: float | None = None
    kv: float | None = None
    effort: float | None = None
    velocity: float | None = None
    raw: Raw = ()


class SourceMotion(OneLineRepr, SourceThing):
    """What acts along q of a joint, or along the length of a tendon: its ends and drive, `damping` [N m s/rad or N s/m], `friction` [N m or
    N], `armature` [kg m^2 or kg], and `stiffness` [N m/rad or N/m] of a spring that does nothing at `rest` [rad or m]."""

    ends: SourceLimits = SourceLimits()
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    drive: SourceDrive | None = None
    raw: Raw = ()


class SourceJoint(SourceMotion):
    """A motion of a link: about, or along, the unit vector `axis` through `anchor` [m], both in the frame of the link as it hangs, where q
    is `start` [rad or m], or `begin` if that is beyond its ends (None: the middle of these). A screw goes by `lead` [m] in one turn."""

    kind: Kind
    axis: Vector
    anchor: Vector = (0.0, 0.0, 0.0)
    start: float = 0.0
    begin: float | None = None
    follows: SourceMimic | None = None
    lead: float = 0.0


class SourceAround(FrozenStruct):
    """What a tendon goes around: a sphere, or a cylinder without ends, of that `radius` [m], about the `pose` in a `link`, z its axis. By
    the site `side` it goes, else the shorter way; `name` is that of the shape."""

    name: str
    link: str
    kind: Literal["sphere", "cylinder"]
    pose: Pose
    radius: float
    side: str | None = None


class SourceStep(FrozenStruct):
    """Of a path exactly one of these: a `site` that it goes through, a shape that it goes `around`, or a pulley, the `divisor` of what
    follows."""

    site: str | None = None
    around: SourceAround | None = None
    divisor: float | None = None


class SourceTendon(SourceMotion):
    """A length: of one over joints the sum of these factors times their q, an angle if it `turns`; of one with `steps` that of the path,
    `width` [m] how thick it is."""

    moves: tuple[tuple[str, float], ...] = ()
    turns: bool = False
    steps: tuple[SourceStep, ...] = ()
    width: float | None = None


class Attachment(SourceThing):
    """How the link `child` hangs on the link `parent`: at `pose` in it at q = 0, moved by the joints one after the other. `name` is what
    the source calls it; `rpy` [rad] are the angles that it states the pose with, if it does; `floating` where nothing holds the two
    together, which the world alone may be a parent of."""

    parent: str
    child: str
    pose: Pose
    rpy: Vector | None = None
    joints: tuple[SourceJoint, ...] = ()
    floating: bool = False

    def turned(self) -> Attachment:
        """The same, of at most one joint, with the parent hung on the child: q means what it did."""
        joints = tuple(
            replace(
                joint, anchor=self.pose.apply(joint.anchor),
                axis=rotate(self.pose.rotation, (0.0 - joint.axis[0], 0.0 - joint.axis[1], 0.0 - joint.axis[2])),
            ) for joint in self.joints
        )
        return replace(self, parent=self.child, child=self.parent, pose=self.pose.inverse(), rpy=None, joints=joints)


class SourceLoop(SourceThing):
    """What keeps a point, a frame, or an axis (z) of two links together, each given in its link; `equality` is its name in MJCF, if any."""

    kind: Literal["ball", "fixed", "continuous", "prismatic", "screw"]
    ends: tuple[tuple[str, Pose], tuple[str, Pose]]
    raw: Raw = ()
    equality: str = ""


class SourceAdhesion(SourceThing):
    """What can pull a link onto what it touches, with a force [N] at most."""

    link: str
    force: float
    raw: Raw = ()


class SourceTarget(FrozenStruct):
    """A thing of the robot, by its name in the source."""

    kind: Literal["joint", "site", "tendon", "body", "geom", "actuator"]
    name: str


class SourceAdded(SourceThing):
    """An element of MuJoCo's that the language has no words for: the section that it stands in, its tag, `name` and attributes."""

    section: Literal["contact", "equality", "actuator", "sensor"]
    tag: str
    attributes: tuple[tuple[str, str | SourceTarget], ...]


class SourceSensor(SourceThing):
    """What is measured at a `site`, `seen_from` another, or of a `joint` or a `tendon` of that name, or seen from `pose` in a `link` with
    an angle of view [rad]; `volume` is a shape and its size, as a `SourceShape` has it; `noise` and `cutoff` are by reading [SI]; `parts`
    says for each sensor of the source which reading of it it is."""

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
    """A state that has a name: q of joints [rad or m, of a ball the unit quaternion w, x, y, z], and what controls its drives and adhesions
    are at, by their names in the source; `at` is where the base is, if not where the robot stands."""

    q: Mapping[str, float | Quaternion]
    controls: Mapping[str, float]
    at: Pose | None = None


class SourceLoss(FrozenStruct):
    """What a document does not say of the source: `what` it is, and `why` it is not there."""

    what: str
    why: str
    where: Span


class SourceRobot(OneLineRepr, SourceThing):
    """All that a reader has found. A robot stands with its link `root` at `pose` in the world; `links` and `hangings` are in the order of
    the source. Links that are `excluded` never touch; `gravity` [m/s^2] where it is not 9.81 downwards; `simulation` as the language has
    it, `options` as MuJoCo has what the language has not, by their paths, `added` whole elements; `order` lists the names of the actuators
    and the sensors of the source, `free_joint` is the name of that of its base, if any; `files` are meshes that the source has
    not in files of their own, by the names that shapes have for them, `mesh_folder` is where meshes are that are not where it names them,
    seen from its file."""

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

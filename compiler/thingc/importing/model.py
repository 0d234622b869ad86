"""A robot as another format has it: what every reader gives, and all that the writer knows. SI; each thing with its place in the source.

A link is a rigid body; how it hangs on another is a `Hanging`, with the joints between them one after the other, none of a body that is
fixed (URDF has at most one, MJCF several). Defaults of the format are resolved, angles are radians, names are the source's own.
"""

from __future__ import annotations

from typing import Literal

from thingc.brief import Brief
from thingc.frozen import dataclass
from thingc.inertia import MassProperties
from thingc.pose import NO_POSE, Pose, Vector
from thingc.source import Span

Kind = Literal["revolute", "continuous", "prismatic", "planar"]
SourceBase = Literal["fixed", "free"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Weight:
    """What a link weighs, in its frame, and where that is said."""

    properties: MassProperties
    where: Span


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceShape:
    """What is drawn, or touches: `size` as its kind has it [m] (box: the three sides; sphere: radius; cylinder: radius, length; of a mesh
    the scale), `pose` in the link, with the angles `rpy` [rad] that the source states it with. `mesh` is as the source names the file;
    `color` red, green, blue, alpha from 0 to 1."""

    kind: Literal["box", "sphere", "cylinder", "mesh"]
    use: Literal["visual", "collision"]
    size: Vector | tuple[float, float] | tuple[float]
    pose: Pose
    where: Span
    rpy: Vector | None = None
    mesh: str | None = None
    color: tuple[float, float, float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceLink(Brief):
    """A rigid body: it weighs nothing where `weight` is None."""

    name: str
    where: Span
    weight: Weight | None = None
    shapes: tuple[SourceShape, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Ends:
    """Where a joint stops [rad or m], and what it is driven with at most [N m or N, rad/s or m/s]; None where nothing is said."""

    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Following:
    """q is `multiplier * q(joint) + offset`, all in rad and m."""

    joint: str
    multiplier: float
    offset: float
    where: Span


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceJoint(Brief):
    """A motion of a link: about, or along, the unit vector `axis` through `anchor` [m], both in the frame of the link at q = 0. `damping`
    [N m s/rad or N s/m], `friction` [N m or N]. `driven` says that something drives it."""

    name: str
    kind: Kind
    axis: Vector
    where: Span
    anchor: Vector = (0.0, 0.0, 0.0)
    ends: Ends = Ends()
    damping: float = 0.0
    friction: float = 0.0
    follows: Following | None = None
    driven: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Hanging:
    """How the link `child` hangs on the link `parent`: at `pose` in it at q = 0, moved by the joints one after the other. `name` is what
    the source calls it; `rpy` [rad] are the angles that it states the pose with, if it does; `floating` where nothing holds the two
    together, which the world alone may be a parent of."""

    name: str
    parent: str
    child: str
    pose: Pose
    where: Span
    rpy: Vector | None = None
    joints: tuple[SourceJoint, ...] = ()
    floating: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceLoss:
    """What a document does not say of the source: `what` it is, and `why` it is not there."""

    what: str
    why: str
    where: Span


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceRobot(Brief):
    """All that a reader has found. A robot stands with its link `root` at `pose` in the world; `links` and `hangings` are in the order of
    the source."""

    name: str
    where: Span
    root: str
    links: tuple[SourceLink, ...]
    hangings: tuple[Hanging, ...]
    base: SourceBase = "fixed"
    pose: Pose = NO_POSE
    losses: tuple[SourceLoss, ...] = ()

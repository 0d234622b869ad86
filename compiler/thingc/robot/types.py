"""A robot with a root: the tree that one mode's simulation model is written from. Targets see only this."""

from __future__ import annotations

from dataclasses import dataclass

from thingc.graph.types import ActuatorModel, Assembly, LinkedMode
from thingc.pose import Pose, Vector
from thingc.resolve.model import Dynamics, Limit, Mimic
from thingc.source import Origin


@dataclass(frozen=True, slots=True, kw_only=True)
class CoreJoint:
    """A joint lowered to the core, as the tree crosses it: child link relative to its tree parent.

    `kind` is `hinge | slide`. `axis` (unit) and `anchor` [m] are in the child link's frame, the same at every q of the
    joint itself; positive q is what the document means by it, whichever way the tree crosses (`reversed`: the
    document's child is the tree's parent, and the axis has been negated for it). Motion is measured from q = 0.
    """

    path: str
    kind: str
    axis: Vector
    anchor: Vector
    reversed: bool
    offset: float
    limit: Limit
    dynamics: Dynamics
    mimic: Mimic | None
    actuator: ActuatorModel | None
    mate: int
    origin: Origin


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A link in the tree. `parent` is an index into `Robot.bodies` (None: the world); `X_PL` the pose of its frame in the
    parent link's frame at q = 0 (of the root: in the world, as the mode's `at` puts it). `joint` is None for the root."""

    link: int
    parent: int | None
    X_PL: Pose
    joint: CoreJoint | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """A named frame on a link: `path`, the body's index, and its pose in the link's frame."""

    path: str
    body: int
    pose: Pose
    origin: Origin


@dataclass(frozen=True, slots=True, kw_only=True)
class Keyframe:
    """A pose of this mode: q of every joint by path [rad or m], those that mimic included."""

    name: str
    q: dict[str, float]
    origin: Origin


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """One mode. `bodies` in depth-first order, root first, parents before children, children in document order.

    `base` is `fixed | held | free`; `excluded` pairs of body indices (neighbours through a joint, the same links in
    every mode, plus the mode's own). `adhesion` is the control in this mode per adhesion path [N] (0 where it says
    nothing). `present` are the joints whose actuators exist here, in joint order.
    """

    name: str
    mode: LinkedMode
    assembly: Assembly
    base: str
    gravity: Vector
    bodies: tuple[Body, ...]
    sites: tuple[Site, ...]
    excluded: tuple[tuple[int, int], ...]
    keyframes: tuple[Keyframe, ...]
    present: tuple[str, ...]
    adhesion: dict[str, float]

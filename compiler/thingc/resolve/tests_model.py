"""The tests of a document with names, units and expressions worked out. SI; frames are mounts (None: the mode's world)."""

from __future__ import annotations

from dataclasses import dataclass

from thingc.brief import Brief
from thingc.pose import Vector
from thingc.resolve.model import Reference
from thingc.source import Origin, Span


@dataclass(frozen=True, slots=True, kw_only=True)
class MassCheck(Brief):
    """The mass [kg] of components (none named: of the robot) within bounds."""

    of: tuple[Reference, ...]
    minimum: float | None
    maximum: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CentreCheck(Brief):
    """The centre of mass of components (none named: of the robot) in a box: `box["x"]` is (smallest, largest) [m]."""

    of: tuple[Reference, ...]
    frame: Reference | None
    box: dict[str, tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachCheck(Brief):
    """The greatest distance [m] of the mounts `of` and `base` over the ranges of all joints within bounds."""

    of: Reference
    base: Reference
    minimum: float | None
    maximum: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class PointCheck(Brief):
    """`mount` comes `within` [m] of `point` [m]; with a `direction` (a unit vector) its z is off it by at most `angle` [rad]."""

    mount: Reference
    point: Vector
    frame: Reference | None
    within: float
    direction: Vector | None
    angle: float


@dataclass(frozen=True, slots=True, kw_only=True)
class JointRange(Brief):
    """A joint (its path) to move from `lower` to `upper` [rad or m]."""

    joint: str
    lower: float
    upper: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowance(Brief):
    """A pair that may touch: every component of `one` and every component of `other`. `text` names it for people."""

    one: tuple[Reference, ...]
    other: tuple[Reference, ...]
    text: str
    reason: str
    origin: Origin


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionCheck(Brief):
    """No components of links that move against each other overlap, or are nearer than `clearance` [m]; with `ranges` at
    `samples` positions of them."""

    ranges: tuple[JointRange, ...]
    samples: int
    clearance: float
    allow: tuple[Allowance, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueCheck(Brief):
    """The effort limits of the drives of `joints` (paths) are at least `minimum` times the static effort."""

    joints: tuple[str, ...]
    minimum: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SettleCheck(Brief):
    """In simulation every point of every link is, from `within` [s] on for `hold` [s], nearer than `drift` [m] to where it ends;
    at most `moved` [m] from the pose, with contacts at most `penetration` [m] deep (None: any)."""

    within: float
    drift: float
    hold: float
    moved: float | None
    penetration: float | None
    floor: bool


Check = MassCheck | CentreCheck | ReachCheck | PointCheck | CollisionCheck | TorqueCheck | SettleCheck


@dataclass(frozen=True, slots=True, kw_only=True)
class Test(Brief):
    """A test of a document, to be run in each of its `modes` (none: it does not depend on the mode) and `poses`.

    `kind` is the key in the document. In `poses` None is where the mode starts; `every_pose` asks for all keyframes of the mode,
    and `poses` is empty then, as where the test does not depend on the pose. `spans` are the places of values in the test by
    dotted key (`within.x`), for diagnostics.
    """

    name: str
    kind: str
    check: Check
    modes: tuple[str, ...]
    poses: tuple[str | None, ...]
    every_pose: bool
    origin: Origin
    spans: dict[str, Span]

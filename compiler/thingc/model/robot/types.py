"""A robot with a root: the tree that one mode's simulation model is written from. Targets see only this."""

from __future__ import annotations

from typing import Literal

from thingc.base import numeric
from thingc.base.export_names import JointPath, PoseName, SitePath
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.kinds import BaseType
from thingc.base.joints.twist import Twist
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.pose import Pose, Vector
from thingc.base.source import Origin
from thingc.model.assembly.types import Assembly, JointEdge, LinkedMode


class TreeJoint(JointEdge):
    """A coordinate of a joint as the tree crosses it: child link relative to its tree parent.

    `twist` is in the child link's frame with the coordinates after it in the body at 0, the same at every q of its own and of those
    before it; positive q is what the document means by it, whichever way the tree crosses (`reversed`: the document's child is the
    tree's parent, and the twist has been negated for it). Motion is measured from q = 0.
    """

    reversed: bool
    mate: int


class Body(OneLineRepr, FrozenStruct):
    """A link in the tree. `parent` is an index into `Robot.bodies` (None: the world); `X_PL` the pose of its frame in the
    parent link's frame at q = 0 (of the root: in the world, as the mode's `at` puts it). It moves in it by its `joints`, one after
    the other, `X_PL @ exp(twist_0 q_0) @ exp(twist_1 q_1) ...`, or those of a ball at once; the root has none."""

    link: int
    parent: int | None
    X_PL: Pose
    joints: tuple[TreeJoint, ...]

    @property
    def twists(self) -> tuple[Twist, ...]:
        """Those of its coordinates."""
        return tuple(joint.twist for joint in self.joints)

    @property
    def at_once(self) -> bool:
        """Whether it turns on a ball."""
        return bool(self.joints) and self.joints[0].kind.at_once


class Site(OneLineRepr, FrozenStruct):
    """A named frame on a link: `path`, the body's index, and its pose in the link's frame."""

    path: SitePath
    body: int
    pose: Pose
    origin: Origin


ClosureKind = Literal["weld", "ball", "hinge", "slide", "screw", "universal", "several"]
"""What a loop leaves open where it is cut: nothing, turns about a point, one turn, one slide, a screw, turns about two axes that meet at
right angles, or several coordinates."""


class Closure(OneLineRepr, FrozenStruct):
    """A loop that the tree leaves open: body `parent` (None: the world) and body `child` meet. With A a frame on the parent and
    B one on the child, it is closed where

        X_W,parent @ X_PA @ exp(twist_0 q_0) @ exp(twist_1 q_1) ... == X_W,child @ X_CB

    over the `joints` that were cut, their `twists` in A with the coordinates after them at 0 and their offsets in `X_PA`. Without any
    it is a weld, or where it `turns` only the origins of A and B meet. One on the world holds a mount: `hold` is true, `path` the mount's,
    B its frame; else `path` is the joint's. `name` is that of its equality in files, if any is given.
    """

    path: JointPath | SitePath
    hold: bool
    parent: int | None
    child: int
    X_PA: Pose
    X_CB: Pose
    joints: tuple[JointEdge, ...]
    twists: tuple[Twist, ...]
    origin: Origin
    turns: bool = False
    name: str | None = None

    @property
    def at_once(self) -> bool:
        """Whether it is a ball that was cut."""
        return bool(self.joints) and self.joints[0].kind.at_once

    @property
    def kind(self) -> ClosureKind:
        """What it leaves open."""
        if self.turns or self.at_once:
            return "ball"
        if not self.twists:
            return "weld"
        if len(self.twists) == 1:
            return "screw" if self.twists[0].pitch else self.twists[0].core
        return "universal" if self.joints[0].kind.name == "universal" else "several"


def residual_words(residual: tuple[float, float]) -> str:
    """How far from closed [m, rad], for people: `12.3 mm and 4.56 deg`. Digits below 1e-4 are the solver's, and differ by machine."""
    apart, turned = round(1000.0 * residual[0], 4), round(numeric.degrees(residual[1]), 4)
    return f"{apart:.3g} mm and {turned:.3g} deg" if apart or turned else "less than 0.0001 mm and 0.0001 deg"


class Keyframe(OneLineRepr, FrozenStruct):
    """A pose of this mode: q of every joint by path [rad or m], those that mimic included, and those that were cut.

    In a mode with closures it is the named pose with the loops closed: `moved` says by how much [rad or m] each joint had to
    leave the pose (joints on loops of joints that the pose does not name have no place to leave), `residual` how far the worst
    closure is from closed [m, rad]. `base` is the pose of the root link in the world (None: where the mode puts it; else a free
    base that has been moved to where closures want it, or onto the floor).
    """

    name: PoseName
    q: dict[JointPath, float]
    origin: Origin
    base: Pose | None = None
    moved: dict[JointPath, float] = {}
    residual: tuple[float, float] | None = None


class Unclosed(OneLineRepr, FrozenStruct):
    """A pose that the mode has no keyframe for, because its loops do not close from there within the limits of the joints:
    `path` names the closure that stays open most, `residual` how far [m, rad] at best. Or they do close, but so far from the
    pose that it would be another: then `moved` is that of the keyframe it would have been."""

    name: PoseName
    path: JointPath | SitePath
    residual: tuple[float, float]
    origin: Origin
    moved: dict[JointPath, float] = {}


class Robot(OneLineRepr, FrozenStruct):
    """One mode. `bodies` in depth-first order, root first, parents before children, children in document order.

    `base` is `fixed | held | free | planar | ball`, `moves` the coordinates of the last two (the root body stands at 0 of them in every
    pose); `excluded` pairs of body indices (neighbours through a joint, the same links in
    every mode, plus the mode's own); a link that a hold keeps at the world is a neighbour of the world, in this mode alone.
    `closures` are holds, then joints that were cut; `keyframes` the poses that close, `unclosed` the others. `adhesion` is the
    control in this mode per adhesion path [N] (0 where it says nothing). `present` are the joints whose actuators exist here,
    in joint order.
    """

    name: str
    mode: LinkedMode
    assembly: Assembly
    base: BaseType
    gravity: Vector
    bodies: tuple[Body, ...]
    sites: tuple[Site, ...]
    excluded: tuple[tuple[int, int], ...]
    keyframes: tuple[Keyframe, ...]
    present: tuple[JointPath, ...]
    adhesion: dict[SitePath, float]
    closures: tuple[Closure, ...] = ()
    unclosed: tuple[Unclosed, ...] = ()
    moves: tuple[TreeJoint, ...] = ()

    @property
    def pulled(self) -> tuple[str, ...]:
        """The tendons whose drives exist here: all of them, unless the mode chooses its actuators."""
        return () if self.mode.actuators is not None else tuple(one.path for one in self.assembly.tendons if one.actuator is not None)

    @property
    def start(self) -> Keyframe | None:
        """The pose in which the mode starts; None where all joints are at 0 then."""
        return next((frame for frame in self.keyframes if frame.name == self.mode.pose), None)

    @property
    def carried(self) -> bool:
        """Whether the base floats and is carried by what the mode stands on or holds."""
        return self.base == "free" and (bool(self.mode.feet) or any(closure.hold for closure in self.closures))

"""Data types of a robot with a root, which is the kinematic tree of one mode. Exporters of output formats use only these types."""

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
    """A joint coordinate in the kinematic tree, by which a child link moves relative to its parent link in the tree.

    `twist` is in the child link's frame with the following coordinates of the body at 0. The twist is the same for all values of its own
    and the preceding coordinates. Positive q has the same meaning as in the document, even if the joint is reversed. `reversed` means that
    the document's child is the tree's parent, and the twist has been negated. The motion of the joint is measured from q = 0.
    """

    reversed: bool
    mate: int


class Body(OneLineRepr, FrozenStruct):
    """A link in the kinematic tree of a mode.

    `parent` is an index into `Robot.bodies` (None: the world). `X_PL` is the pose of its frame in the parent link's frame at q = 0 (for the
    root: in the world, as placed by the mode's `at`). The body moves by its `joints` in sequence, `X_PL @ exp(twist_0 q_0) @ exp(twist_1
    q_1) ...`, or, for a ball, by exponential coordinates. The root of the tree has no joints.
    """

    link: int
    parent: int | None
    X_PL: Pose
    joints: tuple[TreeJoint, ...]

    @property
    def twists(self) -> tuple[Twist, ...]:
        """The twists of the joint coordinates by which the body moves relative to its parent."""
        return tuple(joint.twist for joint in self.joints)

    @property
    def at_once(self) -> bool:
        """Whether the body moves relative to its parent by a ball joint, whose coordinates are exponential coordinates."""
        return bool(self.joints) and self.joints[0].kind.at_once


class Site(OneLineRepr, FrozenStruct):
    """A named frame on a link. `body` is the index of the link's body, and `pose` is the pose of the site in the frame of the link."""

    path: SitePath
    body: int
    pose: Pose
    origin: Origin


ClosureKind = Literal["weld", "ball", "hinge", "slide", "screw", "universal", "several"]
"""The motion that remains free where a loop is cut.

The allowed motions are, in this order: no motion, rotation about a point, one rotation, one translation, a screw, rotation about two
perpendicular axes that meet, or several coordinates.
"""


class Closure(OneLineRepr, FrozenStruct):
    """A loop that the tree cuts, between the body `parent` (None: the world) and the body `child`.

    A is a frame on the parent and B a frame on the child. The loop is closed if

        X_W,parent @ X_PA @ exp(twist_0 q_0) @ exp(twist_1 q_1) ... == X_W,child @ X_CB

    over the `joints` that were cut. Their `twists` are in A with the following coordinates at 0, and their offsets are in `X_PA`. A closure
    without joints is a weld. If the closure `turns`, only the origins of A and B coincide. With `hold`, the world holds a mount: `path` is
    the mount's path and B its frame. For other closures, `path` is the path of the joint. `name` is the name of the equality in files, if
    specified.
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
        """Whether the loop is cut at a ball joint, whose coordinates are exponential coordinates."""
        return bool(self.joints) and self.joints[0].kind.at_once

    @property
    def kind(self) -> ClosureKind:
        """The type of motion that remains possible between the two frames where the loop is cut."""
        if self.turns or self.at_once:
            return "ball"
        if not self.twists:
            return "weld"
        if len(self.twists) == 1:
            return "screw" if self.twists[0].pitch else self.twists[0].core
        return "universal" if self.joints[0].kind.name == "universal" else "several"


def residual_words(residual: tuple[float, float]) -> str:
    """Format a loop error [m, rad]: `12.3 mm and 4.56 deg`. Digits below 1e-4 are omitted, because they differ between machines."""
    apart, turned = round(1000.0 * residual[0], 4), round(numeric.degrees(residual[1]), 4)
    return f"{apart:.3g} mm and {turned:.3g} deg" if apart or turned else "less than 0.0001 mm and 0.0001 deg"


class Keyframe(OneLineRepr, FrozenStruct):
    """A named pose of a mode with the positions q [rad or m] of all joints by path.

    They include joints that mimic others and joints at which loops are cut.

    In a mode with closures, the keyframe is the named pose with closed loops. `moved` is the movement [rad or m] of each joint from its
    value in the pose (without joints on loops that the pose does not name). `residual` is the largest loop error [m, rad]. `base` is the
    pose of the root link in the world, if closures or the floor have moved a free base (None: as in the mode).
    """

    name: PoseName
    q: dict[JointPath, float]
    origin: Origin
    base: Pose | None = None
    moved: dict[JointPath, float] = {}
    residual: tuple[float, float] | None = None


class Unclosed(OneLineRepr, FrozenStruct):
    """A pose without a keyframe, because its loops do not close within the limits of the joints, or close only far from the pose.

    If the loops do not close, `path` is the path of the closure with the largest error, and `residual` is the smallest error that was found
    [m, rad]. If the loops close too far from the pose, `moved` is the movement to the closed state.
    """

    name: PoseName
    path: JointPath | SitePath
    residual: tuple[float, float]
    origin: Origin
    moved: dict[JointPath, float] = {}


class Robot(OneLineRepr, FrozenStruct):
    """A robot in one mode, as a kinematic tree. `bodies` are in depth-first order, with parents before children and children in document
    order.

    `base` is `fixed | held | free | planar | ball`; `moves` contains the coordinates of a planar or ball base (0 in every pose). `excluded`
    are pairs of body indices without collisions: neighbours through a joint, which are the same links in every mode, and the mode's own
    pairs. A link that a hold fixes to the world is a neighbour of the world in this mode. `closures` contains the holds, followed by the
    joints at which loops are cut. `keyframes` contains the poses whose loops close, `unclosed` the other poses. `adhesion` is the control
    [N] of each adhesion in this mode by path (0 by default). `present` contains the paths of the joints whose actuators exist in this mode.
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
        """The tendons that have a drive in this mode. If the mode does not select actuators, these are all tendons."""
        return () if self.mode.actuators is not None else tuple(one.path for one in self.assembly.tendons if one.actuator is not None)

    @property
    def start(self) -> Keyframe | None:
        """The keyframe in which the mode starts, or None if all joints start at 0."""
        return next((frame for frame in self.keyframes if frame.name == self.mode.pose), None)

    @property
    def carried(self) -> bool:
        """Whether the base is free and feet or holds support it."""
        return self.base == "free" and (bool(self.mode.feet) or any(closure.hold for closure in self.closures))

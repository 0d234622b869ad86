"""Data types of the kinematic tree of a robot in one mode. Emitters of output formats read only these types."""

from __future__ import annotations

from typing import Literal

from thingc.base import numeric
from thingc.base.export_names import JointPath, PoseName, SitePath
from thingc.base.joints.kinds import BaseType
from thingc.base.joints.twist import Twist
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import Pose, Vector
from thingc.base.source import Origin
from thingc.model.assembly.kinematics import coordinates, joints_of
from thingc.model.assembly.types import Assembly, JointEdge, LinkedMode


class TreeJoint(JointEdge):
    """A joint coordinate in the kinematic tree, by which a link moves relative to its parent link.

    `twist` is the motion in the frame of the child link, with the following coordinates of the same body at 0. The twist does not depend on
    this coordinate and the preceding coordinates. A positive q always has the same meaning as in the document. If `reversed` is True, the
    child in the document is the parent in the tree, and the twist has been negated. The motion of the joint is measured from q = 0.
    """

    reversed: bool
    mate: int


class Body(OneLineStruct):
    """A link in the kinematic tree of a mode, with the joints by which it moves.

    `parent` is the index of the parent in `Robot.bodies`, or None for the root, whose parent is the world. `X_PL` is the pose of the link
    in the frame of the parent at q = 0. For the root, `X_PL` is the pose in the world that the setting `at` of the mode determines. The
    body moves by its `joints` in sequence, `X_PL @ exp(twist_0 q_0) @ exp(twist_1 q_1) ...`. For a ball joint, the coordinates are
    exponential coordinates. The root does not have joints. A body without joints that is not the root is
    fixed to its parent. `mate` is the index of the mate between the body and its parent, or None for the root.
    """

    link: int
    parent: int | None
    X_PL: Pose
    joints: tuple[TreeJoint, ...]
    mate: int | None = None

    @property
    def twists(self) -> tuple[Twist, ...]:
        """The twists of the joint coordinates by which the body moves relative to its parent."""
        return tuple(joint.twist for joint in self.joints)

    @property
    def at_once(self) -> bool:
        """Whether the body moves relative to its parent by a ball joint or free joint, which have exponential coordinates."""
        return bool(self.joints) and self.joints[0].kind.at_once

    @property
    def free(self) -> bool:
        """Whether the body moves relative to its parent by a free joint, so that the parent does not carry it."""
        return bool(self.joints) and self.joints[0].kind.free


class Site(OneLineStruct):
    """A named frame on a link. `body` is the index of the body of the link, and `pose` is the pose of the site in the frame of the link."""

    path: SitePath
    body: int
    pose: Pose
    origin: Origin


ClosureKind = Literal["weld", "ball", "hinge", "slide", "screw", "universal", "several"]
"""The relative motion that a loop closure allows.

The values mean, in this order: no motion, rotation about a point, one rotation, one translation, a screw motion, rotations about two
perpendicular axes that intersect, or several coordinates.
"""


class Closure(OneLineStruct):
    """A closure of a kinematic loop that the tree cuts, between the body `parent` (None: the world) and the body `child`.

    A is a frame on the parent, and B is a frame on the child. The loop is closed if

        X_W,parent @ X_PA @ exp(twist_0 q_0) @ exp(twist_1 q_1) ... == X_W,child @ X_CB

    over the `joints` that were cut. `twists` contains the twists of these joints in A, with the following coordinates at 0. Offsets are
    included in `X_PA`. A closure without joints is a weld. If `turns` is True, only the origins of A and B coincide. If `hold` is True, a
    mount is held to the world: `path` is the path of the mount, and B is the frame of the mount. For other closures, `path` is the path of
    the joint. `name` is the name of the MuJoCo equality, or None.
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
        """The type of relative motion that the closure allows."""
        if self.turns or self.at_once:
            return "ball"
        if not self.twists:
            return "weld"
        if len(self.twists) == 1:
            return "screw" if self.twists[0].pitch else self.twists[0].core
        return "universal" if self.joints[0].kind.name == "universal" else "several"


def residual_words(residual: tuple[float, float]) -> str:
    """Format the closure error of a loop [m, rad], such as `12.3 mm and 4.56 deg`.

    Digits below 1e-4 are omitted, because they differ between machines.
    """
    distance, angle = round(1000.0 * residual[0], 4), round(numeric.degrees(residual[1]), 4)
    return f"{distance:.3g} mm and {angle:.3g} deg" if distance or angle else "less than 0.0001 mm and 0.0001 deg"


class Keyframe(OneLineStruct):
    """A named pose of a mode. `q` maps the path of each joint to its position [rad or m].

    Joints that mimic other joints, and joints at which loops are cut, are included.

    If the mode has loop closures, the keyframe is the pose after the loops have been closed. `moved` is the movement [rad or m] of each
    joint during loop closure. Joints on loops that the pose does not contain are omitted. `residual` is the largest remaining error of a
    loop [m, rad]. `base` is the pose of the root link in the world, if loop closure or the floor has moved a free base. Otherwise, `base`
    is None.
    """

    name: PoseName
    q: dict[JointPath, float]
    origin: Origin
    base: Pose | None = None
    moved: dict[JointPath, float] = {}
    residual: tuple[float, float] | None = None


class Unclosed(OneLineStruct):
    """A pose that is not a keyframe, because its loops do not close within the joint limits, or close only far from the pose.

    If the loops do not close, `path` is the path of the closure with the largest error, and `residual` is the smallest error [m, rad] that
    was found. If the loops close far from the pose, `moved` is the movement of the joints to the closed state.
    """

    name: PoseName
    path: JointPath | SitePath
    residual: tuple[float, float]
    origin: Origin
    moved: dict[JointPath, float] = {}


class Robot(OneLineStruct):
    """A robot in one mode, as a kinematic tree. `bodies` are in depth-first order, with parents before children and children in document
    order.

    `base` is `fixed | held | free | planar | ball`. `moves` contains the coordinates of a planar or ball base, which are 0 in every pose.
    `excluded` contains pairs of indices of bodies that do not collide. These pairs are bodies that a joint connects, and the pairs in the
    settings of the mode. A link that is held to the world also forms such a pair with the world. `closures` contains the holds, followed by
    the closures of joints at which loops are cut. `keyframes` contains the poses whose loops close, and `unclosed` contains all other
    poses. `adhesion` maps the paths of magnets to their control values [N] in this mode (0 by default). `present` contains the paths of the
    joints whose drives exist in this mode.
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
        """The names of the tendons with a drive that exists in this mode.

        If the mode does not select actuators, all tendons are included. A mode can only select the drives of differentials.
        """
        driven = (tendon for tendon in self.assembly.tendons if tendon.actuator is not None)
        return tuple(tendon.path for tendon in driven if self.mode.has_drive(tendon.path))

    @property
    def start(self) -> Keyframe:
        """The state in which the mode starts. In modes without a start pose, all joints start at 0, and the name is empty."""
        frame = next((frame for frame in self.keyframes if frame.name == self.mode.pose), None)
        return frame or Keyframe(name="", q=coordinates(joints_of(self.assembly), {}), origin=self.mode.origin)

    @property
    def carriers(self) -> tuple[int, ...]:
        """For each body, the index of the body that carries it: the root, or a body with a free joint."""
        carriers: list[int] = []
        for index, body in enumerate(self.bodies):
            carriers.append(index if body.parent is None or body.free else carriers[body.parent])
        return tuple(carriers)

    @property
    def carried(self) -> bool:
        """Whether the base is free and is supported by feet or holds."""
        return self.base == "free" and (bool(self.mode.feet) or any(closure.hold for closure in self.closures))

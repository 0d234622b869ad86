"""Convert the joints of a mode to joints of UsdPhysics. A UsdPhysics joint defines a frame on each of two bodies, and the motions between
these frames.

    X_body1 = X_body0 @ frame0 @ T(trans) @ RotX @ RotY @ RotZ @ inv(frame1)

A rotation about z of the frame, a slide along z, and a ball have their own types. Any other joint with several coordinates becomes a
generic joint (D6). A generic joint first slides, and then rotates about x, about the rotated y, and about the rotated z. This order of the
rotations is that of Newton, because UsdPhysics does not define an order. If a generic joint cannot represent the motions, they become a
chain of two joints with an almost massless link between them. In Newton's schema, a rotation can only mimic a rotation, and a slide can
only mimic a slide.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import Twist
from thingc.base.pose import IDENTITY, NO_POSE, Matrix, Pose, Vector, along, cross, dot, make_translation, transpose
from thingc.model.assembly.kinematics import joints_of, leaders
from thingc.model.assembly.types import JointEdge
from thingc.model.resolve.coordinates import Limit
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets.capabilities import joint_cell
from thingc.targets.connections import Connection, connections
from thingc.targets.usd.capabilities import CAPABILITIES

UsdType = Literal["Fixed", "Revolute", "Prismatic", "Spherical", "D6"]

PARALLEL = 1e-9
"""Tolerance for the cosine of the angle between axes that count as parallel or perpendicular."""

LETTERS = {1: ("Z",), 2: ("X", "Y"), 3: ("X", "Y", "Z")}
"""Axes of the joint frame that represent the directions of a joint, by the number of directions."""


class Freedom(FrozenStruct):
    """A free motion of a USD joint: a rotation about an axis or a slide along an axis.

    `name` is the name of the motion in UsdPhysics. The name is `angular` or `linear` for a joint with one coordinate, `ball` for a ball
    joint, and otherwise a name such as `rotX` or `transX`. The value of the motion is `ratio` [1 or m/rad] times the coordinate q of
    `joint`.
    """

    name: str
    joint: TreeJoint | JointEdge
    ratio: float = 1.0

    @property
    def turns(self) -> bool:
        """Return whether the motion is a rotation [deg]. Otherwise, the motion is a translation [m]."""
        return self.name.startswith(("angular", "rot"))


class UsdJoint(FrozenStruct):
    """A joint in a UsdPhysics stage.

    `path` is the name of the joint, and `frame` is the frame of the joint in the child body at q = 0. `freedoms` contains the motions
    of the joint. For a ball joint, the motions are the coordinates in the document.
    """

    path: str
    type: UsdType
    frame: Pose = NO_POSE
    freedoms: tuple[Freedom, ...] = ()

    @property
    def single(self) -> TreeJoint | JointEdge | None:
        """Return the joint coordinate of a USD joint that is a single rotation or a single slide. Return None for any other joint."""
        return self.freedoms[0].joint if self.type in ("Revolute", "Prismatic") else None


def chain(connection: Connection) -> tuple[UsdJoint, ...]:
    """Return the USD joints that connect two bodies, in order from the first to the second body.

    If F is the frame of a returned joint, the frame on the parent is `X_0 @ F`, and the frame on the child is `X_1 @ F`.
    """
    path, joints, twists = connection.path, connection.coordinates, connection.twists
    if not joints:
        return (UsdJoint(path=path, type="Spherical" if connection.turns else "Fixed"),)
    form = CAPABILITIES["joints"][joint_cell(joints[0].kind)].by
    match form:
        case "single":
            return (_single(path, joints[0], twists[0]),)
        case "generic":
            return tuple(_generic(path, joints, twists))
        case "spherical":
            return (_spherical(path, joints, twists),)
        case "free":
            return ()


def _spherical(path: str, joints: Sequence[TreeJoint | JointEdge], twists: Sequence[Twist]) -> UsdJoint:
    """Return the spherical USD joint for a ball joint."""
    axes = [twist.angular for twist in twists]
    if isinstance(joints[0], TreeJoint) and joints[0].reversed:  # the coordinates are negated and in reverse order
        joints, axes = joints[::-1], [(-x, -y, -z) for x, y, z in reversed(axes)]
    frame = Pose(rotation=transpose((axes[0], axes[1], axes[2])), translation=twists[0].anchor)
    return UsdJoint(path=path, type="Spherical", frame=frame, freedoms=tuple(Freedom(name="ball", joint=joint) for joint in joints))


def _single(path: str, joint: TreeJoint | JointEdge, twist: Twist) -> UsdJoint:
    """Return the USD joint for a single rotation or a single slide."""
    freedom = Freedom(name="angular" if twist.turns else "linear", joint=joint)
    return UsdJoint(path=path, type="Revolute" if twist.turns else "Prismatic", frame=along(twist.axis, twist.anchor), freedoms=(freedom,))


def _generic(path: str, joints: Sequence[TreeJoint | JointEdge], twists: Sequence[Twist]) -> Iterator[UsdJoint]:
    """Yield the USD joints for a joint with several coordinates. A slide after a rotation about another axis begins a new USD joint."""
    groups: list[list[int]] = [[]]
    for k, twist in enumerate(twists):
        if not twist.turns and any(twists[other].turns and not _parallel(twists[other].axis, twist.axis) for other in groups[-1]):
            groups.append([])
        groups[-1].append(k)
    for group in groups:
        if len(twists) > 1 and len(group) == 1:
            yield _single(joints[group[0]].path, joints[group[0]], twists[group[0]])
        else:
            yield _several(path, [joints[k] for k in group], [twists[k] for k in group])


def _several(path: str, joints: Sequence[TreeJoint | JointEdge], twists: Sequence[Twist]) -> UsdJoint:
    """Return one generic USD joint for all coordinates. The axes must be parallel or perpendicular to each other."""
    anchor = next((twist.anchor for twist in twists if twist.turns), twists[0].anchor)
    directions: list[Vector] = []
    for twist in twists:
        if not any(_parallel(twist.axis, direction) for direction in directions):
            directions.append(twist.axis)
    letters = LETTERS[len(directions)]
    freedoms = []
    for joint, twist in zip(joints, twists, strict=True):
        letter = next(letter for letter, direction in zip(letters, directions, strict=True) if _parallel(twist.axis, direction))
        freedoms.append(Freedom(name=f"{'rot' if twist.turns else 'trans'}{letter}", joint=joint))
        if twist.pitch:
            freedoms.append(Freedom(name=f"trans{letter}", joint=joint, ratio=twist.pitch))
    return UsdJoint(path=path, type="D6", frame=_frame(directions, anchor), freedoms=tuple(freedoms))


def _frame(directions: Sequence[Vector], anchor: Vector) -> Pose:
    """Return the frame at `anchor` whose axes have the given directions. `LETTERS` defines which axis of the frame has which direction."""
    if len(directions) == 1:
        return along(directions[0], anchor)
    x, y = directions[:2]
    rows: Matrix = (x, y, cross(x, y))
    return make_translation(*anchor) if rows == IDENTITY else Pose(rotation=transpose(rows), translation=anchor)


def _parallel(a: Vector, b: Vector) -> bool:
    return dot(a, b) > 1.0 - PARALLEL


class MimicJoint(FrozenStruct):
    """A mimic joint that Newton's schema can express, because it has one coordinate of the same kind as its independent joint `leader`.

    The mimic joint follows the leader: q = offset + multiplier q(leader) [rad or m]. `reach` is the range of q that results from the limits
    of the leader, or None if the leader does not have both limits.
    """

    leader: str
    multiplier: float
    offset: float
    turns: bool
    reach: tuple[float, float] | None


def followers(robot: Robot) -> dict[str, MimicJoint]:
    """Return the mimic joints of a robot that Newton's schema can express, by path."""
    usd_joints = [usd_joint for connection in connections(robot, CAPABILITIES["loops"]) for usd_joint in chain(connection)]
    types = {usd_joint.single.path: usd_joint.type for usd_joint in usd_joints if usd_joint.single is not None}
    joints = {joint.path: joint for joint in joints_of(robot.assembly)}
    return {
        path: MimicJoint(
            leader=leader, multiplier=multiplier, offset=offset, turns=joints[path].twist.turns,
            reach=_reach(joints[leader].limit, multiplier, offset),
        )
        for path, (leader, multiplier, offset) in leaders(joints.values()).items()
        if joints[path].mimic is not None and path in types and types.get(leader) == types[path]
    }


def _reach(limit: Limit, multiplier: float, offset: float) -> tuple[float, float] | None:
    if limit.lower is None or limit.upper is None:
        return None
    first, second = (offset + multiplier * end for end in (limit.lower, limit.upper))
    return min(first, second), max(first, second)

"""Find the moving joints in the URDF of a mode, and their values in a pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import pose_after
from thingc.base.pose import NO_POSE, Vector, cross, dot, multiply, rpy_of, scale_vector, transpose
from thingc.geometry.record import DriveType
from thingc.model.assembly.types import ActuatorModel, LinkedTendon
from thingc.model.robot.types import Body, Robot, TreeJoint
from thingc.targets.capabilities import drive_cell, is_written
from thingc.targets.name_mangling import safe
from thingc.targets.ros.capabilities import CAPABILITIES
from thingc.targets.urdf.chain import Move, mimics_of, moves
from thingc.targets.urdf.transmissions import differentials

INTERFACES: Mapping[DriveType, str] = {"position": "position", "velocity": "velocity", "motor": "effort"}
"""The command interface in ros2_control for each kind of drive."""


class MovingJoint(FrozenStruct):
    """A moving joint in a URDF file.

    `name` is the name of the joint in the URDF, and `body` is the index of the child body of the joint. `move` is the motion of the
    joint, and `drive` is its drive in this mode. `follows` is True if the joint mimics another joint. The three rotations of a ball joint
    have no drive, because the drives of a ball joint have different axes.
    """

    name: str
    body: int
    move: Move
    follows: bool
    drive: ActuatorModel | None

    @property
    def interface(self) -> str | None:
        """Return the command interface of the joint in ros2_control: `position`, `velocity` or `effort`. Return None for a joint without a
        drive.
        """
        return None if self.drive is None else INTERFACES[self.drive.kind]


def joints(robot: Robot) -> tuple[MovingJoint, ...]:
    """Return the movable joints in the URDF of a mode. The joints of a parent link come before the joints of its children.

    The joints of a moving base come first. Floating joints are omitted, because joint states cannot contain them.
    """
    mimics = mimics_of(robot)
    moving: list[MovingJoint] = []
    coupled_drives = {path: _differential_drive(rows) for rows in differentials(robot).values() for path in rows[0].moves}
    for index, body in enumerate(robot.bodies):
        for move in moves(_lead(robot, body), NO_POSE, mimics) if not body.free else ():
            path, follows = move.joint.path, move.mimic is not None
            drive = None if follows else move.joint.actuator if path in robot.present else coupled_drives.get(path)
            if drive is not None and not is_written(CAPABILITIES["drives"][drive_cell(move.joint, drive)]):
                drive = None
            moving.append(MovingJoint(name=safe(move.path), body=index, move=move, follows=follows, drive=drive))
    return tuple(moving)


def _differential_drive(rows: Sequence[LinkedTendon]) -> ActuatorModel | None:
    """Return the drive of each joint of a differential: a controller commands the joint, and a transmission moves the actuators.

    The gains act on the actuators, so the drive of a joint has none. Return None if the actuators are of different kinds.
    """
    first, *others = (row.actuator for row in rows)
    if first is None or any(other is None or other.kind != first.kind for other in others):
        return None
    return ActuatorModel(kind=first.kind, origin=first.origin)


def values(robot: Robot, q: Mapping[str, float]) -> dict[str, float]:
    """Convert joint values in the document to values of the URDF joints [rad or m], by joint name.

    `q` contains the joint values in the document, by path. If the base moves, it is in its start pose.
    """
    result: dict[str, float] = {}
    for body in robot.bodies:
        coordinates = _lead(robot, body) if not body.free else ()
        if coordinates and coordinates[0].kind.at_once:
            turns = _turns(coordinates, tuple(q.get(joint.path, 0.0) for joint in coordinates))
            result |= {safe(joint.path): angle for joint, angle in zip(coordinates, turns, strict=True)}
            continue
        for move in moves(coordinates, NO_POSE, {}):
            result[safe(move.path)] = q.get(move.joint.path, 0.0) * (1.0 if move.thread is None else move.thread)
    return result


def _lead(robot: Robot, body: Body) -> tuple[TreeJoint, ...]:
    """Return the joint coordinates that move a body relative to its parent. The root link is moved by the coordinates of the base."""
    return robot.moves if body.parent is None else body.joints


def _turns(ball: tuple[TreeJoint, ...], q: tuple[float, ...]) -> Vector:
    """Convert a rotation vector `q` to three angles [rad]. Three successive rotations by these angles, about the axes of the ball joint,
    equal the rotation vector.

    In the frame U of the axes, R = U Rx(a) Ry(b) Rz(c) U', so that U' R' U = Rz(-c) Ry(-b) Rx(-a), whose roll, pitch and yaw are -a, -b and
    -c. The axes of a reversed ball joint form a left-handed frame. About the opposite axes, which are right-handed, the angles have the
    opposite sign.
    """
    x, y, z = (joint.twist.axis for joint in ball)
    hand = 1.0 if dot(cross(x, y), z) > 0.0 else -1.0
    U = transpose((scale_vector(x, hand), scale_vector(y, hand), scale_vector(z, hand)))
    R = pose_after(tuple(joint.twist for joint in ball), q, at_once=True).rotation
    return scale_vector(rpy_of(multiply(multiply(transpose(U), transpose(R)), U)), -hand)

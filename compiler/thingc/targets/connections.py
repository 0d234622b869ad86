"""List the connections between the bodies of a mode. This list is used for formats that allow any graph of joints.

The connections are the joints of the tree and the joints that close loops.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import Twist
from thingc.base.pose import NO_POSE, Pose
from thingc.base.source import Origin
from thingc.model.assembly.types import JointEdge
from thingc.model.robot.tree import BASE
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets.capabilities import Cell, LoopCell, is_written

HOLD = "_hold"
"""Suffix of the name of a joint that holds a mount."""


class Connection(FrozenStruct):
    """A connection between two bodies. The bodies are given by their indices. If the parent is None, it is the world.

    `X_0` is a frame on the parent, and `X_1` is a frame on the child. The joint moves the second frame away from the first frame, as
    `coordinates` describe. Each twist in `twists` is expressed in the first frame. A twist applies when all later coordinates are 0. A
    connection without coordinates is fixed. If `turns` is True, the connection only keeps the origins of the two frames together. `path` is
    the path of the whole joint, which can have several coordinates. `joints` are the coordinates of a joint in the document. A connection
    that is not `in_tree` closes a loop or holds a mount.
    """

    parent: int | None
    child: int
    path: str
    X_0: Pose
    X_1: Pose
    origin: Origin
    coordinates: tuple[TreeJoint | JointEdge, ...] = ()
    twists: tuple[Twist, ...] = ()
    joints: tuple[TreeJoint | JointEdge, ...] = ()
    turns: bool = False
    in_tree: bool = True


def connections(robot: Robot, loops: Mapping[LoopCell, Cell[None]], *, closed: bool = True) -> Iterator[Connection]:
    """Yield the connections between the bodies of a mode. The joints of the tree come first, in the order of the bodies. The closed loops
    and holds that the format supports come last. Free joints are omitted.
    """
    for index, body in enumerate(robot.bodies):
        path, origin, moves = BASE, robot.mode.origin, robot.moves
        if body.mate is not None:
            mate = robot.assembly.mates[body.mate]
            path, origin, moves = mate.name or path, mate.origin, body.joints
        if body.parent is not None and not body.free or body.parent is None and robot.base != "free":
            yield Connection(
                parent=body.parent, child=index, path=path, X_0=body.X_PL, X_1=NO_POSE, origin=origin, coordinates=moves,
                twists=tuple(joint.twist for joint in moves), joints=body.joints,
            )
    for closure in robot.closures if closed else ():
        if not is_written(loops["hold" if closure.hold else closure.kind]):
            continue
        yield Connection(
            parent=closure.parent, child=closure.child, path=f"{closure.path}{HOLD}" if closure.hold else closure.path, X_0=closure.X_PA,
            X_1=closure.X_CB, origin=closure.origin, coordinates=closure.joints, twists=closure.twists, joints=closure.joints,
            turns=closure.turns, in_tree=False,
        )

"""Joints as SDF has them: each about, or along, axes through a point that is fixed in its child, and at 0 where the file has the links.

Turns, slides, screws, balls, and two turns about axes that meet (`universal`) are there; what else has several coordinates is a chain, with
almost massless links between.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

from thingc.emit.sdf.zero import ZeroState
from thingc.frozen import dataclass
from thingc.graph.types import JointEdge
from thingc.joints import Twist
from thingc.pose import NO_POSE, Vector, dot
from thingc.robot.tree import BASE
from thingc.robot.types import Closure, CoreJoint, Robot
from thingc.source import Origin

SdfType = Literal["fixed", "continuous", "revolute", "prismatic", "screw", "universal", "ball"]

LINK = "_link"
"""What the name of a link between the joints of a chain ends with, behind that of the joint before: components are called like joints."""

HOLD = "_hold"
"""What the name of the joint ends with that holds a mount."""

MEET = 1e-9
"""Axes that pass at less than this [m] meet, and are at right angles where the cosine is less."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SdfAxis:
    """A coordinate of a joint, and what it does, seen in the child link's frame where the file has it."""

    joint: CoreJoint | JointEdge
    twist: Twist


@dataclass(frozen=True, slots=True, kw_only=True)
class SdfJoint:
    """A joint of SDF's: `path` names it, `at` is its origin in the child link's frame [m], `axes` are those that it turns about or slides
    along, none where it is `fixed` or a `ball`."""

    path: str
    type: SdfType
    at: Vector
    axes: tuple[SdfAxis, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Connection:
    """How a body meets another (None: the world), by their indices: by one joint, or a `chain` of them. `path` is that of the whole joint,
    `joints` are its coordinates, where it is one of the document; one `in_tree` is what carries the child in the tree of the mode, others
    close loops and hold."""

    parent: int | None
    child: int
    path: str
    chain: tuple[SdfJoint, ...]
    origin: Origin
    joints: tuple[CoreJoint | JointEdge, ...] = ()
    in_tree: bool = True


def connections(robot: Robot, zero: ZeroState) -> tuple[Connection, ...]:
    """The joints of a mode whose file has it at `zero`: those of its tree in the order of its bodies, then those that close it."""
    closures = robot.closures if zero.closed else ()
    return (*_of_tree(robot, zero.q), *(_of_closure(closure, zero.q) for closure in closures))


def _of_tree(robot: Robot, q: Mapping[str, float]) -> Iterator[Connection]:
    for index, body in enumerate(robot.bodies):
        path, origin = BASE, robot.mode.origin
        if body.joints:
            path, origin = robot.assembly.mates[body.joints[0].mate].name or body.joints[0].path, body.joints[0].origin
            chain = _chain(path, body.joints, body.twists, q)
        elif robot.moves:
            at_zero = dict.fromkeys((joint.path for joint in robot.moves), 0.0)
            chain = _chain(BASE, robot.moves, [joint.twist for joint in robot.moves], at_zero)
        elif robot.base != "free":
            chain = (SdfJoint(path=BASE, type="fixed", at=NO_POSE.translation),)
        else:
            continue
        yield Connection(parent=body.parent, child=index, path=path, chain=chain, origin=origin, joints=body.joints)


def _of_closure(closure: Closure, q: Mapping[str, float]) -> Connection:
    path = f"{closure.path}{HOLD}" if closure.hold else closure.path
    if closure.joints:
        chain = _chain(path, closure.joints, [twist.seen_from(closure.X_CB) for twist in closure.twists], q)
    else:
        chain = (SdfJoint(path=path, type="ball" if closure.turns else "fixed", at=closure.X_CB.translation),)
    return Connection(
        parent=closure.parent, child=closure.child, path=path, chain=chain, origin=closure.origin, joints=closure.joints, in_tree=False,
    )


def _chain(path: str, joints: Sequence[CoreJoint | JointEdge], twists: Sequence[Twist], q: Mapping[str, float]) -> tuple[SdfJoint, ...]:
    """The joints of SDF's that move a link by `twists` (seen in its frame at 0 of those after each), one after the other, or by those of a
    ball; where the file has them the coordinates are at `q` [rad or m]. `path` is that of the whole joint."""
    if joints[0].kind.at_once:
        return (SdfJoint(path=path, type="ball", at=twists[0].anchor),)
    axes: list[SdfAxis] = []
    later = NO_POSE
    for joint, twist in zip(reversed(joints), reversed(twists), strict=True):
        axes.insert(0, SdfAxis(joint=joint, twist=twist.seen_from(later.inverse())))
        later = twist.exponential(q[joint.path]) @ later
    if _universal([axis.twist for axis in axes]):
        return (SdfJoint(path=path, type="universal", at=axes[1].twist.anchor, axes=tuple(axes)),)
    return tuple(SdfJoint(path=axis.joint.path, type=_type(axis), at=axis.twist.anchor, axes=(axis,)) for axis in axes)


def _type(axis: SdfAxis) -> SdfType:
    if not axis.twist.turns:
        return "prismatic"
    if axis.twist.pitch:
        return "screw"
    return "revolute" if axis.joint.limit.bounded else "continuous"


def _universal(twists: Sequence[Twist]) -> bool:
    """Whether these are two turns about axes that meet at right angles."""
    if len(twists) != 2 or not all(twist.turns and not twist.pitch for twist in twists):
        return False
    apart = max(abs(a - b) for a, b in zip(twists[0].anchor, twists[1].anchor, strict=True))
    return apart < MEET and abs(dot(twists[0].angular, twists[1].angular)) < MEET

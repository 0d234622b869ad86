"""The mechanism of a robot: links with mass properties, and the joints between them, without a root and without geometry.

A mechanism is built from an assembly or from the file `modes.json` of a build folder.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, get_args

from msgspec.structs import asdict, replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.grouping import group_by
from thingc.base.inertia import MassProperties, total
from thingc.base.joints.twist import Twist
from thingc.base.numeric import atan2, dist
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import NO_POSE, Matrix, Pose, Vector, add_scaled, along, cross, dot, scale_vector, turned_z
from thingc.model.assembly.types import Assembly, JointEdge
from thingc.model.robot.tree import in_link

if TYPE_CHECKING:
    from thingc.modes.frames import Array
    from thingc.modes.tree import Joint, Mode

MotionKind = Literal["rotation", "translation", "screw", "ball"]
JointProperty = Literal["effort", "velocity", "damping", "friction", "armature", "stiffness", "rest"]
Limits = tuple[float | None, float | None]

RIGID = 1e-6
"""Difference of the distances [m] between two points in two links below which the points can coincide."""


class MechanismLink(OneLineStruct):
    """A rigid body. Its mass properties are in the frame of the link. A link between two coordinates of one joint is massless."""

    name: str
    properties: MassProperties


class Coupling(FrozenStruct):
    """The coupling of a joint to the joint `leader`: q is the polynomial of the leader's q with these coefficients, constant first."""

    leader: str
    polynomial: tuple[float, ...]


class MechanismJoint(OneLineStruct):
    """A joint with one coordinate q, or a ball joint.

    The link `child` has the pose `exp(twist q) @ pose` in the frame of the link `parent`. Both links are indices. The twist of a ball
    joint is a rotation about its centre. `limits` are the lower and the upper limit of q [rad or m], or the cone of a ball joint as upper
    limit. `limits` is None if the source, such as a build folder, contains no limits. `properties` contains the values in SI units that the
    source specifies.
    """

    name: str
    kind: MotionKind
    parent: int
    child: int
    pose: Pose
    twist: Twist
    limits: Limits | None = None
    properties: Mapping[JointProperty, float] = {}
    coupling: Coupling | None = None


class Mechanism(OneLineStruct):
    """The links and joints of a robot. Links that are fixed to each other are one link."""

    name: str
    links: tuple[MechanismLink, ...]
    joints: tuple[MechanismJoint, ...]


class _Coordinate(FrozenStruct):
    """A coordinate of a joint, with its twist and offset in the frame that the previous coordinate of the same joint moves."""

    name: str
    twist: Twist
    offset: float = 0.0
    limits: Limits | None = None
    properties: Mapping[JointProperty, float] = {}
    coupling: Coupling | None = None


def mechanism_of_assembly(assembly: Assembly) -> Mechanism:
    """Return the mechanism of a linked robot. It does not depend on the modes of the robot."""
    placed = in_link(assembly)
    builder = _Builder(MechanismLink(name=link.name, properties=link.properties) for link in assembly.links)
    for mate in assembly.mates:
        parent, child = assembly.link_of[mate.parent], assembly.link_of[mate.child]
        before, after = placed[mate.parent] @ mate.X_PJ, mate.X_JC @ placed[mate.child].inverse()
        if mate.joints:
            builder.add(parent, child, before, after, [_of_edge(one) for one in mate.joints], ball=mate.joints[0].kind.name == "ball")
        elif mate.separates:
            builder.welds.append((parent, child, before @ after))
    return builder.build(assembly.name)


def _of_edge(edge: JointEdge) -> _Coordinate:
    limit, mimic = edge.limit, edge.mimic
    values = asdict(limit) | asdict(edge.dynamics) | {"rest": edge.dynamics.rest or 0.0 if edge.dynamics.stiffness else None}
    keys: tuple[JointProperty, ...] = get_args(JointProperty)
    return _Coordinate(
        name=edge.path, twist=edge.twist, offset=edge.offset, limits=(limit.lower, limit.cone if limit.upper is None else limit.upper),
        properties={key: values[key] for key in keys if values[key] is not None},
        coupling=None if mimic is None else Coupling(leader=mimic.joint.path, polynomial=mimic.polynomial),
    )


def mechanism_of_mode(name: str, mode: Mode) -> Mechanism:
    """Return the mechanism of a robot from one of its modes in `modes.json`. The file does not contain properties of joints."""
    builder = _Builder(
        MechanismLink(name=link.name, properties=MassProperties(
            mass=link.mass, centre=_vector(link.centre), inertia=_matrix(link.inertia),
        )) for link in mode.links
    )
    waiting: list[Joint] = []
    for number, joint in enumerate(mode.joints):
        waiting.append(joint)
        if number + 1 == len(mode.joints) or mode.joints[number + 1].first:
            coordinates = [_Coordinate(
                name=one.name, twist=_twist(one.twist), offset=one.offset,
                coupling=None if one.mimic is None else Coupling(
                    leader=one.mimic.joint, polynomial=(one.mimic.offset, one.mimic.multiplier, *one.mimic.higher),
                ),
            ) for one in waiting]
            before, after = to_pose(waiting[0].X_PJ), to_pose(joint.X_JL)
            builder.add(joint.parent, joint.child, before, after, coordinates, ball=joint.kind == "ball")
            waiting = []
    for number, link in enumerate(mode.links):
        if link.fixed_to is not None:
            near = to_pose(mode.links[link.fixed_to].X_root_link)
            builder.welds.append((link.fixed_to, number, near.inverse() @ to_pose(link.X_root_link)))
    for cut in mode.cuts:
        before, after = to_pose(cut.X_PA), to_pose(cut.X_CB).inverse()
        coordinates = [_Coordinate(name=one, twist=_twist(row)) for one, row in zip(cut.coordinates, cut.twists, strict=True)]
        if coordinates:
            builder.add(cut.parent, cut.child, before, after, coordinates, ball=cut.kind == "ball")
        else:
            builder.welds.append((cut.parent, cut.child, before @ after))
    return builder.build(name)


def _vector(row: Iterable[float]) -> Vector:
    x, y, z = map(float, row)
    return (x, y, z)


def to_pose(rows: Array) -> Pose:
    """Convert a pose (4, 4)."""
    return Pose(rotation=_matrix(rows[:3, :3]), translation=_vector(rows[:3, 3]))


def _matrix(rows: Array) -> Matrix:
    a, b, c = map(_vector, rows)
    return (a, b, c)


def _twist(row: Array) -> Twist:
    """Return the twist with an angular part (first three numbers) and the velocity of the origin (last three numbers)."""
    angular, linear = _vector(row[:3]), _vector(row[3:])
    if dot(angular, angular) == 0.0:
        return Twist(linear=linear)
    pitch = dot(angular, linear)
    return Twist(angular, (pitch * angular[0], pitch * angular[1], pitch * angular[2]), cross(angular, linear))


class _Builder:
    """Collects the links and joints of a mechanism. `welds` are pairs of links with the pose of the second in the first."""

    def __init__(self, links: Iterable[MechanismLink]) -> None:
        self.links = list(links)
        self.joints: list[MechanismJoint] = []
        self.welds: list[tuple[int, int, Pose]] = []

    def add(self, parent: int, child: int, before: Pose, after: Pose, coordinates: Sequence[_Coordinate], *, ball: bool) -> None:
        """Add a joint: the pose of the child is `before @ exp(twist_0 (q_0 + offset_0)) ... @ after`.

        A joint with several coordinates becomes several joints with massless links between them.
        """
        if ball:
            first = coordinates[0]
            self.joints.append(MechanismJoint(
                name=first.name.removesuffix("_0"), kind="ball", parent=parent, child=child, pose=before @ after,
                twist=replace(first.twist, linear=(0.0, 0.0, 0.0)).seen_from(before), limits=first.limits, properties=first.properties,
            ))
            return
        near = parent
        for number, one in enumerate(coordinates):
            far, pose = child, before @ one.twist.exponential(one.offset)
            if number + 1 < len(coordinates):
                far = len(self.links)
                name = f"between {one.name} and {coordinates[number + 1].name}"
                self.links.append(MechanismLink(name=name, properties=MassProperties(mass=0.0)))
            else:
                pose = pose @ after
            kind: MotionKind = "screw" if one.twist.turns and one.twist.pitch else "rotation" if one.twist.turns else "translation"
            self.joints.append(MechanismJoint(
                name=one.name, kind=kind, parent=near, child=far, pose=pose, twist=one.twist.seen_from(before), limits=one.limits,
                properties=one.properties, coupling=one.coupling,
            ))
            near, before = far, NO_POSE

    def build(self, name: str) -> Mechanism:
        """Return the mechanism. Links that welds connect are merged to one link, and two balls between the same links to a rotation."""
        into = self._merge_links()
        groups = group_by(into, lambda link: into[link][0])
        index = {head: number for number, head in enumerate(groups)}
        links = tuple(
            self.links[head] if len(members) == 1 else
            replace(self.links[head], properties=total(self.links[one].properties.seen_from(into[one][1]) for one in members))
            for head, members in groups.items()
        )
        joints = []
        balls: dict[frozenset[int], list[MechanismJoint]] = defaultdict(list)
        for joint in self.joints:
            (parent, here), (child, there) = into[joint.parent], into[joint.child]
            moved = replace(joint, pose=here @ joint.pose @ there.inverse(), twist=joint.twist.seen_from(here))
            joints.append(replace(moved if self.welds else joint, parent=index[parent], child=index[child]))
            if joint.kind == "ball":
                balls[frozenset((parent, child))].append(joints[-1])
        for pair in balls.values():
            if len(pair) == 2 and (hinge := _as_hinge(*pair)) is not None:
                joints[joints.index(pair[0])] = hinge
                joints.remove(pair[1])
        return Mechanism(name=name, links=links, joints=tuple(joints))

    def _merge_links(self) -> Mapping[int, tuple[int, Pose]]:
        """Return the link into which each link is merged, and the pose of the link in the frame of this link."""
        edges: dict[int, list[tuple[int, Pose]]] = {}
        for one, other, pose in self.welds:
            edges.setdefault(one, []).append((other, pose))
            edges.setdefault(other, []).append((one, pose.inverse()))
        into: dict[int, tuple[int, Pose]] = {}
        for head in range(len(self.links)):
            waiting = [] if head in into else [(head, NO_POSE)]
            while waiting:
                link, pose = waiting.pop()
                if link not in into:
                    into[link] = (head, pose)
                    waiting += [(other, pose @ step) for other, step in edges.get(link, ())]
        return into


def _as_hinge(one: MechanismJoint, other: MechanismJoint) -> MechanismJoint | None:
    """Return the rotation that two ball joints between the same two links allow, or None if their centres cannot define an axis.

    A loop that a hinge closes is written like this in MJCF.
    """
    ends: list[Pose] = []
    lengths: list[float] = []
    for link in (one.parent, one.child):
        start, end = (
            joint.twist.anchor if joint.parent == link else joint.pose.inverse().apply(joint.twist.anchor) for joint in (one, other)
        )
        lengths.append(dist(start, end))
        if min(lengths) <= RIGID or abs(lengths[-1] - lengths[0]) > RIGID:
            return None
        ends.append(along(scale_vector(add_scaled(end, start, -1.0), 1.0 / lengths[-1]), start))
    (a, b, _), (c, d, _), _ = (ends[0].inverse() @ one.pose @ ends[1]).rotation
    pose = ends[0] @ turned_z(atan2(c - b, a + d)) @ ends[1].inverse()
    axis = Twist(angular=(0.0, 0.0, 1.0)).seen_from(ends[0])
    return MechanismJoint(name=one.name, kind="rotation", parent=one.parent, child=one.child, pose=pose, twist=axis)

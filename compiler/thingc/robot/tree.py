"""The tree of bodies below a root: which joints it takes, which loops it leaves open, and how it crosses each joint."""

from __future__ import annotations

from collections.abc import Collection

from thingc.graph.types import Assembly, JointEdge, LinkedMode, Mate
from thingc.joints import KINDS
from thingc.memo import Memo
from thingc.pose import MATE, Pose, Vector
from thingc.robot.types import Body, Closure, CoreJoint


def in_link(assembly: Assembly) -> tuple[Pose, ...]:
    """The pose of every occurrence in the frame of its link, in document order."""
    found = {member: pose for link in assembly.links for member, pose in zip(link.members, link.poses)}
    return tuple(found[index] for index in range(len(assembly.occurrences)))


def spanning(assembly: Assembly, mode: LinkedMode) -> frozenset[int]:
    """The numbers of the mates that a mode's tree crosses: all joints of a robot without loops, else Kruskal's maximal tree.

    Of a loop the joint is left out that is worth least in the tree: one that the mode's `cut` names, else one without a drive
    in this mode, that nothing mimics or follows, a turn before a slide (which few targets can close), one written as
    `loop: true` before another, the last of equals.
    """
    cut = {one.joint for one in mode.cut}
    joints = [(number, mate, mate.joint) for number, mate in enumerate(assembly.mates) if mate.joint is not None]
    coupled = {joint.mimic.joint for _, _, joint in joints if joint.mimic is not None}

    def worth(entry: tuple[int, Mate, JointEdge]) -> tuple[bool, bool, bool, bool, bool, int]:
        number, mate, joint = entry
        driven = joint.actuator is not None and (mode.actuators is None or joint.path in mode.actuators)
        coupling = joint.mimic is not None or joint.path in coupled
        slide = KINDS[joint.kind].core == "slide"
        return (joint.path in cut, not driven, not coupling, not slide, mate.loop is not None, number)

    group = list(range(len(assembly.links)))

    def find(k: int) -> int:
        while group[k] != k:
            group[k] = group[group[k]]
            k = group[k]
        return k

    taken: set[int] = set()
    for number, mate, _ in sorted(joints, key=worth):
        one, other = find(assembly.link_of[mate.parent]), find(assembly.link_of[mate.child])
        if one != other:
            group[max(one, other)] = min(one, other)
            taken.add(number)
    return frozenset(taken)


def placing(assembly: Assembly) -> frozenset[int]:
    """The numbers of the joints by which the documents place things: a tree that no mode has a say in."""
    return frozenset(n for n, mate in enumerate(assembly.mates) if mate.joint is not None and mate.loop is None)


def bodies_from(
    assembly: Assembly, start: int, taken: Collection[int], at: Pose, memo: Memo | None = None,
) -> tuple[Body, ...]:
    """The tree over the mates `taken`, depth first from link `start`, which is at `at`; children in the order of their links."""
    placed, memo = in_link(assembly), memo or Memo()
    edges: list[list[tuple[int, int]]] = [[] for _ in assembly.links]
    for number, mate in enumerate(assembly.mates):
        if number in taken:
            one, other = assembly.link_of[mate.parent], assembly.link_of[mate.child]
            edges[one].append((other, number))
            edges[other].append((one, number))
    bodies: list[Body] = []
    met: set[int] = set()
    waiting: list[tuple[int, int | None, int]] = [(start, None, -1)]
    while waiting:
        link, parent, number = waiting.pop()
        if link in met:
            continue
        met.add(link)
        if parent is None:
            bodies.append(Body(link=link, parent=None, X_PL=at, joint=None))
        else:
            mate = assembly.mates[number]
            bodies.append(_across(mate, number, parent, link, assembly.link_of[mate.parent] == link, placed, memo))
        here = len(bodies) - 1
        waiting.extend((there, here, along) for there, along in sorted(edges[link], reverse=True) if there not in met)
    return tuple(bodies)


def root_pose(assembly: Assembly, mode: LinkedMode) -> Pose:
    """The root link in the world: a component root laid with its origin on `at`, a mount root mated to it."""
    choice = mode.root
    X_WO = mode.at
    if choice.mount is not None:
        X_WO = mode.at @ MATE @ assembly.occurrences[choice.occurrence].mounts[choice.mount].pose.inverse()
    return X_WO @ in_link(assembly)[choice.occurrence].inverse()


def cut_closures(assembly: Assembly, bodies: tuple[Body, ...], taken: Collection[int]) -> tuple[Closure, ...]:
    """The loops that a tree leaves open: every joint that it does not cross, and `fixed` ones that close a loop."""
    placed = in_link(assembly)
    body_of = {body.link: index for index, body in enumerate(bodies)}
    found: list[Closure] = []
    for number, mate in enumerate(assembly.mates):
        if number in taken or (mate.joint is None and mate.loop is None):
            continue
        kind = KINDS[mate.joint.kind] if mate.joint is not None else None
        A = placed[mate.parent] @ mate.X_PJ
        if kind is not None and mate.joint is not None:
            A = A @ kind.motion(mate.joint.offset)
        path = mate.joint.path if mate.joint is not None else mate.loop or ""
        found.append(Closure(
            path=path, kind=(kind.core if kind is not None else None) or "weld", hold=False,
            parent=body_of[assembly.link_of[mate.parent]], child=body_of[assembly.link_of[mate.child]],
            X_PA=A, X_CB=placed[mate.child] @ mate.X_JC.inverse(), joint=mate.joint, origin=mate.origin,
        ))
    return tuple(found)


def _across(
    mate: Mate, number: int, parent: int, link: int, reversed_: bool, placed: tuple[Pose, ...], memo: Memo,
) -> Body:
    """The body beyond a joint."""
    joint = mate.joint
    if joint is None:
        raise ValueError("only a mate with a joint separates two links")
    kind = KINDS[joint.kind]
    at_zero, axis, frame = memo(
        ("across", joint.path, reversed_), _moved, placed[mate.parent], mate.X_PJ, mate.X_JC, placed[mate.child], joint.kind,
        joint.offset, reversed_,
    )
    return Body(link=link, parent=parent, X_PL=at_zero, joint=_core(joint, kind.core or "hinge", axis, frame, number, reversed_))


def _moved(
    parent: Pose, X_PJ: Pose, X_JC: Pose, child: Pose, kind: str, offset: float, reversed_: bool
) -> tuple[Pose, Vector, Pose]:
    """A joint's child link in its parent link at q = 0, its axis, and the frame whose origin the axis goes through; `parent` and
    `child` are the mated occurrences in their links. With F the joint's frame in the document's parent link and G the child link in the
    joint's moving frame, `X_parent_child(q) = F @ motion(q + offset) @ G`; reversed, the inverse of that.

    Forward the child turns about z of the moving frame, which `inv(G)` lays in the child's link. Backward the tree's
    child is the document's parent: it turns by -q about z of F, that is by q about -z, which F lays in that link.
    """
    F, G = parent @ X_PJ, X_JC @ child.inverse()
    at_zero = F @ KINDS[kind].motion(offset) @ G
    if reversed_:
        return at_zero.inverse(), _negated(_z(F)), F
    frame = G.inverse()
    return at_zero, _z(frame), frame


def _core(joint: JointEdge, core: str, axis: Vector, frame: Pose, number: int, reversed_: bool) -> CoreJoint:
    return CoreJoint(
        path=joint.path, kind=core, axis=axis, anchor=frame.translation, reversed=reversed_, offset=joint.offset,
        limit=joint.limit, dynamics=joint.dynamics, mimic=joint.mimic, actuator=joint.actuator, mate=number, origin=joint.origin,
    )


def _z(frame: Pose) -> Vector:
    r = frame.rotation
    return (r[0][2], r[1][2], r[2][2])


def _negated(v: Vector) -> Vector:
    return (0.0 - v[0], 0.0 - v[1], 0.0 - v[2])  # 0 - 0 is 0, where -0.0 would be written as such

"""Build the kinematic tree of a mode: the joints in the tree, the direction of each joint, and the loops that are cut."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from msgspec.structs import asdict

from thingc.base.joints.kinds import moving_as
from thingc.base.joints.twist import Twist, pose_after
from thingc.base.memo import Memo
from thingc.base.pose import MATE, NO_POSE, Pose
from thingc.model.assembly.types import Assembly, LinkedMode, Mate
from thingc.model.resolve.coordinates import CoordinateName, Dynamics, Limit
from thingc.model.robot.types import Body, Closure, TreeJoint

BASE = "root"
"""Name of the joint by which a moving base moves in the world. Joints in documents cannot have this name."""


def in_link(assembly: Assembly) -> tuple[Pose, ...]:
    """Return the pose of every occurrence (part, link or frame) in the frame of its link, in document order."""
    pose_of = {member: pose for link in assembly.links for member, pose in zip(link.members, link.poses)}
    return tuple(pose_of[index] for index in range(len(assembly.occurrences)))


def placing(assembly: Assembly) -> frozenset[int]:
    """Return the indices of the mates between links that place components, without mates that close loops.

    Such mates form the same tree in every mode.
    """
    return frozenset(n for n, mate in enumerate(assembly.mates) if mate.separates and mate.loop is None)


def bodies_from(assembly: Assembly, start: int, tree_mates: Collection[int], at: Pose, memo: Memo | None = None) -> tuple[Body, ...]:
    """Build the kinematic tree of all bodies that the mates in `tree_mates` connect, in depth-first order from the link `start`.

    `at` is the pose of the link `start` in the world.

    Children of a body are in the order of the links of the assembly. Children with a free joint come after all other bodies, because they
    are children of the world in MuJoCo models, and bodies have the order of these models.
    """
    placed, memo = in_link(assembly), memo or Memo()
    edges: list[list[tuple[int, int]]] = [[] for _ in assembly.links]
    for number, mate in enumerate(assembly.mates):
        if number in tree_mates:
            parent_link, child_link = assembly.link_of[mate.parent], assembly.link_of[mate.child]
            edges[parent_link].append((child_link, number))
            edges[child_link].append((parent_link, number))
    bodies: list[Body] = []
    visited: set[int] = set()
    waiting: list[tuple[int, int | None, int]] = [(start, None, -1)]
    free_children: list[tuple[int, int | None, int]] = []
    while waiting or free_children:
        link, parent, number = (waiting or free_children).pop()
        if link in visited:
            continue
        visited.add(link)
        if parent is None:
            bodies.append(Body(link=link, parent=None, X_PL=at, joints=()))
        else:
            mate = assembly.mates[number]
            bodies.append(_child_body(mate, number, parent, link, assembly.link_of[mate.parent] == link, placed, memo))
        index = len(bodies) - 1
        for neighbour, joint in sorted(edges[link], reverse=True):
            if neighbour not in visited:
                (free_children if assembly.mates[joint].free else waiting).append((neighbour, index, joint))
    return tuple(bodies)


def root_pose(assembly: Assembly, mode: LinkedMode) -> Pose:
    """Compute the pose of the root link of a mode in the world.

    If the root is a component, the origin of the component is at the pose `at` of the mode.

    If the root is a mount, the mount is mated to the pose `at`.
    """
    choice = mode.root
    X_WO = mode.at
    if not choice.of_component:
        X_WO = mode.at @ MATE @ choice.pose.inverse()
    return X_WO @ in_link(assembly)[choice.occurrence].inverse()


def base_moves(mode: LinkedMode, root: Pose) -> tuple[TreeJoint, ...]:
    """Return the joint coordinates of a `planar` or `ball` base.

    A planar base moves in the plane of `at`, and a ball base rotates about the origin of `at`. `root` is the pose of the root link. For all
    other bases, the result is empty.
    """
    kind = moving_as(mode.base)
    if kind is None:
        return ()
    twists = seen_at_zero(kind.twists, (0.0, 0.0, 0.0), root.inverse() @ mode.at)
    return tuple(
        TreeJoint(
            name=CoordinateName(f"{BASE}[{number}]"), kind=kind, twist=twist, offset=0.0, limit=Limit(), dynamics=Dynamics(), mimic=None,
            actuator=None, origin=mode.origin, reversed=False, mate=-1,
        )
        for number, twist in enumerate(twists)
    )


def cut_closures(assembly: Assembly, bodies: tuple[Body, ...], tree_mates: Collection[int]) -> Iterator[Closure]:
    """Yield a loop closure for each joint outside the kinematic tree, including `fixed` joints that close a loop."""
    placed = in_link(assembly)
    body_of = {body.link: index for index, body in enumerate(bodies)}
    for number, mate in enumerate(assembly.mates):
        if number in tree_mates or not mate.separates:
            continue
        twists, offsets = tuple(joint.twist for joint in mate.joints), tuple(joint.offset for joint in mate.joints)
        A = placed[mate.parent] @ mate.X_PJ
        yield Closure(
            path=mate.name or mate.loop or "", hold=False,
            parent=body_of[assembly.link_of[mate.parent]], child=body_of[assembly.link_of[mate.child]],
            X_PA=A @ pose_after(twists, offsets) if twists else A, X_CB=placed[mate.child] @ mate.X_JC.inverse(),
            joints=mate.joints, twists=seen_at_zero(twists, offsets, NO_POSE), origin=mate.origin,
        )


def _child_body(mate: Mate, number: int, parent: int, link: int, reversed_: bool, placed: tuple[Pose, ...], memo: Memo) -> Body:
    """Create the body on the other side of a mate, as a child of the body with the index `parent`."""
    twists, offsets = tuple(joint.twist for joint in mate.joints), tuple(joint.offset for joint in mate.joints)
    at_zero, moving = memo(
        ("across", mate.name, reversed_), _lower_joint, placed[mate.parent], mate.X_PJ, mate.X_JC, placed[mate.child], twists, offsets,
        reversed_,
    )
    pairs = zip(mate.joints[::-1] if reversed_ else mate.joints, moving, strict=True)
    return Body(link=link, parent=parent, X_PL=at_zero, mate=number, joints=tuple(
        TreeJoint(**{**asdict(joint), "twist": twist}, reversed=reversed_, mate=number) for joint, twist in pairs
    ))


def seen_at_zero(twists: tuple[Twist, ...], offsets: tuple[float, ...], frame: Pose) -> tuple[Twist, ...]:
    """Express a sequence of twists in a frame that moves with all twists. `frame` is the pose of this frame in the frame of the last twist.

    The twists are evaluated with all coordinates at 0, where each joint has moved by its offset. The pose `exp(t_0 (q_0 + o_0)) exp(t_1
    (q_1 + o_1)) ... @ inv(frame)` is its value at q = 0 times `exp(s_0 q_0) exp(s_1 q_1) ...`.
    """
    result: list[Twist] = []
    for twist, offset in zip(reversed(twists), reversed(offsets), strict=True):
        result.append(twist.seen_from(frame))
        frame = frame @ twist.exponential(-offset)
    return tuple(reversed(result))


def _lower_joint(
    parent: Pose, X_PJ: Pose, X_JC: Pose, child: Pose, twists: tuple[Twist, ...], offsets: tuple[float, ...], reversed_: bool,
) -> tuple[Pose, tuple[Twist, ...]]:
    """Return the pose of the child link of a joint in its parent link at q = 0, and the twists of the joint in the frame of the child.

    Parent and child are as in the tree. `parent` and `child` are the poses of the mated components in their links. Let F be the pose of the
    joint frame in the link of the document's parent. Let G be the pose of the child link in the moving frame of the joint. Then
    `X_parent_child(q) = F @ exp(t_0 (q_0 + o_0)) ... @ G`. A reversed joint has the inverse sequence: each twist is negated and in the
    frame of the document's parent, which is the child in the tree.
    """
    F, G = parent @ X_PJ, X_JC @ child.inverse()  # a ball has no offsets, because all its twists are in one frame
    at_zero = F @ pose_after(twists, offsets) @ G
    if not reversed_:
        return at_zero, seen_at_zero(twists, offsets, G.inverse())
    reversed_twists: list[Twist] = []
    frame = F
    for twist, offset in zip(twists, offsets, strict=True):
        reversed_twists.append(twist.seen_from(frame).inverse())
        frame = frame @ twist.exponential(offset)
    return at_zero.inverse(), tuple(reversed(reversed_twists))

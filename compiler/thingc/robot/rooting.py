"""The pass `root`: an assembly and a mode to the tree that a simulation model is written from."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.diagnostics import Code, Report
from thingc.graph import coordinates, joints_of
from thingc.graph.types import Assembly, JointEdge, LinkedMode, Mate
from thingc.joints import KINDS
from thingc.pose import MATE, Pose, Vector
from thingc.robot.types import Body, CoreJoint, Keyframe, Robot, Site


def root(assembly: Assembly, mode: LinkedMode, report: Report) -> Robot | None:
    """The robot of `mode`; None where a link cannot be reached from its root (said in `report`).

    The frames of bodies are the frames of their links, whatever the root; what depends on it is which end of a joint
    is the parent. Coordinates keep their meaning: q is the document's child relative to its parent.
    """
    start = assembly.link_of[mode.root.occurrence]
    bodies = _bodies(assembly, mode, start)
    if len(bodies) < len(assembly.links):
        reached = {body.link for body in bodies}
        missing = next(link for link in assembly.links if link.index not in reached)
        report.add(
            Code.UNREACHED, f"link `{missing.name}` does not hang together with the root of mode `{mode.name}`", missing.origin,
            path=missing.name, help="place its components on others that do",
        )
        return None
    body_of = {body.link: index for index, body in enumerate(bodies)}
    return Robot(
        name=assembly.name,
        mode=mode,
        assembly=assembly,
        base=mode.base,
        gravity=mode.gravity,
        bodies=bodies,
        sites=tuple(_sites(assembly, body_of)),
        excluded=_excluded(assembly, mode, body_of),
        keyframes=tuple(_keyframes(assembly, mode)),
        present=_present(assembly, mode),
        adhesion={adhesion.path: mode.adhesion.get(adhesion.path, 0.0) for adhesion in assembly.adhesions},
    )


def in_link(assembly: Assembly) -> tuple[Pose, ...]:
    """The pose of every occurrence in the frame of its link, in document order."""
    found = {member: pose for link in assembly.links for member, pose in zip(link.members, link.poses)}
    return tuple(found[index] for index in range(len(assembly.occurrences)))


def _bodies(assembly: Assembly, mode: LinkedMode, start: int) -> tuple[Body, ...]:
    """The spanning tree, depth first from link `start`, children in the order of their links."""
    placed = in_link(assembly)
    edges: list[list[tuple[int, int]]] = [[] for _ in assembly.links]
    for number, mate in enumerate(assembly.mates):
        if mate.joint is not None:
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
            bodies.append(Body(link=link, parent=None, X_PL=_root_pose(mode, assembly, placed), joint=None))
        else:
            mate = assembly.mates[number]
            bodies.append(_across(mate, number, parent, link, reversed_=assembly.link_of[mate.parent] == link, placed=placed))
        here = len(bodies) - 1
        waiting.extend((there, here, along) for there, along in sorted(edges[link], reverse=True) if there not in met)
    return tuple(bodies)


def _root_pose(mode: LinkedMode, assembly: Assembly, placed: tuple[Pose, ...]) -> Pose:
    """The root link in the world: a component root laid with its origin on `at`, a mount root mated to it."""
    choice = mode.root
    X_WO = mode.at
    if choice.mount is not None:
        X_WO = mode.at @ MATE @ assembly.occurrences[choice.occurrence].mounts[choice.mount].pose.inverse()
    return X_WO @ placed[choice.occurrence].inverse()


def _across(mate: Mate, number: int, parent: int, link: int, *, reversed_: bool, placed: tuple[Pose, ...]) -> Body:
    """The body beyond a joint. With F the joint's frame in the document's parent link and G the child link in the
    joint's moving frame, `X_parent_child(q) = F @ motion(q + offset) @ G`; reversed, the inverse of that.

    Forward the child turns about z of the moving frame, which `inv(G)` lays in the child's link. Backward the tree's
    child is the document's parent: it turns by -q about z of F, that is by q about -z, which F lays in that link.
    """
    joint = mate.joint
    if joint is None:
        raise ValueError("only a mate with a joint separates two links")
    kind = KINDS[joint.kind]
    F, G = placed[mate.parent] @ mate.X_PJ, mate.X_JC @ placed[mate.child].inverse()
    at_zero = F @ kind.motion(joint.offset) @ G
    if reversed_:
        at_zero, frame = at_zero.inverse(), F
        axis = _negated(_z(frame))
    else:
        frame = G.inverse()
        axis = _z(frame)
    return Body(link=link, parent=parent, X_PL=at_zero, joint=_core(joint, kind.core or "hinge", axis, frame, number, reversed_))


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


def _sites(assembly: Assembly, body_of: dict[int, int]) -> Iterator[Site]:
    """Exported mounts at every level, frames, and the roots of every mode, each name once."""
    placed = in_link(assembly)
    named: set[str] = set()
    wanted = [(mount.path, mount.occurrence, mount.mount, mount.origin) for mount in assembly.exported]
    wanted += [(o.path, o.index, "origin", o.origin) for o in assembly.occurrences if o.component.frame]
    wanted += [(m.root.path, m.root.occurrence, m.root.mount or "origin", m.origin) for m in assembly.modes]
    for path, occurrence, mount, origin in wanted:
        if path not in named:
            named.add(path)
            pose = placed[occurrence] @ assembly.occurrences[occurrence].mounts[mount].pose
            yield Site(path=path, body=body_of[assembly.link_of[occurrence]], pose=pose, origin=origin)


def _excluded(assembly: Assembly, mode: LinkedMode, body_of: dict[int, int]) -> tuple[tuple[int, int], ...]:
    """Neighbours through a joint, in the order of the joints, then the mode's own. Within a pair, and among pairs, the
    order is that of the links, so it is the same in every mode."""
    pairs: dict[tuple[int, int], None] = {}
    for mate in assembly.mates:
        if mate.joint is not None:
            one, other = assembly.link_of[mate.parent], assembly.link_of[mate.child]
            pairs[(min(one, other), max(one, other))] = None
    for one, other in mode.exclude:
        pairs[(min(one, other), max(one, other))] = None
    return tuple((body_of[one], body_of[other]) for one, other in pairs)


def _present(assembly: Assembly, mode: LinkedMode) -> tuple[str, ...]:
    """The joints whose actuators this mode has, in joint order."""
    chosen = None if mode.actuators is None else set(mode.actuators)
    driven = (joint.path for joint in joints_of(assembly) if joint.actuator is not None)
    return tuple(path for path in driven if chosen is None or path in chosen)


def _keyframes(assembly: Assembly, mode: LinkedMode) -> Iterator[Keyframe]:
    """The mode's poses in its order: q of every joint."""
    joints = joints_of(assembly)
    by_name = {pose.name: pose for pose in assembly.poses}
    for name in mode.poses:
        pose = by_name.get(name)
        if pose is not None:
            yield Keyframe(name=name, q=coordinates(joints, pose.values), origin=pose.origin)

"""Compute forward kinematics over the mate graph, starting from any placed component."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby

from thingc.base.joints.twist import pose_after, within_turn
from thingc.base.numeric import hypot
from thingc.base.pose import Pose
from thingc.model.assembly.types import Assembly, JointEdge, Mate


def joints_of(assembly: Assembly) -> tuple[JointEdge, ...]:
    """Return the coordinates of all joints of the assembly. Joints of a document precede joints of its nested documents."""
    return tuple(joint for mate in assembly.mates for joint in mate.joints)


def coordinates(joints: Iterable[JointEdge], values: Mapping[str, float]) -> dict[str, float]:
    """Return the positions q [rad or m] of all joints by path. Positions that `values` does not contain are computed from mimics, or are 0.

    If joints mimic each other in a cycle, which the pass `resolve` reports, all of these joints are at 0.
    """
    by_path = {joint.path: joint for joint in joints}
    positions: dict[str, float] = {}
    for path in by_path:
        chain: dict[str, None] = {}
        step = path
        while step not in positions:
            mimic = by_path[step].mimic
            if step in values or mimic is None or mimic.joint.path not in by_path or step in chain:
                positions[step] = values.get(step, 0.0)
                break
            chain[step] = None
            step = mimic.joint.path
        for follower in reversed(list(chain)):
            mimic = by_path[follower].mimic
            if mimic is not None and follower not in positions:
                positions[follower] = mimic.at(positions[mimic.joint.path])
    return {path: positions[path] for path in by_path}


def leaders(joints: Iterable[JointEdge], q: Mapping[str, float] | None = None) -> dict[str, tuple[str, float, float]]:
    """For each joint, return its leader, which is the joint that it mimics, and the multiplier and offset [rad or m].

    A joint that does not mimic another joint is its own leader. The position of a joint is q = offset + multiplier q(leader). For a chain
    of mimics, the leader is the last joint of the chain. The result is keyed by path, in the order of `joints`. Polynomials are linearized
    at `q`, which maps the paths of all joints to positions [rad or m]. By default, polynomials are linearized at the positions for which
    all leaders are at 0.
    """
    by_path = {joint.path: joint for joint in joints}
    if q is None:
        q = coordinates(by_path.values(), {}) if bent(by_path.values()) else dict.fromkeys(by_path, 0.0)
    followed: dict[str, tuple[str, float, float]] = {}
    for path, joint in by_path.items():
        leader, multiplier, offset, mimic = path, 1.0, 0.0, joint.mimic
        visited = [path]
        while mimic is not None and mimic.joint.path in by_path and mimic.joint.path not in visited:  # cycles are reported elsewhere
            slope, start = mimic.tangent(q[mimic.joint.path])
            offset += multiplier * start
            multiplier *= slope
            leader = mimic.joint.path
            visited.append(leader)
            mimic = by_path[leader].mimic
        followed[path] = leader, multiplier, offset
    return followed


def bent(joints: Iterable[JointEdge]) -> bool:
    """Return whether any joint mimics another joint by a nonlinear polynomial.

    If such a joint exists, the result of `leaders` depends on its argument `q`.
    """
    return any(joint.mimic is not None and joint.mimic.higher for joint in joints)


def across(mate: Mate, q: Mapping[str, float]) -> Pose:
    """Compute the pose of a mate's child occurrence in the frame of its parent occurrence.

    `q` maps joint paths to positions [rad or m]. Positions that are missing in `q` are 0.
    """
    if not mate.joints:
        return mate.X_PJ @ mate.X_JC
    values = tuple(q.get(joint.path, 0.0) + joint.offset for joint in mate.joints)
    return mate.X_PJ @ pose_after(tuple(joint.twist for joint in mate.joints), values, at_once=mate.joints[0].kind.at_once) @ mate.X_JC


def balls(joints: Iterable[JointEdge]) -> Iterator[tuple[JointEdge, ...]]:
    """Yield the three rotations of every ball joint and free joint. `joints` contains the coordinates of all joints of the robot."""
    rotations = (joint for joint in joints if joint.kind.at_once and joint.twist.turns)
    return (tuple(group) for _, group in groupby(rotations, key=lambda joint: joint.name.joint))


def in_cones(balls: Iterable[tuple[JointEdge, ...]], q: Mapping[str, float]) -> dict[str, float]:
    """Limit the rotation angle of every ball joint to half a turn and to the cone limit of the joint.

    Return the changed coordinates [rad] of ball joints by path.
    """
    angles: dict[str, float] = {}
    for ball in balls:
        x, y, z = within_turn((q[ball[0].path], q[ball[1].path], q[ball[2].path]))
        cone, angle = ball[0].limit.cone, hypot(x, y, z)
        scale = cone / angle if cone is not None and angle > cone else 1.0
        angles.update({ball[0].path: scale * x, ball[1].path: scale * y, ball[2].path: scale * z})
    return angles


def neighbourhood(count: int, mates: Sequence[Mate]) -> list[list[int]]:
    """Return the indices of the mates of each placed component. Mates that close loops are omitted, so the remaining mates form a tree."""
    neighbours: list[list[int]] = [[] for _ in range(count)]
    for number, mate in enumerate(mates):
        for end in {mate.parent, mate.child} if mate.loop is None else ():
            neighbours[end].append(number)
    return neighbours


def on_loops(count: int, mates: Sequence[Mate]) -> frozenset[str]:
    """Return the paths of all joints on kinematic loops, including the joints that close the loops."""
    closing = [mate for mate in mates if mate.loop is not None]
    if not closing:
        return frozenset()
    neighbours = neighbourhood(count, mates)
    predecessors: dict[int, tuple[int, int, int]] = {}  # for each occurrence: its predecessor, the mate to the predecessor, and its depth
    for start in range(count):
        if start in predecessors:
            continue
        predecessors[start] = (start, -1, 0)
        waiting = [start]
        while waiting:
            occurrence = waiting.pop()
            for number in neighbours[occurrence]:
                neighbour = mates[number].child if mates[number].parent == occurrence else mates[number].parent
                if neighbour not in predecessors:
                    predecessors[neighbour] = (occurrence, number, predecessors[occurrence][2] + 1)
                    waiting.append(neighbour)
    paths: set[str] = set()
    for mate in closing:
        paths.update(joint.path for joint in mate.joints)
        a, b = mate.parent, mate.child
        while a != b:
            if predecessors[a][2] < predecessors[b][2]:
                a, b = b, a
            a, number, _ = predecessors[a]
            if number < 0:
                break
            paths.update(joint.path for joint in mates[number].joints)
    return frozenset(paths)


def forward_kinematics(
    mates: Sequence[Mate], neighbours: Sequence[Sequence[int]], start: int, base: Pose, q: Mapping[str, float], *,
    rigid: bool = False,
) -> dict[int, Pose]:
    """Return the poses of all occurrences that are connected to the occurrence `start`, whose pose is `base`.

    `q` maps joint paths to positions [rad or m]. Positions that are missing in `q` are 0. If `rigid` is True, the search remains in the
    link of `start`. The results are in the same reference frame as `base`. The time is linear in the number of connected occurrences.
    """
    poses = {start: base}
    waiting = [start]
    while waiting:
        occurrence = waiting.pop()
        for number in neighbours[occurrence]:
            mate = mates[number]
            neighbour = mate.child if mate.parent == occurrence else mate.parent
            if neighbour in poses or (rigid and mate.separates):
                continue
            step = across(mate, q)
            poses[neighbour] = poses[occurrence] @ (step if mate.parent == occurrence else step.inverse())
            waiting.append(neighbour)
    return poses

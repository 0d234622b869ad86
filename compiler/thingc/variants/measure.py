"""What is worked out of every variant: closed formulas over the linked robot, a fraction of a millisecond each.

    mass, centre.x y z, inertia.xx ... yz   the whole robot at q = 0, in the base component's frame
    box.x y z                               sides of the box around all parts' boxes, along the world's axes
    reach                                   distance between the two mounts that the document names
    torque_margin                           least effort / |static torque| over all drives
    length.JOINT                            distance of a joint from the joint before it, as the documents have them

Box, reach and torques are of one mode, in one pose.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from thingc.graph import coordinates, joints_of
from thingc.graph.types import Assembly
from thingc.inertia import total
from thingc.pose import Pose, Vector, cross, dot, rotate
from thingc.robot.kinematics import placed_bodies
from thingc.robot.tree import in_link
from thingc.robot.types import Robot

Results = dict[str, float | None]
"""By name, SI; None (or absent) where a variant has not the result."""

NO_LOAD = 1e-12
"""Static torques [N m] or forces [N] below this are none."""


class UnknownMount(Exception):
    """A mount that the robot has not: `text` as the document names it."""

    def __init__(self, text: str, known: Sequence[str]) -> None:
        super().__init__(text)
        self.text = text
        self.known = tuple(known)


def measure(robot: Robot, pose: str | None, reach: tuple[str, str] | None) -> Results:
    """The results of one mode's robot in a pose of it (None: the mode's own, else q = 0).

    Where the mode's loops do not close in that pose, it has no box, reach and torques; with loops closed it has no torque margin
    (the torques depend on how the loops share the load). `reach` are the references of two mounts. Raises `UnknownMount`.
    """
    assembly = robot.assembly
    whole = total(link.properties.seen_from(assembly.rest[link.frame]) for link in assembly.links)
    results: Results = {"mass": whole.mass}
    results.update({f"centre.{axis}": value for axis, value in zip("xyz", whole.centre)})
    i = whole.inertia
    results.update({
        "inertia.xx": i[0][0], "inertia.yy": i[1][1], "inertia.zz": i[2][2],
        "inertia.xy": i[0][1], "inertia.xz": i[0][2], "inertia.yz": i[1][2],
    })
    results.update(lengths(assembly))
    ends = [_mount(assembly, text) for text in reach or ()]
    placed = _placed(robot, pose)
    if placed is None:
        return results
    q, bodies = placed
    at = {body.link: body_pose for body, body_pose in zip(robot.bodies, bodies)}
    within = in_link(assembly)
    occurrences = [at[link] @ inner for link, inner in zip(assembly.link_of, within)]
    box = bounding_box(assembly, occurrences)
    if box is not None:
        results.update({f"box.{axis}": high - low for axis, low, high in zip("xyz", *box)})
    if ends:
        (a, b), (c, d) = ends
        points = [(occurrences[a] @ _frame(assembly, a, b)).translation, (occurrences[c] @ _frame(assembly, c, d)).translation]
        results["reach"] = math.dist(*points)
    if not robot.closures:
        results["torque_margin"] = torque_margin(robot, q, bodies)
    return results


def _placed(robot: Robot, pose: str | None) -> tuple[dict[str, float], tuple[Pose, ...]] | None:
    """q of every joint and the poses of the bodies in the world; None for a pose in which the loops do not close."""
    name = pose if pose is not None else robot.mode.pose
    frame = next((one for one in robot.keyframes if one.name == name), None)
    if frame is not None:
        return dict(frame.q), placed_bodies(robot.bodies, frame.q, robot.bodies[0].X_PL if frame.base is None else frame.base)
    if robot.closures:
        return None
    named = next((one for one in robot.assembly.poses if one.name == name), None)
    q = coordinates(joints_of(robot.assembly), named.values if named is not None else {})
    return q, placed_bodies(robot.bodies, q, robot.bodies[0].X_PL)


def lengths(assembly: Assembly) -> Results:
    """`length.JOINT` [m] of every joint that has one before it: the distance of its parent mount from the mount by which the joint
    before placed that link. Parents and children are those of the documents, so it does not depend on a root."""
    poses = in_link(assembly)
    placed = {assembly.link_of[mate.child]: mate for mate in assembly.mates if mate.joint is not None and mate.loop is None}
    found: Results = {}
    for mate in assembly.mates:
        before = placed.get(assembly.link_of[mate.parent])
        if mate.joint is None or before is None or before is mate:
            continue
        here = poses[mate.parent].apply(mate.X_PJ.translation)
        there = poses[before.child].apply(before.X_JC.inverse().translation)
        found[f"length.{mate.joint.path.replace('/', '.')}"] = math.dist(here, there)
    return found


def bounding_box(assembly: Assembly, poses: Sequence[Pose]) -> tuple[Vector, Vector] | None:
    """Smallest and largest corner [m] of the box around the boxes of all parts placed at `poses` (by occurrence); None for a robot
    without geometry."""
    low, high = [math.inf] * 3, [-math.inf] * 3
    for occurrence, pose in zip(assembly.occurrences, poses, strict=True):
        box = occurrence.record.box if occurrence.record is not None else None
        if box is None:
            continue
        (ax, ay, az), (bx, by, bz) = box
        centre = pose.apply(((ax + bx) / 2.0, (ay + by) / 2.0, (az + bz) / 2.0))
        half = ((bx - ax) / 2.0, (by - ay) / 2.0, (bz - az) / 2.0)
        for k, row in enumerate(pose.rotation):
            size = abs(row[0]) * half[0] + abs(row[1]) * half[1] + abs(row[2]) * half[2]
            low[k] = min(low[k], centre[k] - size)
            high[k] = max(high[k], centre[k] + size)
    if low[0] > high[0]:
        return None
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


def static_torques(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose]) -> dict[str, float]:
    """What every joint has to hold [N m or N] while the robot stands still at `q`, its bodies at these poses in the world, its root
    held: the weight of everything behind the joint about its axis, and its spring. By joint path, positive along positive q.

    For the moments of weights about axes see Featherstone, Rigid Body Dynamics Algorithms, section 5.3 (inverse dynamics at
    rest).
    """
    count = len(robot.bodies)
    masses = [0.0] * count
    moments: list[Vector] = [(0.0, 0.0, 0.0)] * count
    for index in range(count - 1, -1, -1):
        body = robot.bodies[index]
        own = robot.assembly.links[body.link].properties
        x, y, z = bodies[index].apply(own.centre)
        mass = masses[index] = masses[index] + own.mass
        mx, my, mz = moments[index]
        moment = moments[index] = (mx + own.mass * x, my + own.mass * y, mz + own.mass * z)
        if body.parent is not None:
            masses[body.parent] += mass
            px, py, pz = moments[body.parent]
            moments[body.parent] = (px + moment[0], py + moment[1], pz + moment[2])
    found: dict[str, float] = {}
    for index, body in enumerate(robot.bodies):
        joint = body.joint
        if joint is None:
            continue
        axis = rotate(bodies[index].rotation, joint.axis)
        if joint.kind == "slide":
            weight = masses[index] * dot(axis, robot.gravity)
        else:
            p, s, m = bodies[index].apply(joint.anchor), moments[index], masses[index]
            arm = (s[0] - m * p[0], s[1] - m * p[1], s[2] - m * p[2])
            weight = dot(axis, cross(arm, robot.gravity))
        found[joint.path] = (joint.dynamics.stiffness or 0.0) * q[joint.path] - weight
    return found


def torque_margin(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose]) -> float | None:
    """The least ratio of a drive's effort to what it has to hold; `inf` where nothing loads a drive, None without drives that
    have an effort. Joints that mimic one another are held together, by all their drives."""
    torques = static_torques(robot, q, bodies)
    joints = {body.joint.path: body.joint for body in robot.bodies if body.joint is not None}
    load: dict[str, float] = {}
    effort: dict[str, float] = {}
    for path, joint in joints.items():
        leader, factor = joint, 1.0
        for _ in joints:  # no longer than all of them: circles are faults of the document
            if leader.mimic is None or leader.mimic.joint not in joints:
                break
            factor *= leader.mimic.multiplier
            leader = joints[leader.mimic.joint]
        load[leader.path] = load.get(leader.path, 0.0) + factor * torques[path]
        if path in robot.present and joint.actuator is not None and joint.actuator.effort is not None:
            effort[leader.path] = effort.get(leader.path, 0.0) + abs(factor) * joint.actuator.effort
    ratios = [most / abs(load[path]) if abs(load[path]) > NO_LOAD else math.inf for path, most in effort.items()]
    return min(ratios) if ratios else None


def _mount(assembly: Assembly, text: str) -> tuple[int, str]:
    """The occurrence and the mount that a reference means. Raises `UnknownMount`."""
    words = text.split(".")
    path = "/".join(words)
    for exported in assembly.exported:
        if exported.path == path:
            return exported.occurrence, exported.mount
    owner = "/".join(words[:-1])
    for occurrence in assembly.occurrences:
        if occurrence.path == owner and words[-1] in occurrence.mounts:
            return occurrence.index, words[-1]
    known = [one.path.replace("/", ".") for one in assembly.exported]
    known += [f"{one.path}.{mount}".replace("/", ".") for one in assembly.occurrences for mount in one.mounts if one.path == owner]
    raise UnknownMount(text, known)


def _frame(assembly: Assembly, occurrence: int, mount: str) -> Pose:
    return assembly.occurrences[occurrence].mounts[mount].pose

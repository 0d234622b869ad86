"""Compute the kinematics of a robot in one mode at given joint positions: poses, mass properties, and paths of tendons."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from thingc.base import numeric
from thingc.base.joints.twist import Twist, pose_after, velocities
from thingc.base.pose import Pose, Vector, dot
from thingc.model.assembly.kinematics import coordinates, joints_of
from thingc.model.assembly.tendon_paths import TendonCourse, course
from thingc.model.assembly.types import LinkedTendon
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Body, Robot, TreeJoint


def body_pose(body: Body, parent: Pose, q: Mapping[str, float]) -> Pose:
    """Compute the pose of a body from the pose `parent` of its parent body.

    `q` maps the paths of all joints to their positions [rad or m].
    """
    pose = parent @ body.X_PL
    if body.at_once:
        return pose @ pose_after(body.twists, tuple(q[joint.path] for joint in body.joints), at_once=True)
    for joint in body.joints:
        pose = pose @ joint.twist.exponential(q[joint.path])
    return pose


def in_world(body: Body, pose: Pose, q: Mapping[str, float]) -> Iterator[tuple[TreeJoint, Twist]]:
    """Yield the joint coordinates by which a body moves, from the last to the first, each with its twist in the world.

    The twists are in the reference frame of `pose`, the pose of the body. `q` contains the coordinates [rad or m] of all joints by path.
    """
    values = tuple(q[joint.path] for joint in body.joints)
    for number, twist in velocities(body.twists, values, pose, at_once=body.at_once):
        yield body.joints[number], twist


def with_ancestors(bodies: Sequence[Body], index: int | None) -> Iterator[int]:
    """Yield the index of a body and the indices of its ancestors in the tree, with the root last. For the world (None), yield nothing."""
    while index is not None:
        yield index
        index = bodies[index].parent


def body_poses(robot: Robot, q: Mapping[str, float], root: Pose | None = None) -> tuple[Pose, ...]:
    """Compute the poses of all bodies in the world, in the order of `robot.bodies`.

    `root` is the pose of the root link. By default, the mode specifies this pose.

    `q` maps joint paths to positions [rad or m]. Positions of joints that are not in `q` are computed from mimics, or are 0.
    """
    full = coordinates(joints_of(robot.assembly), q)
    return placed_bodies(robot.bodies, full, robot.bodies[0].X_PL if root is None else root)


def placed_bodies(bodies: Sequence[Body], q: Mapping[str, float], root: Pose) -> tuple[Pose, ...]:
    """Compute the poses of all bodies of a tree in the world.

    `root` is the pose of the root, and `q` maps the paths of all joints to positions [rad or m].
    """
    poses: list[Pose] = []
    for body in bodies:
        poses.append(root if body.parent is None else body_pose(body, poses[body.parent], q))
    return tuple(poses)


def occurrence_poses(robot: Robot, q: Mapping[str, float], root: Pose | None = None) -> tuple[Pose, ...]:
    """Compute the poses of all occurrences (parts, links and frames) in the world, in document order.

    The arguments have the same meaning as for `body_poses`.
    """
    at = {body.link: pose for body, pose in zip(robot.bodies, body_poses(robot, q, root))}
    assembly = robot.assembly
    return tuple(at[link] @ pose for link, pose in zip(assembly.link_of, in_link(assembly)))


def course_of(robot: Robot, tendon: LinkedTendon, bodies: Sequence[Pose]) -> TendonCourse:
    """Compute the length and the straight segments of a tendon in the world. `bodies` contains the poses of all bodies."""
    paths = {mount.path for mount in tendon.mounts}
    return course(tendon.steps, {site.path: bodies[site.body] @ site.pose for site in robot.sites if site.path in paths})


def rates(robot: Robot, tendon: LinkedTendon, q: Mapping[str, float], bodies: Sequence[Pose]) -> dict[str, float]:
    """Compute the derivatives of the length of a tendon with respect to the joint coordinates of the kinematic tree [m/rad or 1].

    `q` maps the paths of all joints to positions [rad or m].

    `bodies` contains the poses of all bodies in the world. If the length is a sum of joint coordinates, the derivatives are the factors of
    these coordinates. If the length is the length of a path, each derivative is a sum over the straight segments of the path. The tendon
    can slide on spheres and cylinders, so a sphere or cylinder is pulled by both adjacent segments.
    """
    if not tendon.steps:
        return dict(tendon.moves)
    body_of = {site.path: site.body for site in robot.sites}
    changes: dict[str, float] = {}
    for span in course_of(robot, tendon, bodies).spans:
        away: Vector = tuple(b - a for a, b in zip(*span.points, strict=True))  # type: ignore[assignment]
        far = numeric.sqrt(dot(away, away))
        for mount, point, sign in zip(span.ends, span.points, (-1.0, 1.0), strict=True):
            for index in with_ancestors(robot.bodies, body_of[mount.path] if far > 0.0 else None):
                for joint, twist in in_world(robot.bodies[index], bodies[index], q):
                    rate = sign * dot(away, twist.velocity(point)[0]) / (far * span.divisor)
                    changes[joint.path] = changes.get(joint.path, 0.0) + rate
    return changes

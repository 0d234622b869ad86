"""Tendons on paths in a robot with a root: how long they are, and by how much each joint changes that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from thingc.base import numeric
from thingc.base.pose import Pose, Vector, dot
from thingc.model.assembly.tendon_paths import TendonCourse, course
from thingc.model.assembly.types import LinkedTendon
from thingc.model.robot.kinematics import in_world
from thingc.model.robot.types import Robot


def course_of(robot: Robot, tendon: LinkedTendon, bodies: Sequence[Pose]) -> TendonCourse:
    """Its course in the world, the bodies of the robot at these poses there."""
    wanted = {mount.path for mount in tendon.mounts}
    return course(tendon.steps, {site.path: bodies[site.body] @ site.pose for site in robot.sites if site.path in wanted})


def rates(robot: Robot, tendon: LinkedTendon, q: Mapping[str, float], bodies: Sequence[Pose]) -> dict[str, float]:
    """By how much it gets longer per unit of each coordinate of the tree [m/rad or 1], at `q` (every joint by path), the bodies at these
    poses in the world: of one over joints its factors, of one on a path the sum over its straight pieces of how fast their ends part.
    Where it lies on a shape it slides, and its pull there is that of the pieces that come and go."""
    if not tendon.steps:
        return dict(tendon.moves)
    body_of = {site.path: site.body for site in robot.sites}
    changes: dict[str, float] = {}
    for span in course_of(robot, tendon, bodies).spans:
        away: Vector = tuple(b - a for a, b in zip(*span.points, strict=True))  # type: ignore[assignment]
        far = numeric.sqrt(dot(away, away))
        for mount, point, sign in zip(span.ends, span.points, (-1.0, 1.0), strict=True):
            index: int | None = body_of[mount.path] if far > 0.0 else None
            while index is not None:
                body = robot.bodies[index]
                for joint, twist in in_world(body, bodies[index], q):
                    rate = sign * dot(away, twist.velocity(point)[0]) / (far * span.divisor)
                    changes[joint.path] = changes.get(joint.path, 0.0) + rate
                index = body.parent
    return changes

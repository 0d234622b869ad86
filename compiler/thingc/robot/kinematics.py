"""What a robot with a root says of itself: poses of its bodies and parts at given coordinates, and its mass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from thingc.graph import coordinates, joints_of
from thingc.inertia import MassProperties, total
from thingc.pose import NO_POSE, Pose, rotate, turned_about
from thingc.robot.tree import in_link
from thingc.robot.types import Body, CoreJoint, Robot


def motion(joint: CoreJoint, q: float) -> Pose:
    """The child link's pose at `q` [rad or m] in its own frame at q = 0: a turn about, or a shift along, the axis."""
    if joint.kind == "slide":
        x, y, z = joint.axis
        return Pose(translation=(x * q, y * q, z * q))
    rotation, a = turned_about(joint.axis, q), joint.anchor
    moved = rotate(rotation, a)
    return Pose(rotation=rotation, translation=(a[0] - moved[0], a[1] - moved[1], a[2] - moved[2]))


def body_poses(robot: Robot, q: Mapping[str, float], root: Pose | None = None) -> tuple[Pose, ...]:
    """The pose of every body in the world, in body order; the root is where the mode puts it unless `root` says.

    `q` [rad or m] by joint path; a joint that is not named follows the one it mimics, else it is at 0.
    """
    full = coordinates(joints_of(robot.assembly), q)
    return placed_bodies(robot.bodies, full, robot.bodies[0].X_PL if root is None else root)


def placed_bodies(bodies: Sequence[Body], q: Mapping[str, float], root: Pose) -> tuple[Pose, ...]:
    """The pose of every body of a tree in the world, its root at `root`; `q` [rad or m] of every joint by path."""
    found: list[Pose] = []
    for body in bodies:
        if body.parent is None or body.joint is None:
            found.append(root)
        else:
            found.append(found[body.parent] @ body.X_PL @ motion(body.joint, q[body.joint.path]))
    return tuple(found)


def occurrence_poses(robot: Robot, q: Mapping[str, float], root: Pose | None = None) -> tuple[Pose, ...]:
    """The pose of every occurrence in the world, in document order; arguments as of `body_poses`."""
    at = {body.link: pose for body, pose in zip(robot.bodies, body_poses(robot, q, root))}
    assembly = robot.assembly
    return tuple(at[link] @ pose for link, pose in zip(assembly.link_of, in_link(assembly)))


def mass_properties(robot: Robot, q: Mapping[str, float]) -> MassProperties:
    """Of the whole robot at `q`, in the frame of its root link: mass [kg], centre [m], inertia [kg m^2] about it."""
    links = robot.assembly.links
    placed = body_poses(robot, q, NO_POSE)
    return total(links[body.link].properties.seen_from(pose) for body, pose in zip(robot.bodies, placed))


def link_names(robot: Robot) -> tuple[str, ...]:
    """The names of the bodies, in body order."""
    return tuple(robot.assembly.links[body.link].name for body in robot.bodies)


def joint_names(robot: Robot) -> tuple[str, ...]:
    """The paths of the joints, in body order."""
    return tuple(body.joint.path for body in robot.bodies if body.joint is not None)

"""Compute how the floor supports a robot with a free base: the feet, their velocities relative to joint speeds, and the support polygon."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from thingc.base.numeric import dist, hypot, inf, maximum, minimum, sum_of
from thingc.base.pose import Pose, Vector
from thingc.model.robot.kinematics import in_world, with_ancestors
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Robot

LEVEL = 0.02
"""Largest height at which a foot still stands on the floor, measured above the lowest foot and relative to the largest distance between two
feet.
"""


class FootContact(NamedTuple):
    """A foot at the position `point` [m] in the world, on which the floor pushes upwards.

    `moves` maps joint paths to the velocity of the foot per speed of the joint [m/rad or 1]. `pull` is the force [N] by which the foot
    adheres to the floor.
    """

    path: str
    point: Vector
    moves: dict[str, Vector]
    friction: float
    pull: float


class Support(NamedTuple):
    """The feet and the weight of a robot with a free base on the floor.

    `origin` is the position of the root link [m], `centre` is the position of the centre of mass [m], and `weight` is the weight [N], all
    in the world.
    """

    feet: tuple[FootContact, ...]
    origin: Vector
    centre: Vector
    weight: Vector


def stance(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose]) -> Support:
    """Compute the feet and the weight of a robot at the joint positions `q`.

    `q` maps the paths of all joints to positions [rad or m], and `bodies` contains the poses of all bodies in the world.
    """
    carried = [index for index, carrier in enumerate(robot.carriers) if carrier == 0]
    masses = [robot.assembly.links[robot.bodies[index].link].properties for index in carried]
    mass = sum_of(own.mass for own in masses)
    centres = [bodies[index].apply(own.centre) for own, index in zip(masses, carried, strict=True)]
    x, y, z = (sum_of(own.mass * centre[k] for own, centre in zip(masses, centres, strict=True)) / mass for k in range(3))
    gx, gy, gz = robot.gravity
    return Support(
        feet=tuple(_footings(robot, q, bodies)), origin=bodies[0].translation, centre=(x, y, z), weight=(mass * gx, mass * gy, mass * gz),
    )


def _footings(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose]) -> Iterator[FootContact]:
    assembly, placed = robot.assembly, in_link(robot.assembly)
    body_of = {body.link: index for index, body in enumerate(robot.bodies)}
    pulls = {(magnet.occurrence, magnet.mount): robot.adhesion.get(magnet.path, 0.0) for magnet in assembly.adhesions}
    for foot in robot.mode.feet:
        choice = foot.mount
        own = body_of[assembly.link_of[choice.occurrence]]
        point = bodies[own].apply((placed[choice.occurrence] @ choice.pose).translation)
        moves = {
            joint.path: twist.velocity(point)[0] for body in with_ancestors(robot.bodies, own)
            for joint, twist in in_world(robot.bodies[body], bodies[body], q)
        }
        yield FootContact(choice.path, point, moves, foot.friction, pulls.get((choice.occurrence, choice.mount), 0.0))


def lifted_feet(feet: Sequence[FootContact]) -> dict[str, float]:
    """Return the feet that are so far above the lowest foot that they cannot stand on the same floor.

    The result maps the path of each such foot to its height [m] above the lowest foot.
    """
    lowest = minimum((foot.point[2] for foot in feet), default=0.0)
    widest = maximum((dist(a.point, b.point) for a in feet for b in feet), default=0.0)
    return {foot.path: foot.point[2] - lowest for foot in feet if foot.point[2] - lowest > LEVEL * widest}


def outside(stance: Support) -> float:
    """Compute the distance [m] from the support polygon to the centre of mass, which is projected onto the floor along gravity.

    The distance is 0 inside the polygon, and infinite if gravity does not pull towards the floor.
    """
    if stance.weight[2] >= -1e-9 * hypot(*stance.weight):
        return inf
    floor = sum_of(foot.point[2] for foot in stance.feet) / len(stance.feet)
    down = (floor - stance.centre[2]) / stance.weight[2]
    x, y = stance.centre[0] + down * stance.weight[0], stance.centre[1] + down * stance.weight[1]
    corners = polygon([(foot.point[0] - x, foot.point[1] - y) for foot in stance.feet])
    edges = list(zip(corners, [*corners[1:], *corners[:1]], strict=True))
    if len(corners) > 2 and all(a[0] * b[1] - a[1] * b[0] >= 0.0 for a, b in edges):
        return 0.0
    return minimum(_from_origin(a, b) for a, b in edges)


Point = tuple[float, float]


def polygon(points: Sequence[Point]) -> list[Point]:
    """Compute the corners of the convex hull of points in the plane, counter-clockwise, by Andrew's monotone chain (1979)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    halves: list[list[Point]] = []
    for way in (ordered, ordered[::-1]):
        half: list[Point] = []
        for point in way:
            while len(half) > 1 and _turn(half[-2], half[-1], point) <= 0.0:
                half.pop()
            half.append(point)
        halves.append(half[:-1])
    return halves[0] + halves[1]


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _from_origin(a: Point, b: Point) -> float:
    """Compute the distance from the origin to the line segment between the points a and b."""
    along = (b[0] - a[0], b[1] - a[1])
    length = along[0] ** 2 + along[1] ** 2
    part = 0.0 if length == 0.0 else minimum(maximum(-(a[0] * along[0] + a[1] * along[1]) / length, 0.0), 1.0)
    return hypot(a[0] + part * along[0], a[1] + part * along[1])

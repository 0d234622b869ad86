"""How large a robot is. Of no target."""

from __future__ import annotations

from collections.abc import Sequence

from thingc.base.numeric import inf, maximum, minimum
from thingc.base.pose import NO_POSE, Pose, Vector
from thingc.model.robot.types import Robot

Box = tuple[Vector, Vector]
"""Two corners [m], the lower one first."""


def placements(robot: Robot) -> tuple[tuple[tuple[int | None, Pose], ...], tuple[tuple[tuple[Pose, Box | None], ...], ...]]:
    """Of every body its parent and its pose there, and of every body the poses and boxes of its parts."""
    links, occurrences = robot.assembly.links, robot.assembly.occurrences
    boxes = tuple(one.box for one in occurrences)
    return tuple((body.parent, body.X_PL) for body in robot.bodies), tuple(
        tuple((pose, boxes[member]) for member, pose in zip(links[body.link].members, links[body.link].poses, strict=True))
        for body in robot.bodies
    )


def bounds(
    bodies: Sequence[tuple[int | None, Pose]], parts: Sequence[Sequence[tuple[Pose, Box | None]]]
) -> Box | None:
    """The box [m] around the robot in the world at q = 0, from its parts' boxes (see `placements`); None without geometry. Of a turned
    box a coordinate is least where each of the three terms that it is the sum of is (Arvo, "Transforming axis-aligned bounding boxes",
    Graphics Gems, 1990)."""
    low, high = [inf] * 3, [-inf] * 3
    poses: list[Pose] = []
    for (parent, X_PL), inside in zip(bodies, parts, strict=True):
        at = (NO_POSE if parent is None else poses[parent]) @ X_PL
        poses.append(at)
        for pose, box in inside:
            if box is None:
                continue
            placed = at @ pose
            for axis, (row, origin) in enumerate(zip(placed.rotation, placed.translation, strict=True)):
                ends = [(a * one, a * other) for a, one, other in zip(row, *box, strict=True)]
                low[axis] = minimum(low[axis], minimum(ends[0]) + minimum(ends[1]) + minimum(ends[2]) + origin)
                high[axis] = maximum(high[axis], maximum(ends[0]) + maximum(ends[1]) + maximum(ends[2]) + origin)
    if low[0] > high[0]:
        return None
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])

"""What drives have to give against gravity and springs while nothing moves, and their margins.

The coordinates of a robot are the joints that follow none. With Q what gravity and springs do on them, C the derivative of the
loops' closing conditions and N a basis of what they leave free, the efforts t of the drives S balance it where

    N' (Q + S t) = 0

A tree has no C: every coordinate is balanced by the drives on it, in closed form. Loops, holds and feet on the floor share the load by
least squares (`statics/shared.py`, which alone needs numpy). Dry friction in joints holds nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from thingc.graph import joints_of, leaders
from thingc.pose import Pose
from thingc.robot.types import Robot
from thingc.statics.loads import loads

NO_LOAD = 1e-12
"""Static efforts [N m or N] below this are none."""


class Drive(NamedTuple):
    """The drive of joint `path`: it moves `factor` times as fast as the coordinate `leader`, the path of the joint that it is or
    follows. `limit` is its limit of effort [N m or N]; `weight` what its effort is weighed by, 1 without a limit above 0."""

    path: str
    leader: str
    factor: float
    limit: float | None
    weight: float


class Fall(NamedTuple):
    """Why the floor does not carry a robot on its feet, whatever its drives give: it `tips`, with its centre of mass `outside` [m] of
    the polygon of the feet, it `slides`, or gravity `pulls` it off."""

    how: str
    outside: float


class Efforts(NamedTuple):
    """What each drive gives [N m or N], by joint path, positive along positive q; `margins` are of those with a limit of effort.

    Where there is more than one answer (two held feet, two drives on a loop, two joints that mimic one another) it is the one
    with the least sum of squares of effort by limit; `choices` says how many directions it was chosen from. `unheld` is the
    greatest load that no drive balances, as a part of the greatest load, at the coordinate `where` (empty without any, and for the
    base of a robot that floats); `fall` says that no drives could keep it on its feet.
    """

    by_joint: dict[str, float]
    margins: dict[str, float]
    unheld: float
    where: str
    choices: int
    fall: Fall | None = None

    @property
    def least_margin(self) -> float | None:
        """The least of the margins; None where no drive has a limit."""
        return min(self.margins.values(), default=None)


def static_efforts(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose]) -> Efforts:
    """What the drives of a mode have to give for it to stay at `q` (every joint by path, rad or m; loops closed), its bodies at
    these poses in the world. A base that floats is carried by the mode's feet and holds; one that has neither, as any other, is held."""
    load, drives = problem(robot, q, bodies)
    if not robot.closures and not robot.carried:
        return balance_tree(load, drives)
    from thingc.statics.shared import balance_shared

    return balance_shared(robot, q, bodies, load, drives)


def problem(robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose]) -> tuple[dict[str, float], list[Drive]]:
    """The load to balance [N m or N], by coordinate, and the mode's drives, in joint order; arguments as of `static_efforts`."""
    joints = joints_of(robot.assembly)
    on_joints = loads(robot, q, bodies)
    load: dict[str, float] = {}
    drives: list[Drive] = []
    following = leaders(joints)
    for joint in joints:
        path, limit = joint.path, joint.limit.effort
        leader, factor, _ = following[path]
        load[leader] = load.get(leader, 0.0) + factor * on_joints[path]
        if path in robot.present:
            drives.append(Drive(path, leader, factor, limit, limit or 1.0))
    return load, drives


def balance_tree(load: Mapping[str, float], drives: Sequence[Drive]) -> Efforts:
    """The efforts on a robot without loops; `load` [N m or N] by coordinate.

    Of drives on one coordinate, with factors f and weights l, the least sum of (t / l)^2 with sum f t = -Q is at
    t = -Q f l^2 / sum (f l)^2.
    """
    total: dict[str, float] = {}
    for _, leader, factor, _, weight in drives:
        total[leader] = total.get(leader, 0.0) + (factor * weight) ** 2
    efforts: dict[str, float] = {}
    for path, leader, factor, _, weight in drives:
        share = (factor * weight) ** 2
        # A drive alone has a share of 1, exactly; one that does not move with its coordinate holds nothing.
        efforts[path] = 0.0 - load[leader] * (share / total[leader]) / factor if share > 0.0 else 0.0
    held = {leader for leader, value in total.items() if value > 0.0}
    unheld, where = 0.0, next(iter(load), "")
    for path, value in load.items():
        if path not in held and abs(value) > unheld:
            unheld, where = abs(value), path
    greatest = max(map(abs, load.values()), default=0.0)
    return answer(drives, efforts, greatest, unheld, where, len(drives) - len(held))


def answer(
    drives: Iterable[Drive], efforts: dict[str, float], greatest: float, unheld: float, where: str, choices: int,
    fall: Fall | None = None,
) -> Efforts:
    """The efforts found, with their margins; `unheld` [N m or N] of the load, which is `greatest` somewhere, is left at `where`."""
    margins = {path: margin(limit, efforts[path]) for path, _, _, limit, _ in drives if limit is not None}
    return Efforts(efforts, margins, unheld / greatest if unheld else 0.0, where, choices, fall)


def margin(limit: float, effort: float) -> float:
    """A drive's limit by what it gives [both N m or N]; `inf` where it gives nothing."""
    return limit / abs(effort) if abs(effort) > NO_LOAD else math.inf

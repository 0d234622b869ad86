"""Data types for the results of statics: drives, their efforts and margins, and the reason why a robot falls."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from thingc.base import numeric

NO_LOAD = 1e-12
"""Static efforts [N m or N] below this value count as 0."""


class DriveTransmission(NamedTuple):
    """The transmission from the drive of a joint to joint coordinates. It contains the speed of the drive per speed of each coordinate.

    The drive of a ball joint has three coordinates. Other drives have one coordinate: the coordinate of the joint or of its leader. `limit`
    is the effort limit [N m or N]. `weight` scales the effort in least squares, and is 1 without a limit above 0.
    """

    path: str
    moves: tuple[tuple[str, float], ...]
    limit: float | None
    weight: float


class Topple(NamedTuple):
    """The reason why the floor cannot support a robot on its feet with any efforts of its drives.

    The robot `tips`, with its centre of mass `outside` [m] the support polygon, it `slides`, or gravity `pulls` it off.
    """

    how: str
    outside: float


class Efforts(NamedTuple):
    """The efforts of drives [N m or N] by joint path, positive along positive q.

    `margins` contains the torque or force margin of each drive with an effort limit.

    If there are several solutions (two held feet, two drives on a loop, two coupled joints), `Efforts` contains the solution with the least
    sum of squares of effort divided by limit. `choices` is the dimension of the space of solutions. `unheld` is the largest load that no
    drive balances, relative to the largest load. `where` is the coordinate of this load (empty if all loads are balanced, and for a load on
    the free base). `fall` is set if the robot would fall off its feet with any efforts.
    """

    by_joint: dict[str, float]
    margins: dict[str, float]
    unheld: float
    where: str
    choices: int
    fall: Topple | None = None

    @property
    def least_margin(self) -> float | None:
        """The smallest margin of all drives, or None if no drive has an effort limit."""
        return numeric.minimum(self.margins.values(), default=None)


def answer(
    drives: Iterable[DriveTransmission], efforts: dict[str, float], greatest: float, unheld: float, where: str, choices: int,
    fall: Topple | None = None,
) -> Efforts:
    """Create the result of a statics computation from drive efforts.

    The load `unheld` [N m or N] at the coordinate `where` is not balanced. `greatest` is the largest load.
    """
    margins = {path: margin(limit, efforts[path]) for path, _, limit, _ in drives if limit is not None}
    return Efforts(efforts, margins, unheld / greatest if unheld else 0.0, where, choices, fall)


def margin(limit: float, effort: float) -> float:
    """Return the ratio of a drive's limit to its effort (both in [N m] or [N]). The ratio is `inf` if the effort is 0."""
    return limit / abs(effort) if abs(effort) > NO_LOAD else numeric.inf

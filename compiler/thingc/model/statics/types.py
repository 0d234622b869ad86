"""Data types for the results of statics: drives, their efforts and margins, and the reason why a robot falls."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from thingc.base import numeric

NO_LOAD = 1e-12
"""Static efforts [N m or N] below this value count as 0."""


class DriveTransmission(NamedTuple):
    """The transmission between the drive of a joint and the joint coordinates: the speed of the drive per speed of each coordinate.

    A drive of a ball joint acts on three coordinates. All other drives act on one coordinate: the coordinate of the joint, or of the joint
    that it mimics. `limit` is the effort limit [N m or N]. `weight` is the scale of the effort in least squares. The weight is 1 if the
    drive does not have a limit above 0.
    """

    path: str
    moves: tuple[tuple[str, float], ...]
    limit: float | None
    weight: float


class Topple(NamedTuple):
    """The reason why a robot on feet falls, whatever the efforts of its drives.

    The kind is `tips` if the centre of mass is `outside` [m] the support polygon, `slides` if the robot slides, or `pulls` if gravity pulls
    the robot off the floor.
    """

    how: str
    outside: float


class Efforts(NamedTuple):
    """The efforts of drives [N m or N] by joint path. A positive effort acts in the direction of positive q.

    `margins` contains the ratio of limit to effort for each drive with an effort limit.

    The efforts may be ambiguous, for example for two held feet, two drives on a loop, or two coupled joints. Then the solution with the
    least sum of squares of effort divided by limit is used. `choices` is the dimension of the space of solutions. `unheld` is the largest
    load that no drive balances, as a fraction of the largest load. `where` is the coordinate with this load. `where` is empty if all loads
    are balanced, or if the load acts on the free base. `fall` is the reason if the robot would fall off its feet, whatever the efforts.
    """

    by_joint: dict[str, float]
    margins: dict[str, float]
    unheld: float
    where: str
    choices: int
    fall: Topple | None = None

    @property
    def least_margin(self) -> float | None:
        """The smallest torque or force margin of all drives, or None if no drive has an effort limit."""
        return numeric.minimum(self.margins.values(), default=None)


def answer(
    drives: Iterable[DriveTransmission], efforts: dict[str, float], greatest: float, unheld: float, where: str, choices: int,
    fall: Topple | None = None,
) -> Efforts:
    """Create an `Efforts` result from drive efforts.

    `unheld` is a load [N m or N] at the coordinate `where` that is not balanced. `greatest` is the largest load on any coordinate.
    """
    margins = {path: margin(limit, efforts[path]) for path, _, limit, _ in drives if limit is not None}
    return Efforts(efforts, margins, unheld / greatest if unheld else 0.0, where, choices, fall)


def margin(limit: float, effort: float) -> float:
    """Return the ratio of the limit of a drive to its effort (both in [N m] or [N]). If the effort is 0, the ratio is infinite."""
    return limit / abs(effort) if abs(effort) > NO_LOAD else numeric.inf

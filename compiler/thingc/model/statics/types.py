"""Results of statics: drives, their efforts and margins, and the reason for a fall."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from thingc.base import numeric

NO_LOAD = 1e-12
"""Static efforts [N m or N] below this value count as 0."""


class DriveTransmission(NamedTuple):
    """The transmission of the drive of joint `path`: the speed of the drive per speed of each coordinate.

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
    """Efforts of drives [N m or N] by joint path, positive along positive q. `margins` contains the drives with an effort limit.

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
        """The smallest margin, or None if no drive has a limit."""
        return numeric.minimum(self.margins.values(), default=None)


def answer(
    drives: Iterable[DriveTransmission], efforts: dict[str, float], greatest: float, unheld: float, where: str, choices: int,
    fall: Topple | None = None,
) -> Efforts:
    """Return the efforts with their margins. The load `unheld` [N m or N] (at most `greatest`) is not balanced at `where`."""
    margins = {path: margin(limit, efforts[path]) for path, _, limit, _ in drives if limit is not None}
    return Efforts(efforts, margins, unheld / greatest if unheld else 0.0, where, choices, fall)


def margin(limit: float, effort: float) -> float:
    """Return the ratio of a drive's limit to its effort (both in [N m] or [N]). The ratio is `inf` if the effort is 0."""
    return limit / abs(effort) if abs(effort) > NO_LOAD else numeric.inf

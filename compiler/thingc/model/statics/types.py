"""What statics answers with: drives, their efforts and margins, and why a robot falls."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from thingc.base import numeric

NO_LOAD = 1e-12
"""Static efforts [N m or N] below this are none."""


class DriveTransmission(NamedTuple):
    """The drive of joint `path`: how fast it moves by the speed of each coordinate, of the one that the joint is or follows, or where it
    turns a ball about an axis of all three. `limit` is its limit of effort [N m or N]; `weight` what its effort is weighed by, 1 without a
    limit above 0."""

    path: str
    moves: tuple[tuple[str, float], ...]
    limit: float | None
    weight: float


class Topple(NamedTuple):
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
    fall: Topple | None = None

    @property
    def least_margin(self) -> float | None:
        """The least of the margins; None where no drive has a limit."""
        return numeric.minimum(self.margins.values(), default=None)


def answer(
    drives: Iterable[DriveTransmission], efforts: dict[str, float], greatest: float, unheld: float, where: str, choices: int,
    fall: Topple | None = None,
) -> Efforts:
    """The efforts found, with their margins; `unheld` [N m or N] of the load, which is `greatest` somewhere, is left at `where`."""
    margins = {path: margin(limit, efforts[path]) for path, _, limit, _ in drives if limit is not None}
    return Efforts(efforts, margins, unheld / greatest if unheld else 0.0, where, choices, fall)


def margin(limit: float, effort: float) -> float:
    """A drive's limit by what it gives [both N m or N]; `inf` where it gives nothing."""
    return limit / abs(effort) if abs(effort) > NO_LOAD else numeric.inf

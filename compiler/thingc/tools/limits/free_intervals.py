"""Find the intervals of a joint in which no parts touch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, remainder, tau

import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.model.solids.clearance import ComparedPair, Place, Sweep, prove
from thingc.model.solids.contact_cells import divide

COARSE = 16.0
"""Length of the shortest interval that is surely found, relative to the accuracy of the ends of intervals."""


class FreeIntervals(FrozenStruct):
    """The intervals [rad or m] of a joint in which no parts touch, in ascending order.

    `blocked` contains positions outside the intervals, each with the pair that touches there (None: a loop does not close). `proved` is
    False if some pairs were compared only in samples. Positions that differ by a multiple of `period` are the same (infinite: no period).
    """

    period: float
    intervals: tuple[tuple[float, float], ...]
    blocked: tuple[tuple[float, ComparedPair | None], ...]
    proved: bool

    def around(self, q: float, width: float) -> tuple[float, float] | None:
        """Return the interval that contains `q`, or begins or ends within `width` of it."""
        return next((one for one in self.intervals if one[0] - width <= q <= one[1] + width), None)

    def contact(self, q: float, width: float) -> ComparedPair | None:
        """Return the pair that touches at the blocked position next to `q`, or None if it is farther than `width`."""
        near = ((abs(remainder(at - q, self.period)), pair) for at, pair in self.blocked)
        return min((one for one in near if one[0] <= width), key=lambda one: one[0], default=(q, None))[1]


def free_intervals(sweep: Sweep, pairs: Sequence[ComparedPair], width: float) -> FreeIntervals:
    """Return the intervals of a sweep of one joint in which no pair touches.

    The ends of the intervals are at most `width` [rad or m] from the nearest position in which parts touch or are closer than the errors of
    their meshes. Intervals that are shorter than `COARSE` times this distance can be missing. Pairs that are in contact in all positions
    are compared in samples. If the robot repeats after a turn of the joint, an interval can extend beyond the range of the sweep, and
    intervals that are connected across the ends of the range are one interval.
    """
    prove(sweep, [pair for pair in pairs if not divide(sweep, pair)])
    search = _Search(sweep, [pair for pair in pairs if pair.verdict in ("touches", "undecided")], width)
    free: list[tuple[float, float]] = []
    one = sweep.ranges[0]
    waiting = [((one.lower + one.upper) / 2.0, (one.upper - one.lower) / 2.0)]
    while waiting:
        middle, half = waiting.pop()
        if search.is_free(middle, half):
            free.append((free.pop()[0] if free and free[-1][1] >= middle - half - 1e-9 else middle - half, middle + half))
        elif 2.0 * half > COARSE * width:
            waiting += [(middle + half / 2.0, half / 2.0), (middle - half / 2.0, half / 2.0)]
    period = tau if free and _repeats(sweep) else inf
    first, last = (free[-1][1] - tau, free[0][0] + tau) if period == tau else (one.lower, one.upper)
    grown: list[tuple[float, float]] = []
    for low, high in free:
        low, high = search.advance(low, -1.0, first), search.advance(high, 1.0, last)
        grown.append((grown.pop()[0] if grown and grown[-1][1] >= low - 1e-9 else low, high))
    if len(grown) > 1 and grown[-1][1] - period >= grown[0][0] - 1e-9:
        (_, high), *between, (low, _) = grown
        up = period if low <= (one.lower + one.upper) / 2.0 + width else 0.0
        grown = sorted([(low - period + up, high + up), *between])
    if grown and grown[0][1] - grown[0][0] >= period - 1e-9:
        grown, search.blocked = [(one.lower, one.upper)], []
    certain = all(pair.method == "proved" and pair.verdict in ("clear", "touches", "undecided") and pair.apart for pair in pairs)
    return FreeIntervals(period=period, intervals=tuple(grown), blocked=tuple(search.blocked), proved=certain)


def _repeats(sweep: Sweep) -> bool:
    """Return whether the range of a sweep is one turn, and the robot is the same at positions that differ by one turn."""
    one = sweep.ranges[0]
    if abs(one.upper - one.lower - tau) > 1e-9:
        return False
    for q in (one.lower, one.lower + 1.0, one.lower + 2.0):
        places = [place for at in (q, q + tau) if (place := sweep.place({0: at})) is not None]
        poses = [np.array([body.rows() for body in place.bodies]) for place in places]
        if len(poses) < 2 or not np.allclose(poses[0], poses[1], rtol=0.0, atol=1e-6):
            return False
    return True


class _Search:
    """A search for positions of a joint in which no pair of `pairs` touches, with the positions in which a pair touches (`blocked`)."""

    def __init__(self, sweep: Sweep, pairs: Sequence[ComparedPair], width: float) -> None:
        self._sweep, self._pairs, self._width = sweep, list(pairs), width
        self.blocked: list[tuple[float, ComparedPair | None]] = []

    def is_free(self, middle: float, half: float) -> bool:
        """Return whether no pair touches within `half` of a position."""
        place = self._sweep.place({0: middle})
        steps = self._sweep.steps(place, {0: middle}, {0: half}) if place is not None else {}
        for number, pair in enumerate(self._pairs):
            if place is None or not self._is_clear(place, pair, half, steps):
                self._pairs.insert(0, self._pairs.pop(number))  # this pair is likely to touch in the next position, too
                self.blocked.append((middle, pair if place is not None else None))
                return False
        return True

    def advance(self, end: float, sign: float, last: float) -> float:
        """Move an end of a free interval towards `last` as far as no pair touches, and return it."""
        step = COARSE * self._width
        while step > self._width / 4.0 and end != last:
            step = min(step, abs(last - end))
            if self.is_free(end + sign * step / 2.0, step / 2.0):
                end = last if step == abs(last - end) else end + sign * step
            else:
                step /= 2.0
        return end

    def _is_clear(self, place: Place, pair: ComparedPair, half: float, steps: Mapping[str, float]) -> bool:
        if not pair.apart:
            return 2.0 * half <= COARSE * self._width and place.overlap(pair)[1] <= pair.deep
        within = pair.floor + place.travel(pair, steps)
        return place.gap(pair, within) >= within

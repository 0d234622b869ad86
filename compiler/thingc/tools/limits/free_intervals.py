"""Find the intervals of a joint in which no parts touch."""

from __future__ import annotations

from collections.abc import Sequence

from thingc.base.frozen_struct import FrozenStruct
from thingc.model.solids.clearance import ComparedPair, Place, Sweep, prove
from thingc.model.solids.contact_cells import divide


class FreeIntervals(FrozenStruct):
    """The intervals [rad or m] of a joint in which no parts touch, in ascending order.

    `blocked` contains positions outside the intervals, each with the pair that touches there (None: a loop does not close). `proved` is
    False if some pairs were compared only in samples.
    """

    intervals: tuple[tuple[float, float], ...]
    blocked: tuple[tuple[float, ComparedPair | None], ...]
    proved: bool

    def around(self, q: float, width: float) -> tuple[float, float] | None:
        """Return the interval that contains `q`, or begins or ends within `width` of it."""
        return next((one for one in self.intervals if one[0] - width <= q <= one[1] + width), None)

    def contact(self, q: float, width: float) -> ComparedPair | None:
        """Return the pair that touches at a blocked position within `width` of `q`, or None."""
        return next((pair for at, pair in self.blocked if abs(at - q) <= width), None)


def free_intervals(sweep: Sweep, pairs: Sequence[ComparedPair], width: float) -> FreeIntervals:
    """Return the intervals of a sweep of one joint in which no pair touches.

    The ends of the intervals are at most `width` [rad or m] from the nearest position in which parts touch or are closer than the errors of
    their meshes. Pairs that are in contact in all positions are compared in samples at this distance.
    """
    prove(sweep, [pair for pair in pairs if not divide(sweep, pair)])
    active = [pair for pair in pairs if pair.verdict in ("touches", "undecided")]
    free: list[tuple[float, float]] = []
    blocked: list[tuple[float, ComparedPair | None]] = []
    one = sweep.ranges[0]
    waiting = [((one.lower + one.upper) / 2.0, (one.upper - one.lower) / 2.0)]
    while waiting:
        middle, half = waiting.pop()
        place = sweep.place({0: middle})
        left = sorted(active, key=lambda pair: pair is not (blocked[-1][1] if blocked else None))  # the last contact is likely to remain
        pair = next((pair for pair in left if place is None or not _is_free(sweep, place, pair, middle, half, width)), None)
        if pair is None:
            free.append((free.pop()[0] if free and free[-1][1] >= middle - half - 1e-9 else middle - half, middle + half))
        elif 2.0 * half > width:
            waiting += [(middle + half / 2.0, half / 2.0), (middle - half / 2.0, half / 2.0)]
        else:
            blocked.append((middle, pair if place is not None else None))
    certain = all(pair.method == "proved" and pair.verdict in ("clear", "touches", "undecided") and pair.apart for pair in pairs)
    return FreeIntervals(intervals=tuple(free), blocked=tuple(blocked), proved=certain)


def _is_free(sweep: Sweep, place: Place, pair: ComparedPair, middle: float, half: float, width: float) -> bool:
    """Return whether a pair does not touch within `half` of a position."""
    if not pair.apart:
        return 2.0 * half <= width and place.overlap(pair)[1] <= pair.deep
    within = pair.floor + place.travel(pair, sweep.steps(place, {0: middle}, {0: half}))
    return place.gap(pair, within) >= within

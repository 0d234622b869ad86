"""Compare pairs of shapes in boxes of joint positions, to prove that they stay apart while joints move.

When joints move, the distance of two shapes decreases at most by the longest path of any point of one shape relative to the other. If the
distance in the middle of a box of joint positions is greater than the longest such path to the border of the box, the shapes do not touch
anywhere in the box. Other boxes are halved. See Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996 (conservative
advancement), and Schwarzer, Saha and Latombe, "Exact collision checking of robot paths", 2004.

This module measures no distances: subclasses of `Place` do, for exact shapes or in a model of MuJoCo.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from thingc.base.numeric import inf

FINE = 1e-5
"""Resolution [m]: a box is not halved if no point of a shape moves by more than this distance relative to the other shape."""
SKIN = 1e-6
"""Smallest mean thickness [m] of an intersection that counts as more than contact."""
TOUCH = 1e-9
"""Rounding error of distances [m]."""
ALWAYS = 32
"""Number of positions after which two shapes that have never been apart count as touching in all positions."""
MOST = 20_000
"""Largest number of positions at which two shapes are compared."""
UNCLOSED = 64.0
"""A box in whose middle the loops do not close is halved until its width is the range divided by this number."""

Array = NDArray[np.float64]


@dataclass(eq=False)
class ComparedPair:
    """A comparison of two shapes: their indices, and the result.

    `error` is the sum of the errors [m] of their surfaces. `joined` pairs are on links that a joint connects, and may touch. All other
    pairs must be at least `clearance` [m] apart. Intersections are errors if their mean thickness is above `deep` [m]. `gap` is the
    smallest distance that was found, in the positions `q`; `depth` and `volume` describe the intersection in these positions. `method` is
    how the result was found. `seen` is the number of compared positions. `found` is True after a collision was found, and `near` if some
    box of positions could not be decided. If the shapes have not been `apart` in the first `patience` positions, they count as touching in
    all positions.
    """

    one: int
    other: int
    error: float = 0.0
    joined: bool = False
    clearance: float = 0.0
    deep: float = 0.0
    patience: int = ALWAYS
    method: Literal["proved", "followed", "sampled"] = "proved"
    gap: float = inf
    depth: float = 0.0
    volume: float = 0.0
    q: Mapping[str, float] = field(default_factory=dict)
    found: bool = False
    apart: bool = False
    near: bool = False
    seen: int = 0
    until_contact: bool = False

    @property
    def floor(self) -> float:
        """The distance [m] above which the shapes are clear."""
        return self.clearance + (TOUCH if self.joined else self.error + SKIN)

    @property
    def done(self) -> bool:
        """Whether more positions would not change the result."""
        contact = self.gap < (self.error + SKIN if self.seen == 1 else TOUCH)
        return self.found or self.seen >= (MOST if self.apart else self.patience) or (self.until_contact and contact)

    @property
    def verdict(self) -> Literal["clear", "touches", "contact", "undecided"]:
        """The result. Shapes are in `contact` if a joint connects their links and they touch without an intersection."""
        if self.found or (self.apart and self.depth > SKIN + self.error):
            return "touches"
        if not self.near and not self.done:
            return "clear"
        return "undecided" if not self.joined or self.seen >= MOST or (self.apart and self.depth > SKIN) else "contact"


Pair = TypeVar("Pair", bound=ComparedPair)


def sphere_bounds(twists: Array, order: NDArray[np.int64], steps: Array, centres: Array, radii: Array) -> tuple[Array, Array]:
    """Return a lower bound of the distance [m] of each of n pairs, and the longest path [m] of a point of one shape relative to the other.

    The `twists` of the joints in the world `(m, 3, 3)` are a point [m], the angular velocity, and the velocity of this point. Joints move
    by at most `steps` `(m,)` [rad or m]. `order` `(k, n)` contains the joints between the shapes, in order from the first shape to the
    second shape (-1: none). The shapes are in spheres with the `centres` `(2, n, 3)` and `radii` `(2, n)` [m]. The joints move one after
    another, from a joint in the middle outwards to each shape. The distance of a shape from the axis of a joint is therefore its current
    distance, and the best joint in the middle is used.
    """
    points, turns, slides = np.moveaxis(twists[order], 2, 0)
    speeds = np.linalg.norm(np.cross(turns, centres[:, None] - points) + slides, axis=3) + np.linalg.norm(turns, axis=2) * radii[:, None]
    paths = np.zeros((2, len(order) + 1, order.shape[1]))
    np.cumsum(speeds * np.where(order >= 0, steps[order], 0.0), axis=1, out=paths[:, 1:])
    first, second = paths
    return np.linalg.norm(centres[0] - centres[1], axis=1) - radii.sum(axis=0), (first + second[-1] - second).min(axis=0)


class Place(ABC, Generic[Pair]):
    """The shapes of a robot at the positions `q` [rad or m] of its joints."""

    q: Mapping[str, float]

    @abstractmethod
    def bounds(self, pairs: Sequence[Pair], half: Array) -> tuple[Array, Array]:
        """Return a lower bound of the distance [m] of each pair, and the longest path [m] of a point of one shape relative to the other, in
        a box with the half widths `half`.
        """

    @abstractmethod
    def gap(self, pair: Pair, within: float) -> float:
        """Return the distance [m] between two shapes, or `within` if the distance is greater."""

    def overlap(self, pair: Pair) -> tuple[float, float]:
        """Return the volume [m^3] and the mean thickness [m] of the intersection of two shapes, if these are measured."""
        return 0.0, 0.0

    def compare(self, pair: Pair, within: float, bound: float = 0.0) -> float:
        """Measure the distance [m] of two shapes up to `within`, or their intersection, and record the result in the pair.

        `bound` is a lower bound of the distance.
        """
        clear_gap = pair.clearance + pair.error + SKIN
        within = max(within, clear_gap + TOUCH)
        gap = self.gap(pair, within) if bound < within else within
        volume, depth = self.overlap(pair) if gap <= 0.0 and pair.clearance == 0.0 else (0.0, 0.0)
        pair.seen += 1
        pair.apart |= gap > clear_gap
        pair.found |= gap < pair.clearance - TOUCH if pair.clearance > 0.0 else depth > pair.deep
        if gap < within and (depth, -gap) > (pair.depth, -pair.gap):
            pair.gap, pair.depth, pair.volume, pair.q = gap, depth, volume, self.q
        return gap


Places = Callable[[Array, Mapping[str, float] | None], Place[Pair] | None]
"""Returns the robot with its joints at positions `(n,)` [rad or m], or None if its loops do not close. The second argument contains the
positions from which the loops are closed.
"""


def compare_in_boxes(places: Places[Pair], middle: Array, half: Array, pairs: list[Pair]) -> Iterator[tuple[list[Pair], list[Pair]]]:
    """Compare pairs in all positions of a box, whose half widths are `half`, and record the results in the pairs.

    Yield the pairs of each box that was compared, and the pairs that are undecided in it, which are then compared in both of its halves.
    """
    whole = np.maximum(half, TOUCH)
    waiting: deque[tuple[Array, Array, list[Pair], Mapping[str, float] | None]] = deque([(middle, half, pairs, None)])
    while waiting:
        middle, half, pairs, start = waiting.popleft()
        undecided, widest = [pair for pair in pairs if not pair.done], int((half / whole).argmax())
        place, start = places(middle, start) if undecided else None, None
        if place is not None:
            undecided, start = [*_compare_pairs(place, undecided, half)], place.q
            if undecided and np.count_nonzero(half) > 1:
                widest = int(np.argmax([place.bounds(undecided[:1], side)[1][0] for side in np.diag(half)]))
        elif (half / whole).max() <= 2.0 / UNCLOSED:
            undecided = []
        width = np.where(np.arange(len(whole)) == widest, half / 2.0, 0.0)
        waiting += [(middle + sign * width, half - width, undecided, start) for sign in (-1.0, 1.0) if undecided]
        yield pairs, undecided


def _compare_pairs(place: Place[Pair], pairs: Sequence[Pair], half: Array) -> Iterator[Pair]:
    """Compare pairs in the middle of a box, and yield those that are not decided in the box."""
    for pair, bound, path in zip(pairs, *(values.tolist() for values in place.bounds(pairs, half)), strict=True):
        gap = place.compare(pair, pair.floor + path, bound)
        fine = FINE if gap > TOUCH else max(FINE, pair.deep / 2.0)  # shapes in contact then overlap by less than an error
        if gap >= pair.floor + path:
            continue
        if path <= fine or (gap >= pair.clearance + path and (gap < pair.floor or pair.near)):
            pair.near = True
        else:
            yield pair

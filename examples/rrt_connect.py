"""RRT-Connect: find a path between two points among obstacles with two random trees that grow towards each other.

J. Kuffner and S. LaValle, RRT-Connect: An efficient approach to single-query path planning, ICRA 2000.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Clear = Callable[[Array, Array], bool]
"""A function that returns whether the straight line between two points is free of obstacles."""

STEP = 0.3
"""Largest distance between a point of a tree and its parent."""


@dataclass(slots=True, kw_only=True)
class Tree:
    """A tree of points that grows in free space. Each point except the first has a parent."""

    points: list[Array]
    parents: list[int]

    def grow(self, target: Array, clear: Clear) -> bool:
        """Add a point in the direction of `target`, at most `STEP` away from the nearest point of the tree. Return whether the line to the
        new point is free of obstacles.
        """
        nearest = int(np.argmin([np.linalg.norm(point - target) for point in self.points]))
        begin = self.points[nearest]
        step = target - begin
        new = begin + step * min(1.0, STEP / max(float(np.linalg.norm(step)), 1e-12))
        if not clear(begin, new):
            return False
        self.points.append(new)
        self.parents.append(nearest)
        return True

    def reach(self, target: Array, clear: Clear) -> bool:
        """Extend the tree towards `target` until the tree reaches it or an obstacle blocks the line."""
        while self.grow(target, clear):
            if np.array_equal(self.points[-1], target):
                return True
        return False

    def branch(self) -> list[Array]:
        """Return the points on the branch from the root of the tree to the newest point."""
        found, at = [], len(self.points) - 1
        while at >= 0:
            found.append(self.points[at])
            at = self.parents[at]
        return found[::-1]


def connect(begin: Array, end: Array, lower: Array, upper: Array, clear: Clear, rng: np.random.Generator, tries: int) -> list[Array] | None:
    """Return points of a path from `begin` to `end` without obstacles. Return None if no path is found after `tries` random targets."""
    if clear(begin, end):
        return [begin, end]
    one, two = (Tree(points=[point], parents=[-1]) for point in (begin, end))
    for _ in range(tries):
        if one.grow(rng.uniform(lower, upper), clear) and two.reach(one.points[-1], clear):
            found = one.branch() + two.branch()[-2::-1]
            return found if np.array_equal(found[0], begin) else found[::-1]
        one, two = two, one
    return None


def shorten(path: list[Array], clear: Clear) -> list[Array]:
    """Remove detours from a path: from each point, continue to the last point that a straight line reaches without obstacles."""
    found, at = [path[0]], 0
    while at < len(path) - 1:
        at = next(k for k in range(len(path) - 1, at, -1) if k == at + 1 or clear(path[at], path[k]))
        found.append(path[at])
    return found

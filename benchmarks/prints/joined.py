"""Compute the constant `JOINED` of `thingc.geometry.worker.kernel.slicing`: the fraction of the border of sparse infill along which
PrusaSlicer joins infill lines.

In a sparse region, infill lines end at the border. PrusaSlicer's setting `connect_infill` joins the ends. First, PrusaSlicer closes gaps
between two neighbouring ends that are both free, the shortest gap first. After that, each remaining end is joined to its nearer neighbour.
The simulation uses a long straight border and families of parallel lines. The simulation averages over all angles between border and lines,
and over all offsets of the lines.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

FAMILIES = {"grid": (0.0, 90.0), "stars": (0.0, 60.0, 120.0)}
"""Directions of the infill lines [deg] for each pattern."""


def joined(ends: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    """Return the fraction of a border along which lines are joined. `ends` (n,) contains the positions at which lines end on the border, in
    ascending order.
    """
    gaps = np.diff(ends)
    free = np.ones(len(ends), dtype=bool)
    found = 0.0
    for index in np.argsort(gaps):
        if free[index] and free[index + 1]:
            free[index : index + 2] = False
            found += gaps[index]
    for index in np.flatnonzero(free[1:-1]) + 1:
        found += min(gaps[index - 1], gaps[index])
    return float(found / gaps.sum())


def share(families: tuple[float, ...], directions: int, lines: int, seed: int) -> float:
    """Return the mean joined fraction over `directions` angles. The border is so long that a family of lines at right angles would cross it
    `lines` times.
    """
    rng = np.random.default_rng(seed)
    shares = []
    for angle in np.pi * (np.arange(directions) + rng.uniform()) / directions:
        ends = []
        for family in families:
            apart = 1.0 / max(abs(np.sin(angle + np.radians(family))), 1e-3)
            ends.append(np.arange(rng.uniform(0.0, apart), lines, apart))
        shares.append(joined(np.sort(np.concatenate(ends))))
    return float(np.mean(shares))


def main() -> None:
    """Print the joined fraction for each pattern."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--directions", type=int, default=720)
    arguments = parser.parse_args()
    for pattern, families in FAMILIES.items():
        print(f"{pattern:12} {share(families, arguments.directions, 1000, seed=7):.3f}")


if __name__ == "__main__":
    main()

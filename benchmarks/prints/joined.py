"""The share of the border of sparse infill along which PrusaSlicer joins its lines: `JOINED` in `thingc.geometry.worker.kernel.slicing`.

Lines of infill end at the border. Its rule [connect_infill]: gaps between neighbouring ends are closed, the shortest first, if both ends
are free; then each remaining end is joined to the nearer neighbour. This simulates a long straight border, families of parallel lines at a
distance, all angles between border and families, and all offsets of the lines.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

FAMILIES = {"grid": (0.0, 90.0), "stars": (0.0, 60.0, 120.0)}
"""The directions of lines [deg] of patterns."""


def joined(ends: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    """Return the joined share of a border on which lines end at these positions (n,), ascending."""
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
    """Return the mean over `directions` of a border that `lines` lines of a family would cross at right angles."""
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
    """Print the share for each pattern."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--directions", type=int, default=720)
    arguments = parser.parse_args()
    for pattern, families in FAMILIES.items():
        print(f"{pattern:12} {share(families, arguments.directions, 1000, seed=7):.3f}")


if __name__ == "__main__":
    main()

"""Estimate the support that a print needs: the space between surfaces that are too flat to print on air and the surface below them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from thingc.base.pose import Vector

STEEPEST = math.cos(math.radians(45.0)) + 1e-3
"""A surface needs support if its normal points down by more than this: if it is flatter than 45 degrees."""

CELLS = 150
"""Number of cells along the longer side of a part, in which the height below a surface is measured."""

ON_BED = 0.01
"""Surfaces up to this height rest on the bed [mm]."""

DIRECTIONS = 8
"""Number of directions that are compared: those in which the largest faces of the convex hull rest on the bed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintSupport:
    """The area [mm^2] of the surfaces that need support, and the volume [mm^3] of the space below them."""

    area: float
    volume: float


def support_of(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> PrintSupport:
    """Measure the support of a print on a bed at z = 0 [mm].

    The area is the sum of the triangles. The volume is a sum over vertical lines through a grid of cells: a surface that needs support is
    supported from the next surface below it, or from the bed.
    """
    corners = vertices[faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(doubled, axis=1)
    down = -doubled[:, 2] / np.where(sizes > 0.0, sizes, 1.0)
    hanging = (down > STEEPEST) & (corners[:, :, 2].max(axis=1) > ON_BED)
    step = float(max(vertices[:, 0].max(), vertices[:, 1].max())) / CELLS
    cells, heights, kinds = [], [], []
    for triangle, one_down, hangs in zip(corners, down, hanging, strict=True):
        found, z = _crossed_cells(triangle, step)
        cells.append(found)
        heights.append(z)
        kinds.append(np.full(len(z), 2 if hangs else int(one_down > 0.0)))
    cell, height, kind = np.concatenate(cells), np.concatenate(heights), np.concatenate(kinds)
    order = np.lexsort((height, cell))
    cell, height, kind = cell[order], height[order], kind[order]
    below = np.where((cell == np.roll(cell, 1)) & (np.arange(len(cell)) > 0), np.roll(height, 1), 0.0)
    return PrintSupport(area=float(sizes[hanging].sum()) / 2.0, volume=float((height - below)[kind == 2].sum()) * step * step)


def _crossed_cells(triangle: NDArray[np.float64], step: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the cells whose vertical lines cross a triangle, and the heights. The lines avoid corners with round coordinates."""
    shift = step * 0.4142135
    low = np.floor((triangle[:, :2].min(axis=0) - shift) / step).astype(int)
    high = np.ceil((triangle[:, :2].max(axis=0) - shift) / step).astype(int)
    i, j = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1), indexing="ij")
    points = np.stack([i, j], axis=-1) * step + shift
    (a, b, c), origin = triangle[:, :2], triangle[0, :2]
    sides = np.column_stack([b - a, c - a])
    if abs(np.linalg.det(sides)) < 1e-12:  # vertical
        return np.empty(0, dtype=int), np.empty(0)
    weights = (points - origin) @ np.linalg.inv(sides).T
    inside = (weights >= 0.0).all(axis=-1) & (weights.sum(axis=-1) <= 1.0)
    z = triangle[0, 2] + weights[inside] @ (triangle[1:, 2] - triangle[0, 2])
    return (i[inside] * 1_000_000 + j[inside]).astype(int), z


def directions(vertices: NDArray[np.float64]) -> list[Vector]:
    """Return unit vectors that point away from the bed, if the part rests on one of the largest faces of its convex hull."""
    hull = ConvexHull(vertices)
    corners = vertices[hull.simplices]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    total: dict[Vector, float] = {}
    for normal, area in zip(hull.equations[:, :3].round(4) + 0.0, areas, strict=True):
        x, y, z = (float(-part) + 0.0 for part in normal)
        total[x, y, z] = total.get((x, y, z), 0.0) + float(area)
    return sorted(total, key=lambda up: (-round(total[up], 3), up))[:DIRECTIONS]

"""Distances between surfaces of boxes, for which the distance is known."""

from __future__ import annotations

import math
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from thingc.geometry.store.local import Store
from thingc.tools.diff.surface_distance import SurfaceDistances, surface_distances

FACES = (
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
)


def box(store: Store, half: tuple[float, float, float], at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> str:
    """A box in the store, in the format in which the worker writes meshes."""
    corners = [[c + s * h for c, s, h in zip(at, signs, half, strict=True)] for signs in product((-1, 1), repeat=3)]
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES]
    return store.put(("\n".join(lines) + "\n").encode())


@pytest.mark.parametrize(("half", "at", "expected"), [
    ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0), 0.0),
    ((1.0, 1.0, 1.0), (0.3, 0.0, 0.0), 0.3),  # a face sticks out
    ((1.5, 1.0, 1.0), (0.0, 0.0, 0.0), 0.5),
    ((1.5, 1.5, 1.5), (0.0, 0.0, 0.0), math.sqrt(0.75)),  # a corner from a corner
    ((0.1, 0.1, 0.1), (0.0, 0.0, 0.0), math.sqrt(3 * 0.9**2)),
    ((1.0, 1.0, 1.0), (10.0, 0.0, 0.0), 10.0),
])
def test_farthest_box_distance(tmp_path: Path, half: tuple[float, float, float], at: tuple[float, float, float], expected: float) -> None:
    store = Store(str(tmp_path))
    old, new = box(store, (1.0, 1.0, 1.0)), box(store, half, at)
    assert SurfaceDistances(store).farthest(old, new) == pytest.approx(expected, abs=1e-12)
    assert SurfaceDistances(store).farthest(new, old) == pytest.approx(expected, abs=1e-12)  # now from the store


def test_distances_of_small_triangles_are_exact() -> None:
    """Points around a triangle of 0.1 mm: above its inside, beside an edge, and beyond a corner."""
    triangle = 5e-5 * np.array([[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]])
    points = 5e-5 * np.array([[0.5, 0.6, 0.01], [1.5, 1.0, 0.0], [1.0, -0.02, 0.0], [-0.03, -0.04, 0.0], [2.5, 0.0, 0.0]])
    expected = 5e-5 * np.array([0.01, 0.5 / math.sqrt(2.0), 0.02, 0.05, 0.5])
    assert surface_distances(points, triangle) == pytest.approx(expected, abs=1e-12)


def test_distances_of_many_triangles_equal_those_of_each_triangle() -> None:
    generator = np.random.default_rng(0)
    size = 10.0 ** generator.uniform(-3.0, 0.0, (300, 1, 1))
    triangles = generator.uniform(-1.0, 1.0, (300, 1, 3)) + size * generator.uniform(-1.0, 1.0, (300, 3, 3))
    points = generator.uniform(-1.5, 1.5, (700, 3))
    each = [surface_distances(points, triangle[None]) for triangle in triangles]
    assert surface_distances(points, triangles) == pytest.approx(np.min(each, axis=0), abs=1e-12)


def test_missing_mesh_has_no_distance(tmp_path: Path) -> None:
    store = Store(str(tmp_path))
    assert SurfaceDistances(store).farthest(box(store, (1.0, 1.0, 1.0)), "0" * 64) is None

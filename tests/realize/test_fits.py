"""The smallest enclosing ball of points that are almost coplanar."""

from __future__ import annotations

import math

import numpy as np
import pytest

from thingc.geometry.worker.kernel.bounding_primitives import smallest_ball


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-10, 1e-8])
def test_smallest_ball_of_nearly_planar_circle(off: float) -> None:
    """Four points of a rotated circle, each slightly off it, have no well-defined ball in double precision. The smallest ball of all
    points is still that of the circle, within that tolerance."""
    rng = np.random.default_rng(5)
    angles = np.linspace(0.0, 2.0 * math.pi, 96, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros(96)], axis=1)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    for _ in range(20):
        points = 0.02 * (circle + off * rng.normal(size=circle.shape)) @ turn
        centre, radius = smallest_ball(points)
        assert radius == pytest.approx(0.02, rel=1e-14 + 6.0 * off)
        assert np.linalg.norm(points - centre, axis=1).max() <= radius

"""Outlines of planar faces. The oracle is the block with a hole from which the faces come."""

from __future__ import annotations

import math

import pytest
from build123d import Box, Cylinder
from msgspec.structs import replace

from thingc.geometry.worker.kernel.feature_search import features_of


def test_only_outlines_are_omitted() -> None:
    block = (Box(20, 30, 10) - Cylinder(4, 10)).wrapped
    complete, short = features_of(block), features_of(block, outlines=False)
    (top,) = (face for face in complete.planes if face.normal == (0.0, 0.0, 1.0))
    outer, circle = sorted(top.loops, key=len)
    assert {(round(x, 9), round(y, 9), round(z, 9)) for x, y, z in outer} == {(x, y, 0.005) for x in (-0.01, 0.01) for y in (-0.015, 0.015)}
    assert [math.hypot(x, y) for x, y, _ in circle] == pytest.approx([0.004] * len(circle))
    assert len(short.planes) == 6 and all(face.loops == () for face in short.planes)
    assert short.cylinders == complete.cylinders and [replace(face, loops=()) for face in complete.planes] == list(short.planes)

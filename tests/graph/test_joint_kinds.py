from __future__ import annotations

import math

import numpy as np
import pytest

from graph.builder import as_matrix, rz, t
from thingc.joints import KINDS, LATER
from thingc.units import ANGLE, LENGTH


def test_what_can_be_built_and_what_comes_later() -> None:
    assert list(KINDS) == ["fixed", "revolute", "continuous", "prismatic"]
    assert frozenset({"cylindrical", "universal", "ball", "planar", "screw"}) == LATER
    assert not LATER & set(KINDS)


def test_coordinates_and_limits() -> None:
    assert {name: (kind.coordinate, kind.limits, kind.core) for name, kind in KINDS.items()} == {
        "fixed": (None, "none", None),
        "revolute": (ANGLE, "required", "hinge"),
        "continuous": (ANGLE, "none", "hinge"),
        "prismatic": (LENGTH, "required", "slide"),
    }
    assert [kind.moves for kind in KINDS.values()] == [False, True, True, True]


@pytest.mark.parametrize("q", [-2.5, 0.0, 0.3, math.pi / 2])
def test_motions(q: float) -> None:
    assert as_matrix(KINDS["fixed"].motion(q)) == pytest.approx(np.eye(4))
    assert as_matrix(KINDS["revolute"].motion(q)) == pytest.approx(rz(q))
    assert as_matrix(KINDS["continuous"].motion(q)) == pytest.approx(rz(q))
    assert as_matrix(KINDS["prismatic"].motion(q)) == pytest.approx(t(0, 0, q))


def test_coordinates_are_shown_as_a_person_writes_them() -> None:
    assert KINDS["revolute"].shown(math.radians(-150)) == "-150 deg"
    assert KINDS["prismatic"].shown(0.0205) == "20.5 mm"

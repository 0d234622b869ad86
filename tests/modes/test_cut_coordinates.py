"""Coordinates and degrees of freedom of cut joints, compared with motions by the table of kinds and finite differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from modes.test_random_trees import LEAD, frame, motion
from thingc.modes import Cut
from thingc.modes.cut_joints import constraint_projector, coordinates, freedoms, velocities

X, Y, Z = np.eye(3)
NONE = np.zeros(3)
TWISTS = {
    "revolute": [(Z, NONE)], "prismatic": [(NONE, Z)], "screw": [(Z, Z * LEAD / math.tau)], "cylindrical": [(Z, NONE), (NONE, Z)],
    "universal": [(X, NONE), (Y, NONE)], "planar": [(NONE, X), (NONE, Y), (Z, NONE)], "ball": [(X, NONE), (Y, NONE), (Z, NONE)],
}


@pytest.mark.parametrize("kind", TWISTS)
def test_cut_joint_coordinates_match_its_kind(kind: str) -> None:
    rng = np.random.default_rng(3)
    X_WA = frame(Rotation.from_rotvec(rng.normal(size=3)), rng.normal(size=3))
    twists = np.array([np.concatenate(one) for one in TWISTS[kind]])
    names = tuple(f"c{k}" for k in range(len(twists)))
    cut = Cut(name="c", kind=kind, parent=0, child=1, X_PA=np.eye(4), X_CB=np.eye(4), coordinates=names, twists=twists)
    q, v, h = rng.uniform(-0.9, 0.9, len(twists)), rng.normal(size=len(twists)), 1e-6
    X_WB = X_WA @ motion(kind, q)
    assert coordinates(cut, np.linalg.inv(X_WA) @ X_WB, q + rng.uniform(-0.3, 0.3, len(q))) == pytest.approx(q, abs=1e-12)

    def at(t: float) -> np.ndarray:
        if kind == "ball":  # v is the angular velocity of the child in its own axes
            return X_WA @ frame(Rotation.from_rotvec(q) * Rotation.from_rotvec(t * v))
        return X_WA @ motion(kind, q + t * v)

    rate = (at(h) - at(-h)) / (2 * h)
    spin = rate[:3, :3] @ X_WB[:3, :3].T
    relative = np.array([*rate[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]])
    assert freedoms(cut, q, X_WB) @ v == pytest.approx(relative, abs=1e-8)
    assert velocities(cut, q, X_WB, relative) == pytest.approx(v, abs=1e-7)
    P = constraint_projector(cut, q, X_WB)
    assert P @ relative == pytest.approx(np.zeros(6), abs=1e-8) and np.trace(P) == pytest.approx(6 - len(q)) and pytest.approx(P) == P @ P

"""Balls: the rotation vector that is their q, and the quaternion that MuJoCo has of them.

With r the rotation vector of the document's child in its parent, both in the frames J of the joint's mounts, and w the angular velocity of
the child in its J axes (its v), MuJoCo has in the axes of the body that it moves

    qpos = quaternion of R r,    qvel = R w

with R that from J to the body; where the mode's tree crosses the joint backwards the turn back, R = -(from J to the document's parent) and
`qvel = R exp(r) w`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from thingc.base.one_line_repr import OneLineRepr
from thingc.modes.frames import Array, quaternion_of, rotation_of, rotation_vector, turned


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ball(OneLineRepr):
    """A ball of a mode's tree: its `name` in the model, its three `coordinates` in the document's order, whether the tree crosses it
    backwards (`reversed`), and `R` (3, 3), which takes its q to MuJoCo's."""

    name: str
    coordinates: tuple[str, ...]
    reversed: bool
    R: Array

    def vector(self, values: Mapping[str, float]) -> Array:
        """(3,): its own of the values of all coordinates."""
        return np.array([values[name] for name in self.coordinates])

    def step(self, coordinate: str, q: Mapping[str, float]) -> Array:
        """The turn (3, 3) across the joint in the tree, which the first of its coordinates makes; the others make none."""
        if coordinate != self.coordinates[0]:
            return np.eye(3)
        turn = rotation(self.vector(q))
        return turn.T if self.reversed else turn

    def qpos(self, q: Mapping[str, float]) -> Array:
        """(4,): MuJoCo's quaternion."""
        return quaternion_of(rotation(self.R @ self.vector(q)))

    def qvel(self, q: Mapping[str, float], v: Mapping[str, float]) -> Array:
        """(3,): MuJoCo's velocity."""
        spin = self.vector(v)
        qvel: Array = self.R @ (rotation(self.vector(q)) @ spin if self.reversed else spin)
        return qvel

    def read(self, qpos: Array, qvel: Array) -> tuple[dict[str, float], dict[str, float]]:
        """(q, v) by coordinate of what MuJoCo has; q is no longer than pi."""
        r = self.R.T @ rotation_vector(rotation_of(qpos))
        spin = self.R.T @ np.asarray(qvel)
        if self.reversed:
            spin = rotation(r).T @ spin
        q, v = (dict(zip(self.coordinates, map(float, one), strict=True)) for one in (r, spin))
        return q, v


def rotation(vector: Array) -> Array:
    """The matrix (3, 3) of a rotation vector (3,)."""
    angle = float(np.linalg.norm(vector))
    return np.eye(3) if angle == 0.0 else turned(vector / angle, angle)

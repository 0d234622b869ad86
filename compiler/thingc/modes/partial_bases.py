"""Bases with partial mobility: `planar` in the x-y plane of a frame A that is fixed in the world, and `ball` about the origin of A.

Let X_WR be the current pose of the root link, X0_WR its initial pose in the mode, and M the motion in A. Then X_WR = X_WA M inv(X_WA)
X0_WR. MuJoCo represents M as two slides and a hinge about z (`planar`), or as a quaternion in the axes of the root link (`ball`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from thingc.base.one_line_repr import OneLineRepr
from thingc.modes.frames import Array, inverse, pose, quaternion_of, rotation_of, turned


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PartBase(OneLineRepr):
    """Mobility of the root link. `kind` is `planar` or `ball`. The module defines `X_WA` and `X0_WR` (4, 4)."""

    kind: Literal["planar", "ball"]
    X_WA: Array
    X0_WR: Array

    @property
    def joints(self) -> tuple[str, ...]:
        """The names of the joints in the model that implement this mobility."""
        return ("root",) if self.kind == "ball" else ("root_0", "root_1", "root_2")

    def qpos(self, X: Array) -> Array:
        """Return MuJoCo's `qpos` for the root link at X (4, 4), or at the nearest possible pose."""
        if self.kind == "ball":
            return quaternion_of(self.X0_WR[:3, :3].T @ X[:3, :3])
        M = self._motion(X)
        return np.array([M[0, 3], M[1, 3], np.arctan2(M[1, 0] - M[0, 1], M[0, 0] + M[1, 1])])

    def pose(self, qpos: ArrayLike) -> Array:
        """Return the pose (4, 4) of the root link at MuJoCo's `qpos`."""
        values = np.asarray(qpos, dtype=float)
        if self.kind == "ball":
            turn = self.X0_WR[:3, :3] @ rotation_of(values) @ self.X0_WR[:3, :3].T
            about = self.X_WA[:3, 3]
            return pose(turn, about - turn @ about) @ self.X0_WR
        M = pose(turned(np.array([0.0, 0.0, 1.0]), float(values[2])), np.array([values[0], values[1], 0.0]))
        return self.X_WA @ M @ inverse(self.X_WA) @ self.X0_WR

    def qvel(self, X: Array, twist: Array) -> Array:
        """Return MuJoCo's `qvel` (3,) for the root link at X with a twist (6,). Components in constrained directions are ignored."""
        if self.kind == "ball":
            return twist[3:]
        R, spin = self.X_WA[:3, :3], X[:3, :3] @ twist[3:]
        x, y, _ = R.T @ (twist[:3] + np.cross(spin, self._carried(X) - X[:3, 3]))
        return np.array([x, y, (R.T @ spin)[2]])

    def twist(self, X: Array, qvel: ArrayLike) -> Array:
        """Return the twist (6,) of the root link at X for MuJoCo's `qvel`."""
        values = np.asarray(qvel, dtype=float)
        R = self.X_WA[:3, :3]
        if self.kind == "ball":
            spin, linear = X[:3, :3] @ values, np.zeros(3)
        else:
            spin, linear = R[:, 2] * values[2], R[:, :2] @ values[:2]
        return np.concatenate([linear + np.cross(spin, X[:3, 3] - self._carried(X)), X[:3, :3].T @ spin])

    def motions(self, X: Array) -> Array:
        """Return the possible twists (6, 3) at X per unit of each entry of `qvel`."""
        return np.array([self.twist(X, unit) for unit in np.eye(3)]).T

    def _motion(self, X: Array) -> Array:
        return inverse(self.X_WA) @ X @ inverse(self.X0_WR) @ self.X_WA

    def _carried(self, X: Array) -> Array:
        """Return the current position (3,) of the point that was at the origin of A, for the root link at X."""
        return (self.X_WA @ self._motion(X))[:3, 3]

"""Bases whose root link can move in some directions: in the x-y plane of a frame A (`planar`), or about the origin of A (`ball`).

Frame A is fixed in the world. Let X_WR be the current pose of the root link, X0_WR its initial pose in the mode, and M the motion of the
base in A. Then X_WR = X_WA M inv(X_WA) X0_WR. MuJoCo represents M by two slide joints and a hinge about z (`planar`), or by a quaternion in
the axes of the root link (`ball`).
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from thingc.base.one_line_repr import OneLineStruct
from thingc.modes.frames import Array, cross, inverse, pose, quaternion_of, rotation, rotation_of


class PartBase(OneLineStruct, eq=False):
    """A planar or ball base of a mode (see `kind`).

    The module docstring defines frame A, its pose `X_WA` (4, 4), and the initial pose `X0_WR` (4, 4) of the root link.
    """

    kind: Literal["planar", "ball"]
    X_WA: Array
    X0_WR: Array

    @property
    def joints(self) -> tuple[str, ...]:
        """The names of the MuJoCo joints with which the model implements the motion of this base."""
        return ("root",) if self.kind == "ball" else ("root_0", "root_1", "root_2")

    def qpos(self, X: Array) -> Array:
        """Return the elements of MuJoCo's `qpos` for a root link with the pose X (4, 4).

        If this base does not allow the pose X, the nearest allowed pose is used.
        """
        if self.kind == "ball":
            return quaternion_of(self.X0_WR[:3, :3].T @ X[:3, :3])
        return self._planar(X, np)

    def pose(self, qpos: ArrayLike) -> Array:
        """Return the pose (4, 4) of the root link in the world for the given elements of MuJoCo's `qpos`."""
        values = np.asarray(qpos, dtype=float)
        return self._root_pose(self.X0_WR[:3, :3] @ rotation_of(values), np) if self.kind == "ball" else self._slid(values, np)

    def nearest(self, X: Array, xp: Any = np) -> Array:
        """Return the pose (4, 4) of the root link that is nearest to X (4, 4) among the poses that this base allows."""
        return self._root_pose(X[:3, :3], xp) if self.kind == "ball" else self._slid(self._planar(X, xp), xp)

    def qvel(self, X: Array, twist: Array, xp: Any = np) -> Array:
        """Return the elements (3,) of MuJoCo's `qvel` for a root link with the pose X (4, 4) and a twist (6,).

        Components of the twist in directions that this base constrains are ignored.
        """
        if self.kind == "ball":
            return twist[3:]
        R, spin = self.X_WA[:3, :3], X[:3, :3] @ twist[3:]
        x, y, _ = R.T @ (twist[:3] + cross(spin, self._point_position(X) - X[:3, 3], xp))
        qvel: Array = xp.asarray([x, y, (R.T @ spin)[2]])
        return qvel

    def twist(self, X: Array, qvel: Array, xp: Any = np) -> Array:
        """Return the twist (6,) of a root link with the pose X (4, 4) for the given elements (3,) of MuJoCo's `qvel`."""
        R = self.X_WA[:3, :3]
        if self.kind == "ball":
            spin, linear = X[:3, :3] @ qvel, np.zeros(3)
        else:
            spin, linear = R[:, 2] * qvel[2], R[:, :2] @ qvel[:2]
        twist: Array = xp.concatenate([linear + cross(spin, X[:3, 3] - self._point_position(X), xp), X[:3, :3].T @ spin])
        return twist

    def motions(self, X: Array, xp: Any = np) -> Array:
        """Return the Jacobian (6, 3) that maps MuJoCo's `qvel` (3,) to the twist of a root link with the pose X (4, 4)."""
        motions: Array = xp.asarray([self.twist(X, unit, xp) for unit in np.eye(3)]).T
        return motions

    def _planar(self, X: Array, xp: Any) -> Array:
        """Return the coordinates (3,) of a planar base for the pose X (4, 4) of the root link: x and y [m], and the angle [rad]."""
        M = inverse(self.X_WA) @ X @ inverse(self.X0_WR) @ self.X_WA
        moved: Array = xp.asarray([M[0, 3], M[1, 3], xp.arctan2(M[1, 0] - M[0, 1], M[0, 0] + M[1, 1])])
        return moved

    def _slid(self, moved: Array, xp: Any) -> Array:
        """Return the pose (4, 4) of the root link of a planar base, given the translation in x and y and the rotation angle (3,)."""
        M = pose(rotation(moved[2] * np.eye(3)[2], xp), moved * np.array([1.0, 1.0, 0.0]), xp)
        X: Array = self.X_WA @ M @ inverse(self.X_WA) @ self.X0_WR
        return X

    def _root_pose(self, R: Array, xp: Any) -> Array:
        """Return the pose (4, 4) of the root link of a ball base, given its orientation R (3, 3) in the world."""
        about = self.X_WA[:3, 3]
        return pose(R, about + R @ self.X0_WR[:3, :3].T @ (self.X0_WR[:3, 3] - about), xp)

    def _point_position(self, X: Array) -> Array:
        """Return the current world position (3,) of the point of the root link that was initially at the origin of frame A."""
        carried: Array = (X @ inverse(self.X0_WR) @ self.X_WA)[:3, 3]
        return carried

"""Find the positions of joint coordinates in the arrays `qpos` and `qvel` of a MuJoCo model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.modes.frames import Array
from thingc.modes.kinematics import kinematics

if TYPE_CHECKING:
    from thingc.modes.tree import Ball, Mode


class Addresses:
    """Maps the joint coordinates of a mode to the arrays `qpos` and `qvel` of a MuJoCo model.

    Free joints are read and written by the module `free_joints`. The argument `joints` contains, for each joint of the MuJoCo model, its
    first index in `qpos` and its first index in `qvel`.

    Attributes:
        to_read: An array (3, k) with a column for each coordinate that does not belong to a ball joint: the index in `Mode.coordinates`,
            the index in `qpos` and the index in `qvel`.
        to_write: An array (3, m) with the same rows and a column for each joint of the model, including mimic joints.
        ratio: An array (m,) with the factor by which the coordinate is multiplied when it is written to each joint of `to_write`.
    """

    def __init__(self, mode: Mode, joints: Mapping[str, Sequence[int]]) -> None:
        rows = kinematics(mode).rows.tolist()
        plain = [(row, joint) for row, joint in zip(rows, mode.joints, strict=True) if joint.ball is None and joint.kind != "free"]
        self.to_read = _indices([(row, *joints[joint.in_data]) for row, joint in plain])
        self.to_write = _indices([(row, *joints[name]) for row, joint in plain for name in joint.in_model])
        self.ratio = np.array([ratio for _, joint in plain for ratio in joint.in_model.values()])
        self._balls: list[tuple[Ball, list[int], slice, slice]] = []
        for joint in mode.joints:
            if joint.kind == "ball" and joint.ball is not None and joint.first:
                (at, moving), ball_rows = joints[joint.in_data], [mode.coordinates.index(name) for name in joint.ball.coordinates]
                self._balls.append((joint.ball, ball_rows, slice(at, at + 4), slice(moving, moving + 3)))
        self._count = len(mode.coordinates)

    def read(self, qpos: Array, qvel: Array) -> tuple[Array, Array]:
        """Read the joint coordinates and the joint velocities from `qpos` and `qvel`, in the order of `Mode.coordinates`.

        Joints that are not in the kinematic tree of the mode have the coordinate 0.
        """
        q, v = np.zeros(self._count), np.zeros(self._count)
        rows, positions, speeds = self.to_read
        q[rows], v[rows] = qpos[positions], qvel[speeds]
        for ball, ball_rows, ball_qpos, ball_qvel in self._balls:
            q[ball_rows], v[ball_rows] = ball.read(qpos[ball_qpos], qvel[ball_qvel])
        return q, v

    def write(self, q: Array, v: Array, qpos: Any, qvel: Any) -> None:
        """Write the joint coordinates `q` and the joint velocities `v` to the arrays `qpos` and `qvel`."""
        rows, positions, speeds = self.to_write
        qpos[positions], qvel[speeds] = self.ratio * q[rows], self.ratio * v[rows]
        for ball, ball_rows, ball_qpos, ball_qvel in self._balls:
            qpos[ball_qpos], qvel[ball_qvel] = ball.qpos(q[ball_rows]), ball.qvel(q[ball_rows], v[ball_rows])


def _indices(rows: Sequence[Sequence[int]]) -> Any:
    return np.array(rows, dtype=int).reshape(-1, 3).T

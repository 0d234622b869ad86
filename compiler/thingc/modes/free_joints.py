"""Read and write the free joints of a robot in the arrays of a MuJoCo model, in which the child of a free joint is a child of the world.

MuJoCo's `qpos` contains the pose of the child in the world, and `qvel` its twist. The coordinates of the joint are relative to the parent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.modes.frames import Array, inverse, pose, quaternion_of, rotation_of, rotation_vector
from thingc.modes.kinematics import kinematics
from thingc.modes.state import State

if TYPE_CHECKING:
    from thingc.modes.tree import Mode


def read(mode: Mode, state: State[Array], qpos: Array, qvel: Array, joints: Mapping[str, Sequence[int]]) -> None:
    """Compute the coordinates and velocities of all free joints, and write them to the arrays `q` and `v` of the state.

    All other joints of the state must be known. `joints` maps the names of MuJoCo joints to their addresses in `qpos` and `qvel`.
    """
    kin = kinematics(mode)
    for first in _free(mode):
        coordinates = mode.joints[first : first + 6]
        at, moving = joints[coordinates[0].in_data]
        frames = kin.frames(state.base, state.q[kin.rows], np)
        X_WC = pose(rotation_of(qpos[at + 3 : at + 7]), qpos[at : at + 3])
        X = inverse(kin.poses(frames)[coordinates[0].parent] @ coordinates[0].X_PJ) @ X_WC @ inverse(coordinates[-1].X_JL)
        is_reversed = coordinates[0].reversed
        X = inverse(X) if is_reversed else X
        rows = kin.rows[first : first + 6]
        slides = np.array([joint.twist[3:] for joint in coordinates if joint.ball is None])
        place = (-slides[::-1] if is_reversed else slides) @ X[:3, 3]
        state.q[rows[::-1] if is_reversed else rows] = np.concatenate([place, rotation_vector(X[:3, :3])])
        frames = kin.frames(state.base, state.q[kin.rows], np)
        child, R = coordinates[0].child, X_WC[:3, :3]
        relative = qvel[moving : moving + 6] - kin.twists(frames, np.concatenate([state.twist, state.v[kin.rows]]), np)[child]
        moves = kin.jacobians(frames, np)[child][:, 6 + first : 12 + first]
        state.v[rows] = np.linalg.solve(moves, np.concatenate([relative[:3], R @ relative[3:]]))


def write(mode: Mode, state: State[Array], qpos: Any, qvel: Any, joints: Mapping[str, Sequence[int]]) -> None:
    """Write the poses and twists of the children of all free joints to the arrays `qpos` and `qvel`."""
    first_indices = list(_free(mode))
    if not first_indices:
        return
    poses, twists = kinematics(mode).link_motion(state, np)
    for first in first_indices:
        (at, moving), child = joints[mode.joints[first].in_data], mode.joints[first].child
        qpos[at : at + 7] = np.concatenate([poses[child, :3, 3], quaternion_of(poses[child, :3, :3])])
        qvel[moving : moving + 6] = twists[child]


def _free(mode: Mode) -> list[int]:
    """Return the indices of the first coordinate of each free joint, in the order of the tree."""
    return [number for number, joint in enumerate(mode.joints) if joint.kind == "free" and joint.first]

"""Static efforts on robots with loops and holds: the part of the balance that the loops leave to the drives, by least squares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from thingc.graph import joints_of
from thingc.pose import Pose
from thingc.robot.closure import Loops, State
from thingc.robot.types import Robot
from thingc.statics.efforts import Drive, Efforts, answer

Array = NDArray[np.float64]

RANK = 1e-9
"""Singular values below this part of the greatest are none."""


def balance_loops(
    robot: Robot, q: Mapping[str, float], bodies: Sequence[Pose], load: Mapping[str, float], drives: Sequence[Drive],
) -> Efforts:
    """The efforts at `q`, where the loops are closed; `load` [N m or N] by coordinate. Of a robot without closures it is the
    answer of `balance_tree`, by another way."""
    loops = Loops(robot.bodies, robot.closures, joints_of(robot.assembly), bodies[0])
    paths = [coordinate.path for coordinate in loops.coordinates]
    column = {path: k for k, path in enumerate(paths)}
    count = len(paths)
    free = _null_space(np.array(loops.linearized(State(q=dict(q), base=bodies[0]))[1], dtype=np.float64).reshape(count, -1).T)
    known = np.array([load[path] for path in paths])
    weights = np.array([drive.weight for drive in drives])
    moved = np.zeros((count, len(drives)))
    for number, drive in enumerate(drives):
        moved[column[drive.leader], number] = drive.factor
    held = free.T @ moved * weights
    effort = np.zeros(len(drives))
    rank = 0
    if held.size:
        found, _, rank, _ = np.linalg.lstsq(held, -free.T @ known, rcond=RANK)
        effort = weights * found
    rest = np.abs(free @ (free.T @ (known + moved @ effort)))
    efforts = {drive.path: float(value) + 0.0 for drive, value in zip(drives, effort, strict=True)}
    return answer(
        drives, efforts, load, float(rest.max(initial=0.0)), paths[int(rest.argmax())] if count else "", len(drives) - int(rank),
    )


def _null_space(rows: Array) -> Array:
    """An orthonormal basis (n x k) of what the rows (m x n) map to 0."""
    if not rows.size:
        return np.eye(rows.shape[1])
    _, sizes, right = np.linalg.svd(rows)
    rank = int((sizes > RANK * max(float(sizes.max(initial=0.0)), 1e-12)).sum())
    return np.asarray(right[rank:].T, dtype=np.float64)

"""Simulate the generated MuJoCo model of a robot that is released in a pose, while its drives are commanded to this pose."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import mujoco
import numpy as np
from numpy.typing import NDArray

from thingc.base.frozen_struct import FrozenStruct
from thingc.model.robot.types import Keyframe, Robot
from thingc.targets.mjcf.drives import start_delays
from thingc.targets.mjcf.scene import FLOOR
from thingc.targets.mjcf.verify import collect_warnings

Array = NDArray[np.float64]

BAD = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
"""Warnings of MuJoCo that mean that a simulation diverges."""


class SettleResult(FrozenStruct):
    """The simulated motion of several points of a robot.

    `path` is an array (times, points, 3) of positions [m] in the world, one for every `step` [s]. `deepest` [m] is the largest depth of
    contacts during the time in which the robot should be at rest.
    """

    path: Array
    step: float
    deepest: float

    def rest_time(self, drift: float) -> float:
        """Return the time [s] after which every point stays within `drift` [m] of its final position."""
        moving = np.flatnonzero(self._off() > drift)
        return 0.0 if not len(moving) else (int(moving[-1]) + 1) * self.step

    def drift(self, start: float) -> float:
        """Return the largest distance [m] of any point from its final position, between the time `start` [s] and the end."""
        off = self._off()
        return float(off[min(len(off) - 1, round(start / self.step)) :].max())

    @property
    def moved(self) -> float:
        """Return the largest distance [m] between the initial and the final position of a point."""
        return float(np.linalg.norm(self.path[-1] - self.path[0], axis=1).max())

    def _off(self) -> Array:
        distances: Array = np.linalg.norm(self.path - self.path[-1], axis=2).max(axis=1)
        return distances


def simulate(
    robot: Robot, frame: Keyframe, scene: str, files: Mapping[str, bytes], *, seconds: float, resting: float, floor: bool,
    separator: str = "/",
) -> SettleResult | float:
    """Simulate a robot that starts in the keyframe `frame`, and record the motion of the bounding boxes of all its parts.

    `scene` is the name of the MJCF scene of the mode in `files`. The simulation takes `seconds` seconds. The depth of contacts is recorded
    from the time `resting` [s] on. `separator` is the character that separates names in the element paths of the model. If the simulation
    diverges, return only the time [s] at which it diverges.
    """
    with collect_warnings():
        model = scene_model(scene, files, floor=floor)
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key(frame.name.replace("/", separator)).id)
        start_delays(model, data)
        points = _points(robot, model, separator)
        count = max(1, round(seconds / model.opt.timestep))
        path = np.empty((count + 1, sum(len(body_points) for _, body_points in points), 3))
        deepest, start = 0.0, resting - 0.5 * model.opt.timestep
        mujoco.mj_forward(model, data)
        path[0] = _world_points(points, data)
        for step in range(1, count + 1):
            mujoco.mj_step(model, data)
            # After mj_step, poses still belong to the state before the step, so they are computed for the new state.
            mujoco.mj_kinematics(model, data)
            path[step] = _world_points(points, data)
            if any(data.warning[kind].number for kind in BAD):
                return float(step * model.opt.timestep)
            if data.time >= start and data.ncon:
                deepest = max(deepest, -float(data.contact.dist[: data.ncon].min()))
        return SettleResult(path=path, step=model.opt.timestep, deepest=deepest)


def scene_model(scene: str, files: Mapping[str, bytes], *, floor: bool) -> mujoco.MjModel:
    """Compile the MuJoCo scene of a mode. If `floor` is False, nothing collides with the floor."""
    assets = {path.rpartition("/")[2]: data for path, data in files.items()}
    model = mujoco.MjModel.from_xml_string(files[scene].decode(), assets)
    if not floor:
        planes = [
            geom for geom in range(model.ngeom)
            if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE and model.geom(geom).name in (FLOOR, f"scene:{FLOOR}")
        ]
        model.geom_contype[planes] = 0
        model.geom_conaffinity[planes] = 0
    return model


def _points(robot: Robot, model: mujoco.MjModel, separator: str) -> list[tuple[int, Array]]:
    """For each link, return the index of its body in the MuJoCo model, and an array `(n, 3)` of points [m] in the frame of the body.

    The points are the origin of the link and the corners of the bounding boxes of its parts.
    """
    per_link = []
    for body in robot.bodies:
        link = robot.assembly.links[body.link]
        if body.parent is not None and body.link in robot.assembly.between:
            continue  # the link is merged into the next body, so the model has no body for this link
        points = [(0.0, 0.0, 0.0)]
        for member, pose in zip(link.members, link.poses, strict=True):
            box = robot.assembly.occurrences[member].box
            if box is not None:
                points += [pose.apply((box[i][0], box[j][1], box[k][2])) for i, j, k in product((0, 1), repeat=3)]
        per_link.append((model.body(link.name.replace("/", separator)).id, np.array(points)))
    return per_link


def _world_points(points: list[tuple[int, Array]], data: mujoco.MjData) -> Array:
    return np.concatenate([body_points @ data.xmat[body].reshape(3, 3).T + data.xpos[body] for body, body_points in points])

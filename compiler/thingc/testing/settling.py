"""Tests of rest: the emitted MuJoCo model, let go in a pose with its drives set to it."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import mujoco
import numpy as np
from numpy.typing import NDArray

from thingc.diagnostics import Code
from thingc.emit.mjcf.check import heard
from thingc.emit.mjcf.scene import FLOOR
from thingc.pose import Pose, Vector
from thingc.resolve.tests_model import SettleCheck
from thingc.robot.types import Keyframe, Robot
from thingc.testing.results import Case, Failure, Measure, Outcome, shown
from thingc.units import LENGTH, TIME, Quantity

Array = NDArray[np.float64]

BAD = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
"""What MuJoCo warns of when numbers grow beyond all bounds."""



def settles(case: Case, check: SettleCheck, frame: Keyframe, scene: str, files: Mapping[str, bytes]) -> Outcome:
    """Simulate `within` and `for` together and look at the box corners of every link's parts. `scene` is the scene of the mode
    among the MJCF `files`, with a keyframe of the pose."""
    with heard():
        return _simulated(case, check, frame, _model(scene, files, floor=check.floor))


def _simulated(case: Case, check: SettleCheck, frame: Keyframe, model: mujoco.MjModel) -> Outcome:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(frame.name).id)
    points = _points(case.robot, model)
    count = max(1, round((check.within + check.hold) / model.opt.timestep))
    path = np.empty((count + 1, sum(len(own) for _, own in points), 3))
    deepest, resting = 0.0, check.within - 0.5 * model.opt.timestep
    mujoco.mj_forward(model, data)
    path[0] = _placed(points, data)
    for step in range(1, count + 1):
        mujoco.mj_step(model, data)
        # After mj_step the state is new and what depends on it is not: one more kinematics, so that frames belong to the time.
        mujoco.mj_kinematics(model, data)
        path[step] = _placed(points, data)
        if any(data.warning[kind].number for kind in BAD):
            return _diverged(step * model.opt.timestep)
        if data.time >= resting and data.ncon:
            deepest = max(deepest, -float(data.contact.dist[: data.ncon].min()))
    return _judged(check, path, model.opt.timestep, deepest)


def _judged(check: SettleCheck, path: Array, step: float, deepest: float) -> Outcome:
    """The verdict over the path (times x points x 3) of all points."""
    off = np.linalg.norm(path - path[-1], axis=2).max(axis=1)
    late = np.flatnonzero(off > check.drift)
    rest = 0.0 if not len(late) else (int(late[-1]) + 1) * step
    # In the last instant everything is where it ends: rest is only what lasts.
    settled = rest <= check.within + 1e-9
    drift = float(off[min(len(off) - 1, round(check.within / step)) :].max())
    moved = float(np.linalg.norm(path[-1] - path[0], axis=1).max())
    measured: dict[str, Measure] = {
        "rest": rest if settled else None, "drift": drift, "moved": moved, "penetration": max(deepest, 0.0),
    }
    expected: dict[str, Measure] = {"within": check.within, "drift": check.drift, "for": check.hold}
    for key, bound in (("moved", check.moved), ("penetration", check.penetration)):
        if bound is not None:
            expected[key] = bound
    far, deep = shown(moved, LENGTH), shown(max(deepest, 0.0), LENGTH)
    said = f"at rest after {rest:.3g} s, {far} from the pose, contacts {deep} deep"
    failure = None
    if not settled:
        said = f"not at rest after {check.within:g} s"
        failure = Failure(
            code=Code.TEST_SETTLES, key="within",
            message=f"after {Quantity(check.within, TIME)} it still moves by {shown(drift, LENGTH)} in "
            f"{Quantity(check.hold, TIME)}, and {Quantity(check.drift, LENGTH)} were allowed",
        )
    elif check.moved is not None and moved > check.moved:
        failure = Failure(
            code=Code.TEST_SETTLES, key="moved",
            message=f"it comes to rest {far} from the pose, and {Quantity(check.moved, LENGTH)} were allowed",
        )
    elif check.penetration is not None and deepest > check.penetration:
        failure = Failure(
            code=Code.TEST_SETTLES, key="penetration",
            message=f"its contacts give way by {deep} at rest, and {Quantity(check.penetration, LENGTH)} were allowed",
        )
    return Outcome(measured=measured, expected=expected, said=said, failure=failure)


def _diverged(time: float) -> Outcome:
    failure = Failure(
        code=Code.TEST_SETTLES, key="", message=f"the simulation diverges after {time:.3g} s",
        help="take a smaller `simulation: {timestep: ...}`, or look for parts that overlap in the pose",
    )
    return Outcome(measured={"diverged": time}, expected={}, said=f"diverges after {time:.3g} s", failure=failure)


def _model(scene: str, files: Mapping[str, bytes], *, floor: bool) -> mujoco.MjModel:
    """The scene compiled; without its floor, if that is not wanted, in that nothing touches it."""
    beside = {path.rpartition("/")[2]: data for path, data in files.items()}
    model = mujoco.MjModel.from_xml_string(files[scene].decode(), beside)
    if not floor:
        planes = [
            geom for geom in range(model.ngeom)
            if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE and model.geom(geom).name in (FLOOR, f"scene:{FLOOR}")
        ]
        model.geom_contype[planes] = 0
        model.geom_conaffinity[planes] = 0
    return model


def _points(robot: Robot, model: mujoco.MjModel) -> list[tuple[int, Array]]:
    """For each link its body in the model, and points in its frame (n x 3): its origin and the corners of its parts' boxes."""
    found = []
    for body in robot.bodies:
        link = robot.assembly.links[body.link]
        points = [(0.0, 0.0, 0.0)]
        for member, pose in zip(link.members, link.poses, strict=True):
            record = robot.assembly.occurrences[member].record
            if record is not None and record.box is not None:
                points += [_corner(pose, record.box, which) for which in product((0, 1), repeat=3)]
        found.append((model.body(link.name).id, np.array(points)))
    return found


def _corner(pose: Pose, box: tuple[Vector, Vector], which: tuple[int, ...]) -> Vector:
    return pose.apply((box[which[0]][0], box[which[1]][1], box[which[2]][2]))


def _placed(points: list[tuple[int, Array]], data: mujoco.MjData) -> Array:
    return np.concatenate([own @ data.xmat[body].reshape(3, 3).T + data.xpos[body] for body, own in points])

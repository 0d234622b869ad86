"""Replay a motion of a document in MuJoCo: the drives of the model follow the motion."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator

import mujoco
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from thingc.base.diagnostics import Report
from thingc.driver.pipeline import UnknownChoice
from thingc.driver.testing.kinds.drive_margin import instants
from thingc.driver.testing.poses import pose_robot
from thingc.driver.testing.settle_simulation import BAD, scene_model
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import JointEdge, LinkedTendon
from thingc.model.dynamics.motion_curve import MotionCurve, with_closed_loops
from thingc.model.resolve.types import NamedMotion, NamedPose
from thingc.model.robot.types import Robot
from thingc.targets.mjcf import emit as mjcf
from thingc.targets.mjcf.compat import separator
from thingc.targets.mjcf.drives import start_delays
from thingc.targets.mjcf.verify import collect_warnings
from thingc.targets.request import EmitRequest

Array = NDArray[np.float64]

AFTER = 0.5
"""Time [s] after the end of a motion during which the viewer shows the last pose."""

MOST_STEPS = 1_000_000
"""Largest number of time steps that `Replay.track` simulates."""

FARTHEST = np.pi
"""Distance [rad or m]. If a joint and its error both change by more in one time step, the simulation has diverged."""

IGNORED = ("stall", "deadband", "noise", "backlash")
"""Properties of drives that are only custom data in MuJoCo models."""


class Diverged(Exception):
    """Raised if the simulation diverges. `time` [s] is the time in the motion, and `joint` is the joint that moves farthest, if any."""

    def __init__(self, time: float, joint: JointEdge | None) -> None:
        super().__init__(time, joint)
        self.time, self.joint = time, joint


class Replay:
    """The MuJoCo scene of a mode, with commands of the drives for a motion.

    The model has a keyframe for each examined time of the motion. Position drives are commanded to the keyframes, velocity drives to the
    speeds of the motion, and motors to the efforts that the motion needs. Raises `UnknownChoice` if the mode cannot perform the motion.
    """

    def __init__(self, request: EmitRequest, robot: Robot, motion: NamedMotion) -> None:
        closed, mode = with_closed_loops(robot, motion), robot.mode.name
        if closed is None:
            raise UnknownChoice(f"the loops of mode `{mode}` do not close during motion `{motion.name}`", "change the poses of the motion")
        curve = MotionCurve(robot.assembly, closed)
        self.times = curve.samples()
        poses = [
            NamedPose(name=f"{motion.name}:{k}", values=curve.positions(at), origins={}, origin=motion.origin)
            for k, at in enumerate(self.times.tolist())
        ]
        placed = pose_robot(robot.assembly, robot.mode, poses)
        assert placed is not None
        artifacts = mjcf.emit(replace(request, robots=(placed,), report=Report(), made={}))
        mark = separator(request.compat)
        self.model = scene_model(f"mjcf/scene_{mode}.xml", artifacts.contents(request.store), floor=True)
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a reset would also set the time to 0
        keys = [self.model.key(pose.name.replace("/", mark)).id for pose in poses]
        self.first, self.commands, self.positions = keys[0], self.model.key_ctrl[keys].copy(), self.model.key_qpos[keys]
        joints = joints_of(robot.assembly)
        numbers = np.array([mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, one.path.replace("/", mark)) for one in joints])
        self.joints = [joint for joint, number in zip(joints, numbers, strict=True) if number >= 0]
        self.places = self.model.jnt_qposadr[numbers[numbers >= 0]] if joints else np.zeros(0, dtype=np.int64)
        self._command_others(robot, closed, mark)

    def _command_others(self, robot: Robot, motion: NamedMotion, mark: str) -> None:
        """Set the commands of velocity drives and motors. Collect the drives with each property that MuJoCo does not simulate."""
        drives: list[JointEdge | LinkedTendon] = [*joints_of(robot.assembly), *robot.assembly.tendons]
        kinds = {one.path: one.actuator.kind for one in drives if one.actuator is not None}
        used = [drive for drive in drives if drive.path in (*robot.present, *robot.pulled)]
        self.ignored = {key: [drive.path for drive in used if getattr(drive.actuator, key)] for key in IGNORED}
        self.ignored["velocity"] = [drive.path for drive in used if drive.limit.velocity and kinds[drive.path] != "velocity"]
        others = {path for path in (*robot.present, *robot.pulled) if kinds[path] != "position"}
        if others and robot.base == "free":
            raise UnknownChoice(
                f"the commands of {kinds[min(others)]} drive `{min(others)}` are unknown in a mode with a free base",
                "use position drives, or a mode with a fixed base",
            )
        rows = {at: row for row, at in enumerate(self.times.tolist())}
        for one in instants(robot, motion, None) if others else ():
            if one.path in others:
                drive = self.model.actuator(robot.assembly.drives[one.path].replace("/", mark)).id
                self.commands[rows[one.time], drive] = one.speed if kinds[one.path] == "velocity" else one.effort

    def at(self, rows: Array, now: float) -> Array:
        """Interpolate the rows of a table over the times of the motion, at the time `now` [s] after its start."""
        place = float(np.interp(self.times[0] + now, self.times, np.arange(len(self.times))))
        row = min(int(place), len(rows) - 2)
        return np.asarray(rows[row] + (place - row) * (rows[row + 1] - rows[row]))

    def simulate(self) -> Iterator[mujoco.MjData]:
        """Simulate the motion, and yield the state after every time step. Raises `Diverged`."""
        data = mujoco.MjData(self.model)
        mujoco.mj_resetDataKeyframe(self.model, data, self.first)
        start_delays(self.model, data)
        data.time = 0.0
        yield data
        states = np.array([data.qpos[self.places], np.zeros(len(self.places))])
        while data.time < self.times[-1] - self.times[0] - 0.5 * self.model.opt.timestep:
            data.ctrl[:] = self.at(self.commands, data.time + self.model.opt.timestep)
            with collect_warnings():
                mujoco.mj_step(self.model, data)
            place, states_before = data.qpos[self.places], states
            states = np.array([place, place - self.at(self.positions, data.time)[self.places]])
            change = abs(states - states_before).min(axis=0)
            if not (change <= FARTHEST).all() or any(data.warning[kind].number for kind in BAD):
                change = np.nan_to_num(change, nan=np.inf)
                raise Diverged(data.time + self.times[0], self.joints[change.argmax()] if self.joints else None)
            yield data

    def track(self) -> tuple[Array, Array, Array]:
        """Simulate the motion. Return the times [s] of all time steps, and the simulated and the commanded positions of the joints, with a
        row for each time [rad or m]. Raises `Diverged`, and `UnknownChoice` for a motion with too many time steps.
        """
        if (count := (self.times[-1] - self.times[0]) / self.model.opt.timestep) > MOST_STEPS:
            hint = "use a shorter motion, or a larger `timestep` in the section `simulation`"
            raise UnknownChoice(f"the number of time steps ({count:.6g}) exceeds the maximum ({MOST_STEPS})", hint)
        steps = [(data.time, data.qpos[self.places].copy(), self.at(self.positions, data.time)[self.places]) for data in self.simulate()]
        times, tracked, commanded = (np.array(column) for column in zip(*steps, strict=True))
        return times + self.times[0], tracked, commanded

    def show(self) -> None:
        """Play the motion in the viewer of MuJoCo, again and again, until the user closes the window.

        Raises `UnknownChoice` and `Diverged`.
        """
        import glfw
        from mujoco import viewer

        with warnings.catch_warnings(action="ignore"):
            if not glfw.init():
                raise UnknownChoice("the viewer of MuJoCo requires a display", "use `--csv FILE`")
        display_data = mujoco.MjData(self.model)
        with viewer.launch_passive(self.model, display_data) as window:
            while window.is_running():
                start = time.monotonic()
                for data in self.simulate():
                    if not window.is_running():
                        return
                    display_data.time, display_data.qpos[:], display_data.ctrl[:] = data.time, data.qpos, data.ctrl
                    mujoco.mj_forward(self.model, display_data)
                    if (delay := data.time - (time.monotonic() - start)) > 0.0:
                        window.sync()
                        time.sleep(delay)
                time.sleep(AFTER)

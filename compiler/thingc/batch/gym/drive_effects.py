"""Simulate the properties of drives that MuJoCo does not simulate: torque-speed lines, deadbands and noise."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from thingc.batch.gym.rewards import Array


class DriveEffects:
    """The effects of the drives of a MuJoCo model on its controls. The data of the drives are custom data of the model.

    MuJoCo simulates delays. With `undelayed`, delays are skipped, because the environment delays actions. `acts` is False if MuJoCo alone
    simulates the drives. Otherwise, controls are clipped here instead of by MuJoCo, because the control for a limited torque can be
    outside of its range.
    """

    def __init__(self, model: mujoco.MjModel, *, undelayed: bool = False) -> None:
        self.model, self._undelayed = model, undelayed
        names = [model.actuator(number).name for number in range(model.nu)]
        of = {model.numeric(number).name: model.numeric(number).data for number in range(model.nnumeric)}
        line = np.array([of.get(f"{name}:stall", (np.inf, np.inf)) for name in names]).reshape(-1, 2)
        self._stall, self._speed = line.T
        self._deadband, self._noise = (
            np.array([of.get(f"{name}:{key}", (0.0,))[0] for name in names]) for key in ("deadband", "noise")
        )
        self._delayed = np.flatnonzero(model.actuator_history[: model.nu, 0])
        self._counts, self._cursors = model.actuator_history[self._delayed, 0], model.actuator_historyadr[self._delayed] + 1
        self._gain = np.where(model.actuator_gainprm[:, 0] == 0.0, 1.0, model.actuator_gainprm[:, 0])
        self.acts = bool(
            np.isfinite(self._stall).any() or self._deadband.any() or self._noise.any() or (undelayed and len(self._delayed))
        )
        if self.acts:
            model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL

    def step(self, data: mujoco.MjData, count: int, source: np.random.Generator) -> None:
        """Simulate `count` time steps. `source` is the random generator of the noise."""
        if not self.acts:
            mujoco.mj_step(self.model, data, count)
            return
        command = data.ctrl.copy()
        second = mujoco.mj_step if self.model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4 else mujoco.mj_step2
        for _ in range(count):
            mujoco.mj_step1(self.model, data)
            self._apply(data, source.normal(0.0, self._noise) if self._noise.any() else 0.0)
            second(self.model, data)
            data.ctrl[:] = command

    def forward(self, data: mujoco.MjData) -> None:
        """Compute all results for the current state, such as sensor values. The drives have no noise in this computation."""
        mujoco.mj_forward(self.model, data)
        if self.acts:
            command, history = data.ctrl.copy(), data.history.copy()
            self._apply(data, 0.0)
            mujoco.mj_forward(self.model, data)
            data.ctrl[:], data.history[:] = command, history

    def _apply(self, data: mujoco.MjData, noise: Any) -> None:
        """Replace the controls that act in the next step. For a delayed drive, this control is the oldest of the past controls."""
        model, control = self.model, data.ctrl.copy()
        acting = self._cursors + 1 + self._counts + (data.history[self._cursors].astype(int) + 1) % self._counts
        if not self._undelayed:
            control[self._delayed] = data.history[acting]
        low, high = np.where(model.actuator_ctrllimited[:, None], model.actuator_ctrlrange, (-np.inf, np.inf)).T
        control = self._limit(data, np.clip(control + noise, low, high))
        data.history[acting] = control[self._delayed]
        data.ctrl[:] = np.where(model.actuator_history[:, 0] > 0, data.ctrl, control)

    def _limit(self, data: mujoco.MjData, control: Array) -> Array:
        """Return the controls with which the drives ignore errors in their deadbands, and stay within their torque-speed lines."""
        gain, (constant, position, velocity) = self._gain, self.model.actuator_biasprm[:, :3].T
        speed, spring = data.actuator_velocity, position * data.actuator_length
        measured = -np.where(position, spring, velocity * speed) / gain  # 0 for a motor
        control = np.where(np.abs(control - measured) <= self._deadband, measured, control)
        force = gain * control + constant + spring + velocity * speed
        limited = np.clip(force, -self._stall * (1.0 + speed / self._speed), self._stall * (1.0 - speed / self._speed))
        return np.where(np.isfinite(self._stall), control + (limited - force) / gain, control)

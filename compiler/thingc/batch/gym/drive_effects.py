"""Simulate the properties of drives that MuJoCo does not simulate: torque-speed lines, deadbands and noise."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np


class DriveEffects:
    """The effects of the drives of a MuJoCo model on its controls. The data of the drives are custom data of the model.

    MuJoCo simulates delays. With `undelayed`, delays are skipped, because the environment delays actions. `acts` is False if MuJoCo alone
    simulates the drives. Otherwise, controls are clipped here instead of by MuJoCo, because the control for a limited torque can be
    outside of its range. `noise` contains the standard deviation of each control, and `counts` the delay of each drive in time steps.
    """

    def __init__(self, model: mujoco.MjModel, *, undelayed: bool = False) -> None:
        self.model, self._undelayed = model, undelayed
        names = [model.actuator(number).name for number in range(model.nu)]
        of = {model.numeric(number).name: model.numeric(number).data for number in range(model.nnumeric)}
        self._stall, self._speed = np.array([of.get(f"{name}:stall", (0.0, 1.0)) for name in names]).reshape(-1, 2).T
        self._deadband, self.noise = (np.array([of.get(f"{name}:{key}", (0.0,))[0] for name in names]) for key in ("deadband", "noise"))
        self.counts = model.actuator_history[: model.nu, 0]
        self._delayed = np.flatnonzero(self.counts)
        self._cursors = model.actuator_historyadr[self._delayed] + 1
        self.acts = bool(self._stall.any() or self._deadband.any() or self.noise.any() or (undelayed and len(self._delayed)))
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
            self._apply(data, source.normal(0.0, self.noise) if self.noise.any() else 0.0)
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
        control, counts = data.ctrl.copy(), self.counts[self._delayed]
        acting = self._cursors + 1 + counts + (data.history[self._cursors].astype(int) + 1) % counts
        if not self._undelayed:
            control[self._delayed] = data.history[acting]
        control = self.limit(self.model, data.actuator_length, data.actuator_velocity, control + noise, np)
        data.history[acting] = control[self._delayed]
        data.ctrl[:] = np.where(self.counts > 0, data.ctrl, control)

    def limit(self, model: Any, length: Any, speed: Any, control: Any, xp: Any) -> Any:
        """Return controls `(nu,)` for drives that ignore errors in their deadbands, and stay in their ranges and torque-speed lines.

        `model` is a model of MuJoCo or MJX, and `xp` is the module `numpy` or `jax.numpy`. `length` and `speed` `(nu,)` are the lengths and
        velocities of the actuators.
        """
        low, high = xp.where(self.model.actuator_ctrllimited[:, None], model.actuator_ctrlrange, np.array([-np.inf, np.inf])).T
        control = xp.clip(control, low, high)
        gain, (constant, position, velocity) = model.actuator_gainprm[:, 0], model.actuator_biasprm[:, :3].T
        gain, spring = xp.where(gain == 0.0, 1.0, gain), position * length
        measured = -xp.where(position, spring, velocity * speed) / gain  # 0 for a motor
        control = xp.where(abs(control - measured) <= self._deadband, measured, control)
        force = gain * control + constant + spring + velocity * speed
        limited = xp.clip(force, -self._stall * (1.0 + speed / self._speed), self._stall * (1.0 - speed / self._speed))
        return xp.where(self._stall, control + (limited - force) / gain, control)

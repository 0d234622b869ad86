"""What an episode is rewarded for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.base.frozen import dataclass
from thingc.batch.results import BuiltVariant

if TYPE_CHECKING:
    import mujoco

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, slots=True, kw_only=True)
class StepInfo:
    """What a reward is worked out of, after a step: model and data as they are, the `action` (nu,) in [-1, 1], the robot's centre of
    mass `before` and `after` it [m], and how much time has passed [s]. `variant` is whose episode it is; of a family in memory, its
    settings."""

    model: mujoco.MjModel
    data: mujoco.MjData
    variant: BuiltVariant | Mapping[str, Any]
    action: Array
    before: Array
    after: Array
    seconds: float
    start: Array
    """The coordinates (nq,) with which the episode began."""


Reward = Callable[[StepInfo], float]
Terminated = Callable[[StepInfo], bool]


def forward(step: StepInfo) -> float:
    """How fast the centre of mass moves along the world's x [m/s], less a thousandth of the action's square."""
    return float((step.after[0] - step.before[0]) / step.seconds - 1e-3 * step.action @ step.action)


def hold(step: StepInfo) -> float:
    """1 while the joints are as at the start, less the further they are away: exp(-|q - q0|^2), less a thousandth of the action's
    square."""
    import mujoco

    away = np.zeros(step.model.nv)
    mujoco.mj_differentiatePos(step.model, away, 1.0, step.start, step.data.qpos)
    return float(np.exp(-away @ away) - 1e-3 * step.action @ step.action)


TASKS: Mapping[str, Reward] = {"forward": forward, "hold": hold}
"""Rewards by name."""

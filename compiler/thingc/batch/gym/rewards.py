"""Functions that compute the reward of an action, and a class that computes the descriptor of a robot for its observations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.batch.families.family import RobotFamily
from thingc.batch.results import BuiltVariant, FamilyError, require_known

Array = np.ndarray[Any, np.dtype[np.float64]]


class StepInfo(FrozenStruct):
    """The argument of a function that computes the reward of an action.

    `action` (nu,) contains numbers in [-1, 1]. `before` and `after` contain the centre of mass [m] of the robot before and after the
    action. `seconds` is the duration of the action [s]. `variant` is the variant of the robot, or, for a family in memory, the settings of
    the robot.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    variant: BuiltVariant | Mapping[str, Any]
    action: Array
    before: Array
    after: Array
    seconds: float
    start: Array
    """The coordinates (nq,) at the start of the episode, or, after a switch, in the first keyframe of the new mode."""
    mode: str = ""
    """The name of the current mode."""
    refused: str | None = None
    """The reason why a mode switch in this action was refused, or None."""


Reward = Callable[[StepInfo], float]
Terminated = Callable[[StepInfo], bool]


def forward(step: StepInfo) -> float:
    """Return a reward for moving forward: the velocity of the centre of mass along the x axis of the world [m/s].

    The squared norm of the action, multiplied by 0.001, is subtracted from the reward.
    """
    return float((step.after[0] - step.before[0]) / step.seconds - 1e-3 * step.action @ step.action)


def hold(step: StepInfo) -> float:
    """Return a reward for holding the initial pose: exp(-|q - q0|^2), which is 1 if the joints are at their initial positions.

    The squared norm of the action, multiplied by 0.001, is subtracted from the reward.
    """
    away = np.zeros(step.model.nv)
    mujoco.mj_differentiatePos(step.model, away, 1.0, step.start, step.data.qpos)
    return float(np.exp(-away @ away) - 1e-3 * step.action @ step.action)


TASKS: Mapping[str, Reward] = {"forward": forward, "hold": hold}
"""The reward functions, by the name of the task."""


class Descriptor:
    """Computes numbers that describe a robot from its settings. These numbers are appended to observations.

    Each of these numbers is scaled from its bounds to [-1, 1]. Raises `UnknownVariant` for an unknown name, and `FamilyError` for a setting
    without bounds.
    """

    def __init__(self, family: RobotFamily, names: Sequence[str]) -> None:
        self._names = tuple(names)
        spans: list[tuple[float, float]] = []
        for name in names:
            require_known(name, family.space.names, f"`{family.name}` has no setting `{name}`", what="names")
            dimension = family.space[name]
            numbers = [value for value in dimension.choices if isinstance(value, int | float)] or [dimension.low, dimension.high]
            if None in numbers or len(numbers) < len(dimension.choices):
                raise FamilyError(f"expected `{name}` to be a number between bounds")
            spans.append((min(numbers), max(numbers)))
        self._family = family
        self._low = np.array([low for low, _ in spans])
        self._span = np.array([high - low for low, high in spans])

    def __call__(self, settings: Mapping[str, Any]) -> Array:
        """Return an array that contains the scaled number for each name."""
        if not self._names:
            return np.zeros(0)
        numbers = self._family.numbers(settings)
        values = np.array([numbers.get(name, self._family.space[name].value) for name in self._names], np.float64)
        wide = self._span > 0.0
        return np.where(wide, 2.0 * (values - self._low) / np.where(wide, self._span, 1.0) - 1.0, 0.0)

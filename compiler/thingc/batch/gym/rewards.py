"""What an episode is rewarded for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import did_you_mean
from thingc.batch.families.family import RobotFamily
from thingc.batch.results import BuiltVariant, FamilyError, UnknownVariant

if TYPE_CHECKING:
    import mujoco

Array = np.ndarray[Any, np.dtype[np.float64]]


class StepInfo(FrozenStruct):
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


class Descriptor:
    """The numbers of settings that an observation ends with, each scaled from its bounds to [-1, 1]. Raises `UnknownVariant` for a name
    that is not there, and `FamilyError` for one without bounds."""

    def __init__(self, family: RobotFamily, names: Sequence[str]) -> None:
        self._names = tuple(names)
        known = family.space.names if names else ()
        spans: list[tuple[float, float]] = []
        for name in names:
            if name not in known:
                raise UnknownVariant(f"`{family.name}` has nothing to set called `{name}`: {did_you_mean(str(name), known, what='names')}")
            one = family.space[name]
            numbers = [value for value in one.choices if isinstance(value, int | float)] or [one.low, one.high]
            if None in numbers or len(numbers) < len(one.choices):
                raise FamilyError(f"expected `{name}` to be a number between bounds")
            spans.append((min(numbers), max(numbers)))
        self._family = family
        self._low = np.array([low for low, _ in spans])
        self._span = np.array([high - low for low, high in spans])

    def __call__(self, settings: Mapping[str, Any]) -> Array:
        """The scaled numbers (names,)."""
        if not self._names:
            return np.zeros(0)
        numbers = self._family.numbers(settings)
        values = np.array([numbers.get(name, self._family.space[name].value) for name in self._names], np.float64)
        wide = self._span > 0.0
        return np.where(wide, 2.0 * (values - self._low) / np.where(wide, self._span, 1.0) - 1.0, 0.0)

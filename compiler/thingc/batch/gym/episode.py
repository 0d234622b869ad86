"""An episode of a robot: initial state, actions and rewards."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import did_you_mean
from thingc.batch.gym.rewards import TASKS, Array, Reward, StepInfo, Terminated
from thingc.batch.results import FamilyError, UnknownVariant
from thingc.batch.run_options import at_least, is_number

if TYPE_CHECKING:
    import mujoco


class EpisodeRules(FrozenStruct):
    """The rules of all episodes.

    An action lasts `frame_skip` simulation steps, and an episode lasts `max_steps` actions. An episode starts in the keyframe `pose` (None:
    the first keyframe), with a random change of each degree of freedom by at most `noise` [rad or m].
    """

    reward: Reward
    terminated: Terminated | None
    frame_skip: int
    max_steps: int
    pose: str | None
    noise: float


class SimulationStep(FrozenStruct):
    """The models to simulate: the models of a `mode`, with or without floor (`floor`) and visual geometry (`visual`).

    `cache` is the number of models to cache.
    """

    mode: str
    floor: bool
    visual: bool
    cache: int


def rules(
    reward: Reward | str, terminated: Terminated | None, frame_skip: int, max_steps: int, pose: str | None, noise: float,
) -> EpisodeRules:
    """Return the rules. `reward` can be the name of a task.

    Raises `UnknownVariant` for an unknown task, and `FamilyError` for invalid values.
    """
    if isinstance(reward, str):
        if reward not in TASKS:
            raise UnknownVariant(f"there is no task `{reward}`: {did_you_mean(reward, TASKS, what='tasks')}")
        reward = TASKS[reward]
    for name, called in (("reward", reward), ("terminated", terminated)):
        if not callable(called) and (called is not None or name == "reward"):
            raise FamilyError(f"expected `{name}` to be a function of a `StepInfo`, found `{called}`")
    at_least(1, frame_skip=frame_skip, max_steps=max_steps)
    if not is_number(noise) or not 0.0 <= noise < math.inf:
        raise FamilyError(f"expected `noise` to be a number of at least 0, found {noise}")
    return EpisodeRules(reward=reward, terminated=terminated, frame_skip=frame_skip, max_steps=max_steps, pose=pose, noise=noise)


def known_options(options: Mapping[str, Any] | None, known: Sequence[str]) -> dict[str, Any]:
    """Return the options of `reset`. Raises `FamilyError` for unknown options."""
    if options is not None and not isinstance(options, Mapping):
        raise FamilyError(f"expected `options` to be a mapping from names to values, found `{options}`")
    options = dict(options or {})
    for name in options:
        if name not in known:
            raise FamilyError(f"`reset` has no option `{name}`: {did_you_mean(str(name), known, what='options')}")
    return options


def as_actions(actions: Any, shape: tuple[int, ...] | None) -> Array:
    """Convert actions to an array of the given shape. Raises `FamilyError` for invalid actions."""
    try:
        numbers = np.asarray(actions, np.float64)
    except (TypeError, ValueError):
        raise FamilyError(f"expected actions of numbers, found `{actions}`") from None
    if numbers.shape != shape:
        raise FamilyError(f"expected actions of shape {shape}, found {numbers.shape}")
    return numbers


class Episode:
    """An episode of a robot: its `model`, `data` and `variant`, and the `spans` of its controls (lower and upper bounds).

    Call `begin` first, and then `ask`, `run` and `judge` for each action. `run` executes the simulation. It can be called for several
    episodes in parallel threads.
    """

    __slots__ = ("_action", "_before", "_high", "_low", "_rules", "_started", "data", "model", "start", "steps", "unstable", "variant")

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, variant: Any, rules: EpisodeRules, spans: tuple[Array, Array]) -> None:
        self.model = model
        self.data = data
        self.variant = variant
        self.steps = 0
        self.unstable = False
        self.start: Array = np.zeros(0)
        self._rules = rules
        self._low, self._high = spans
        self._action: Array = np.zeros(0)
        self._before: Array = np.zeros(0)
        self._started = 0.0

    def begin(self, source: np.random.Generator, name: str) -> None:
        """Set the initial state. `name` is the name of the variant in error messages. Raises `UnknownVariant` for an unknown pose."""
        import mujoco

        model, data, pose = self.model, self.data, self._rules.pose
        if pose is None and not model.nkey:
            mujoco.mj_resetData(model, data)
        else:
            mujoco.mj_resetDataKeyframe(model, data, 0 if pose is None else _keyframe(model, pose, name))
        if self._rules.noise:
            away = source.uniform(-self._rules.noise, self._rules.noise, model.nv)
            mujoco.mj_integratePos(model, data.qpos, away, 1.0)
        mujoco.mj_forward(model, data)
        self.steps = 0
        self.start = np.array(data.qpos)

    def ask(self, action: Array) -> None:
        """Set the action, with shape (nu,) or longer. The interval [-1, 1] is mapped to the range of each control.

        Raises `FamilyError` for NaN, which MuJoCo would replace by 0.
        """
        if np.isnan(action).any():
            raise FamilyError(f"expected an action of numbers, found {action}")
        self._action = np.clip(np.asarray(action, np.float64)[: self.model.nu], -1.0, 1.0)
        self.data.ctrl[:] = self._low + (self._action + 1.0) / 2.0 * (self._high - self._low)
        self._before, self._started = np.array(self.data.subtree_com[0]), self.data.time

    def run(self) -> None:
        """Simulate the action."""
        import mujoco

        mujoco.mj_step(self.model, self.data, self._rules.frame_skip)
        self.steps += 1
        self.unstable = _unstable(self.data)
        if not self.unstable:
            mujoco.mj_forward(self.model, self.data)

    def judge(self) -> tuple[float, bool, bool, Mapping[str, Any]]:
        """Return the reward, whether the episode is terminated, whether it is truncated, and further infos.

        The episode is terminated if `terminated` returns true or if the simulation is unstable (reward 0). Raises `FamilyError` for an
        invalid reward.
        """
        if self.unstable:
            return 0.0, True, False, {"unstable": True}
        done = StepInfo(
            model=self.model, data=self.data, variant=self.variant, action=self._action, before=self._before,
            after=np.array(self.data.subtree_com[0]), seconds=self.data.time - self._started, start=self.start,
        )
        ended = self._rules.terminated is not None and bool(self._rules.terminated(done))
        return _number(self._rules.reward(done)), ended, self.steps >= self._rules.max_steps, {}


def _number(reward: Any) -> float:
    """Convert a reward to a number. Raises `FamilyError` for NaN and other invalid values, because training would continue with them."""
    try:
        number = float(reward)
    except (TypeError, ValueError):
        number = math.nan
    if math.isnan(number):
        raise FamilyError(f"expected `reward` to return a number, found `{reward}`")
    return number


def _keyframe(model: mujoco.MjModel, pose: str, name: str) -> int:
    names = [model.key(k).name for k in range(model.nkey)]
    if pose not in names:
        raise UnknownVariant(f"variant `{name}` has no pose `{pose}`: {did_you_mean(str(pose), names, what='poses')}")
    return names.index(pose)


def _unstable(data: mujoco.MjData) -> bool:
    """Return whether MuJoCo has reset the simulation because of invalid or very large numbers."""
    import mujoco

    faults = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
    return any(data.warning[fault].number for fault in faults)


def spans_of(model: mujoco.MjModel) -> tuple[Array, Array]:
    """Return the lower and upper bounds of all controls, each with shape (nu,). The bounds of a control without limits are [-1, 1]."""
    limited = model.actuator_ctrllimited.astype(bool)
    return np.where(limited, model.actuator_ctrlrange[:, 0], -1.0), np.where(limited, model.actuator_ctrlrange[:, 1], 1.0)

"""The options of Gymnasium environments for families of robots."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypedDict

import mujoco
import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import did_you_mean
from thingc.batch.gym.rewards import TASKS, Reward, Terminated
from thingc.batch.results import FamilyError, UnknownVariant
from thingc.batch.run_options import at_least, is_number, is_whole, require_functions
from thingc.modes.robot import CHOICES, OnMotion

Settings = Mapping[str, Any]
Draw = Callable[[np.random.Generator], Settings]
MaySwitch = Callable[["mujoco.MjData", str, str], bool]

CACHED = 1024
"""Default number of cached morphologies, in addition to the morphologies that environments are simulating."""


class EnvOptions(TypedDict, total=False):
    """The options of the functions `make_vec_env` and `make_env`.

    Attributes:
        settings: Settings of robots. For each episode, one set of settings is drawn with equal probability. The option can also be a
            function that draws settings with a `numpy.random.Generator`. The default is all valid variants of the document that satisfy its
            rules, or the robot of an assembly.
        mode: The mode of the models (default: the mode of the family).
        modes: The modes between which actions can switch. Episodes start in the first of these modes. With this option, an action is a
            mapping with `mode` and `joints`, which has one element for each actuator: those of the first mode, then those that only later
            modes have.
        on_motion: The behaviour if the new mode holds a link that moves: `"impact"` (default) or `"drop"` stops the link, and `"raise"`
            refuses the switch.
        may_switch: A function of an `MjData` and the names of the old and the new mode. If the function returns False, the switch is
            refused.
        floor: Whether models include the floor of the scene (default: true).
        visual: Whether models include visual geometry (default: only with `render_mode`).
        reward: A function of a `StepInfo`, or a name in `TASKS` (default: `"hold"`).
        terminated: A function of a `StepInfo` that returns True to end an episode.
        frame_skip: Number of simulation steps per action (default: 5).
        max_steps: Number of actions per episode (default: 1000).
        observation: The terms of an observation: `qpos`, `qvel`, `joints` (the positions and velocities of all joints, in the order of the
            `coordinates` of `family.modes(settings, *modes)`, which is the same in every mode), `sensors`, `gravity` (the direction of
            gravity in the root link of the first mode), `action` (the last action) and `mode` (one-hot encoding of the mode). By default,
            the terms are `qpos` and `qvel`, or, with `modes`, `joints`, `gravity` and `mode`.
        observation_noise: The largest random change of the numbers in an observation, except in the terms `action` and `mode`, or a mapping
            from terms to such changes.
        descriptor: Names in `family.space` whose values are appended to the observation. Each value is scaled from its bounds to [-1, 1].
        action_scale: The change of a control for an action of 1. By default, the interval [-1, 1] is mapped to the range of each control.
        action_offset: The controls for an action of 0, if there is an `action_scale` (default: the controls of the first keyframe of the
            mode).
        action_delay: The number of actions by which controls are delayed. If the option is a tuple of the smallest and the largest number,
            the delay is drawn for each episode. By default, each drive has the `delay` that its document specifies.
        push: A tuple of a number of actions and an impulse [N s]. Once in this number of actions, a random body is pushed in a random
            horizontal direction.
        pose: The keyframe in which episodes start (default: the first keyframe).
        noise: Maximum random change of each degree of freedom at the start [rad or m].
        cache: Number of robots whose models are cached.
        seed: The seed of the first `reset` that is called without a seed.
        render_mode: With `"rgb_array"`, the method `render` returns images.
    """

    settings: Iterable[Settings] | Draw | None
    mode: str | None
    modes: Sequence[str]
    on_motion: OnMotion
    may_switch: MaySwitch | None
    floor: bool
    visual: bool | None
    reward: Reward | str
    terminated: Terminated | None
    frame_skip: int
    max_steps: int
    observation: Sequence[str] | str | None
    observation_noise: float | Mapping[str, float]
    descriptor: Sequence[str] | str
    action_scale: float | Sequence[float] | None
    action_offset: float | Sequence[float] | None
    action_delay: int | tuple[int, int] | None
    push: tuple[int, float] | None
    pose: str | None
    noise: float
    cache: int
    seed: int | None
    render_mode: str | None


class EnvRules(FrozenStruct):
    """The checked options of an environment, including default values for all other options. The class `EnvOptions` documents the options.

    Raises `UnknownVariant` for an unknown task, and `FamilyError` for an invalid value of an option.
    """

    settings: Iterable[Settings] | Draw | None = None
    mode: str | None = None
    modes: Sequence[str] = ()
    on_motion: OnMotion = "impact"
    may_switch: MaySwitch | None = None
    floor: bool = True
    visual: bool | None = None
    reward: Reward | str = "hold"
    terminated: Terminated | None = None
    frame_skip: int = 5
    max_steps: int = 1000
    observation: Sequence[str] | str | None = None
    observation_noise: float | Mapping[str, float] = 0.0
    descriptor: Sequence[str] | str = ()
    action_scale: float | Sequence[float] | None = None
    action_offset: float | Sequence[float] | None = None
    action_delay: int | tuple[int, int] | None = None
    push: tuple[int, float] | None = None
    pose: str | None = None
    noise: float = 0.0
    cache: int = CACHED
    seed: int | None = None
    render_mode: str | None = None

    def __post_init__(self) -> None:
        if isinstance(self.reward, str) and self.reward not in TASKS:
            raise UnknownVariant(f"unknown task `{self.reward}`", did_you_mean(self.reward, TASKS, what="tasks"))
        require_functions("a `StepInfo`", reward=self.reward_function, terminated=self.terminated)
        require_functions("an `MjData` and the names of two modes", may_switch=self.may_switch)
        at_least(1, frame_skip=self.frame_skip, max_steps=self.max_steps, cache=self.cache)
        at_least(0, whole=False, noise=self.noise)
        at_least(0, seed=0 if self.seed is None else self.seed)
        if self.mode is not None and self.modes:
            raise FamilyError("`mode` and `modes` cannot be used together", "use only `modes`, and begin the list with the first mode")
        delays, delay, push = self.delays, self.action_delay, self.push
        if len(delays) != 2 or not all(is_whole(one, 0) for one in delays) or delays[0] > delays[1]:
            what = "a whole number of at least 0, or a pair of such numbers (smallest, largest)"
            raise FamilyError(f"expected `action_delay` to be {what}, found {delay}")
        if push is not None and (np.asarray(push, object).shape != (2,) or not is_whole(push[0], 1) or not is_number(push[1])):
            raise FamilyError(f"expected `push` to be a pair (number of actions, impulse [N s]), found {push}")
        if self.on_motion not in CHOICES:
            raise FamilyError(f"expected `on_motion` to be \"raise\", \"drop\" or \"impact\", found `{self.on_motion}`")
        if self.render_mode not in (None, "rgb_array"):
            raise FamilyError(f"expected `render_mode` to be \"rgb_array\" or None, found `{self.render_mode}`")

    def check_controls(self, count: int) -> None:
        """Raise `FamilyError` if `action_scale` or `action_offset` is neither a finite number nor a list of `count` finite numbers."""
        for name, value in (("action_scale", self.action_scale), ("action_offset", self.action_offset)):
            array = np.asarray(value, object)
            if value is not None and (array.shape not in ((), (count,)) or not all(map(is_number, array.flat))):
                raise FamilyError(f"expected `{name}` to be a number or a list of {count} numbers (one per control), found {value}")

    @property
    def reward_function(self) -> Reward:
        """The function that computes the reward of an action. The option `reward` can be this function, or the name of a task."""
        return TASKS[self.reward] if isinstance(self.reward, str) else self.reward

    @property
    def shows_visual(self) -> bool:
        """True if the models of the robots include visual geometry."""
        return self.render_mode is not None if self.visual is None else self.visual

    @property
    def delays(self) -> tuple[int, int]:
        """The smallest and the largest number of actions by which controls are delayed."""
        return self.action_delay if isinstance(self.action_delay, tuple) else (self.action_delay or 0,) * 2


def env_rules(options: EnvOptions) -> EnvRules:
    """Check the options of an environment and add default values.

    Raises `TypeError` for an unknown option, as Python does for unknown keyword arguments.
    """
    for name in options:
        if name not in EnvRules.__struct_fields__:
            raise TypeError(f"environments have no option `{name}`: {did_you_mean(name, EnvRules.__struct_fields__, what='options')}")
    return EnvRules(**options)

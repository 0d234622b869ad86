"""The options of environments of a family."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TypedDict

from thingc.base.suggestions import did_you_mean
from thingc.batch.gym.episode import EpisodeRules, MaySwitch, rules
from thingc.batch.gym.morphologies import Draw, Settings
from thingc.batch.gym.rewards import Reward, Terminated
from thingc.batch.results import FamilyError
from thingc.batch.run_options import is_number, is_whole
from thingc.modes.robot import CHOICES, OnMotion

CACHED = 1024
"""Default number of cached morphologies, in addition to the morphologies that are being simulated."""


class EnvOptions(TypedDict, total=False):
    """The options of `make_vec_env` and `make_env`.

    Attributes:
        settings: The settings of episodes, with equal probability, or a function that draws them with a `numpy.random.Generator`. By
            default, the valid variants of the document that satisfy its rules, or the robot of an assembly.
        mode: The mode of the models (default: that of the family).
        modes: Modes between which actions switch. Episodes start in the first. An action is then a mapping with `mode` and `joints`.
        on_motion: What happens to the motion of a link that the new mode holds: `"impact"` (default), `"drop"`, or `"raise"`, which refuses
            the switch.
        may_switch: A function of an `MjData` and the names of the old and the new mode, which refuses a switch by returning false.
        floor: Include the floor of the scene (default: true).
        visual: Include visual geometry (default: only with `render_mode`).
        reward: A function of a `StepInfo`, or a name in `TASKS` (default: `"hold"`).
        terminated: A function of a `StepInfo` that ends an episode.
        frame_skip: Number of simulation steps per action (default: 5).
        max_steps: Number of actions per episode (default: 1000).
        observation: The terms of observations: `qpos`, `qvel`, `joints` (q and v in the same order in every mode), `sensors`, `gravity`
            (its direction in the root link of the first mode), `action` (the last one) and `mode` (one number per mode, of which one is 1).
            By default `qpos` and `qvel`, or with `modes` `joints`, `gravity` and `mode`.
        observation_noise: The largest random change of the numbers in an observation except `action` and `mode`, or changes by term.
        descriptor: Names in `family.space` whose values, scaled from their bounds to [-1, 1], are appended to the observation.
        action_scale: Change of a control for an action of 1. By default, [-1, 1] is mapped to the range of each control.
        action_offset: The controls for an action of 0, if there is an `action_scale` (default: those of the first keyframe of the mode).
        action_delay: Number of actions by which controls are late, or the smallest and the largest number, drawn for each episode.
        push: After how many actions a random body is pushed in a random horizontal direction, and the impulse [N s].
        pose: The keyframe in which episodes start (default: the first).
        noise: Maximum change of each degree of freedom at the start [rad or m].
        cache: Number of morphologies to cache.
        seed: The seed of the first `reset` without a seed.
        render_mode: `"rgb_array"`: `render` returns images.
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
    action_offset: Sequence[float] | None
    action_delay: int | tuple[int, int]
    push: tuple[int, float] | None
    pose: str | None
    noise: float
    cache: int
    seed: int | None
    render_mode: str | None


DEFAULTS: EnvOptions = {
    "settings": None, "mode": None, "modes": (), "on_motion": "impact", "may_switch": None, "floor": True, "visual": None, "reward": "hold",
    "terminated": None, "frame_skip": 5, "max_steps": 1000, "observation": None, "observation_noise": 0.0, "descriptor": (),
    "action_scale": None, "action_offset": None, "action_delay": 0, "push": None, "pose": None, "noise": 0.0, "cache": CACHED, "seed": None,
    "render_mode": None,
}


def with_defaults(options: EnvOptions) -> EnvOptions:
    """Return the options with defaults. Raises `TypeError` for an unknown option, as Python does for arguments."""
    for name in options:
        if name not in DEFAULTS:
            raise TypeError(f"environments have no option `{name}`: {did_you_mean(name, DEFAULTS, what='options')}")
    return {**DEFAULTS, **options}


def episode_rules(given: EnvOptions) -> EpisodeRules:
    """Return the rules of episodes. Raises `FamilyError` for invalid options."""
    delay, push = given["action_delay"], given["push"]
    delays = delay if isinstance(delay, tuple) else (delay, delay)
    if len(delays) != 2 or not all(is_whole(one, 0) for one in delays) or delays[0] > delays[1]:
        raise FamilyError(f"expected `action_delay` to be a whole number of at least 0, or the smallest and largest one, found {delay}")
    if push is not None and (len(push) != 2 or not is_whole(push[0], 1) or not is_number(push[1])):
        raise FamilyError(f"expected `push` to be a number of actions and an impulse [N s], found {push}")
    if given["on_motion"] not in CHOICES:
        raise FamilyError(f"expected `on_motion` to be \"raise\", \"drop\" or \"impact\", found `{given['on_motion']}`")
    return rules(
        given["reward"], given["terminated"], given["frame_skip"], given["max_steps"], given["pose"], given["noise"],
        on_motion=given["on_motion"], may_switch=given["may_switch"], action_scale=given["action_scale"],
        action_offset=given["action_offset"], action_delay=delays, push=push,
    )

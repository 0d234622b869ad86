"""A Gymnasium environment for the variants of a batch.

Each episode simulates another variant of the batch (`pip install thingc[learning]`).

    from thingc.batch.gym.variants_env import make_env

    env = make_env("build/leg_sweep", mode="standing", reward="hold", max_steps=200)
    observation, info = env.reset(seed=7)           # info["variant"] is the variant of the episode
    env.reset(options={"variant": "leg_sweep_12"})  # an episode with this variant

Importing this module also registers vector environments:
`gymnasium.make_vec("thingc/Variants-v0", num_envs=8, vectorization_mode="async", folder="build/leg_sweep", mode="standing")`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from thingc.batch.gym.env_options import EnvRules
from thingc.batch.gym.episode import Episode, ModeSimulation, as_actions, known_options
from thingc.batch.gym.rewards import TASKS, Array, Reward, StepInfo, Terminated
from thingc.batch.results import BatchResults, BuiltVariant, FamilyError, Sizes, load
from thingc.batch.run_options import as_names

try:
    import gymnasium
except ImportError as fault:  # pragma: no cover - reported with a help text
    raise ImportError("environments require Gymnasium: pip install 'thingc[learning]'") from fault

__all__ = ["CACHED", "ENVIRONMENT", "TASKS", "Reward", "StepInfo", "Terminated", "VariantsEnv", "make_env"]

ENVIRONMENT = "thingc/Variants-v0"
CACHED = 16
"""Default number of compiled models that are cached."""


class VariantsEnv(gymnasium.Env[Array, Array]):
    """A Gymnasium environment that simulates one variant of a batch at a time.

    The method `reset` selects the variant. To create an environment of this class, call `make_env`. The interval [-1, 1] of each element of
    an action is mapped to the range of a control. An observation contains qpos, qvel and the descriptor of the variant. With `pad`, qpos
    and qvel are padded with 0 to the sizes of the largest variant. Smaller variants ignore additional elements of an action.
    """

    def __init__(self, family: BatchResults, rules: EnvRules, *, weights: Array, pad: bool) -> None:
        self.family = family
        self.mode = family.choose_mode(rules.mode)
        self._rules = rules
        self._weights = weights
        self._seed = rules.seed
        self._of = lru_cache(rules.cache)(self._new_episode)
        self.sizes = _sizes(family, self.mode, pad)
        self._descriptors = _descriptors(family, rules.descriptor)
        self._length = self.sizes.nq + self.sizes.nv + len(rules.descriptor)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (self._length,), np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (self.sizes.nu,), np.float64)
        self.variant: BuiltVariant | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Start an episode with a random variant.

        With `options["variant"]`, start an episode with this variant, given by its id, name or index.
        """
        if seed is None:
            seed, self._seed = self._seed, None
        super().reset(seed=seed)
        variant_key = known_options(options, ("variant",)).get("variant")
        place = self.np_random.choice(len(self.family), p=self._weights)  # always draw, so that options do not change later draws
        self.variant = self.family[int(place) if variant_key is None else variant_key]
        episode = self._of(self.variant)
        episode.begin(self.np_random, self.variant.name)
        return self._observation(episode), {"variant": self.variant.id}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Apply an action with shape (nu,), and run `frame_skip` simulation steps.

        The episode is terminated if the option `terminated` returns True, or if the simulation is unstable (reward 0).
        """
        episode = self._now()
        episode.ask(as_actions(action, self.action_space.shape))
        episode.run()
        reward, terminated, truncated, more = episode.judge()
        return self._observation(episode), reward, terminated, truncated, {"variant": episode.variant.id, **more}

    @property
    def model(self) -> mujoco.MjModel:
        """The MuJoCo model of the variant in the current episode. The model changes with each call of `reset`."""
        return self._now().model

    @property
    def data(self) -> mujoco.MjData:
        """The MuJoCo data of the current episode, for reading or rendering (`mujoco.Renderer(env.model)`)."""
        return self._now().data

    def _now(self) -> Episode:
        if self.variant is None:
            raise FamilyError("reset the environment first")
        return self._of(self.variant)

    def _observation(self, episode: Episode) -> Array:
        model, data = episode.model, episode.data
        observation = np.zeros(self._length)
        observation[: model.nq] = data.qpos
        observation[self.sizes.nq: self.sizes.nq + model.nv] = data.qvel
        observation[self.sizes.nq + self.sizes.nv:] = self._descriptors[episode.variant.id]
        return observation

    def _new_episode(self, variant: BuiltVariant) -> Episode:
        """Create an episode that simulates a variant."""
        (model,) = self.family.models([variant], self.mode, scene=self._rules.floor, visual=self._rules.shows_visual)
        return Episode([ModeSimulation(self.mode, model, np.arange(model.nu))], [mujoco.MjData(model)], variant, self._rules)


def make_env(
    folder: str | os.PathLike[str] | BatchResults, *, mode: str | None = None, scene: bool = True, visual: bool = True,
    reward: Reward | str = "hold", terminated: Terminated | None = None, frame_skip: int = 5, max_steps: int = 1000,
    descriptor: Sequence[str] | str = (), weights: str | Callable[[BuiltVariant], float] | None = None, pose: str | None = None,
    noise: float = 0.0, pad: bool = False, cache: int = CACHED, seed: int | None = None,
) -> VariantsEnv:
    """Create a Gymnasium environment for the variants of a batch, given by its folder or by the result of `load`.

    Args:
        mode: The mode of the models (default: the mode that was passed to `load`, or the only mode).
        scene: Whether models include the floor of the scene.
        visual: Whether models include visual geometry. Models without visual geometry move in the same way, and compile in less than half
            the time.
        reward: A function of a `StepInfo`, or a name in `TASKS`.
        terminated: A function of a `StepInfo` that returns True to end an episode.
        frame_skip: Number of simulation steps per action.
        max_steps: Number of actions per episode.
        descriptor: Columns of the table whose cells are appended to the observation. The cells of a column are scaled to [-1, 1] over all
            variants (0 if all cells are equal).
        weights: Relative probabilities of variants: the name of a column, or a function of a variant (default: uniform).
        pose: The keyframe in which episodes start (default: the first keyframe).
        noise: Maximum random change of each degree of freedom at the start [rad or m].
        pad: Whether variants can have different sizes nq, nv and nu.
        cache: Number of compiled models to cache.
        seed: The seed of the first `reset` that is called without a seed.

    Raises `FamilyError` for a batch without variants, or if variants differ in nq, nv or nu without `pad`. Raises `UnknownVariant` for an
    unknown mode, column or task.
    """
    family = folder if isinstance(folder, BatchResults) else load(folder)
    if not len(family):
        raise FamilyError(f"batch `{family.name}` has no built variant to simulate")
    rules = EnvRules(
        mode=mode, floor=scene, visual=visual, reward=reward, terminated=terminated, frame_skip=frame_skip, max_steps=max_steps,
        descriptor=as_names(descriptor=descriptor), pose=pose, noise=noise, cache=cache, seed=seed,
    )
    return VariantsEnv(family, rules, weights=_weights(family, weights), pad=pad)


def _sizes(family: BatchResults, mode: str, pad: bool) -> Sizes:
    """Return the largest sizes nq, nv and nu among all variants.

    Raises `FamilyError` if sizes differ between variants and `pad` is not set.
    """
    sizes = [variant.sizes(mode) for variant in family]
    for name in ("nq", "nv", "nu") if not pad else ():
        values = [getattr(one, name) for one in sizes]
        other = next((k for k, value in enumerate(values) if value != values[0]), None)
        if other is not None:
            raise FamilyError(
                f"`{family[0].name}` and `{family[other].name}` differ in {name} ({values[0]} and {values[other]}) in mode `{mode}`",
                "select equal variants (`load(..., where=...)`), or use `pad=True`"
            )
    return Sizes(nq=max(one.nq for one in sizes), nv=max(one.nv for one in sizes), nu=max(one.nu for one in sizes))


def _descriptors(family: BatchResults, columns: Sequence[str]) -> dict[str, Array]:
    """Return a mapping from the id of each variant to its cells in the given columns.

    The cells of each column are scaled to [-1, 1] over all variants. Raises `FamilyError` if a cell is not a number.
    """
    table = np.array([_numbers(family, name) for name in columns]).reshape(len(columns), len(family)).T
    low, high = table.min(axis=0), table.max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    scaled = np.where(high > low, 2.0 * (table - low) / span - 1.0, 0.0)
    return {variant.id: row for variant, row in zip(family, scaled, strict=True)}


def _weights(family: BatchResults, weights: str | Callable[[BuiltVariant], float] | None) -> Array:
    """Return an array with the probability of each variant. Raises `FamilyError` if the weights are invalid."""
    if weights is None:
        return np.full(len(family), 1.0 / len(family))
    if not isinstance(weights, str) and not callable(weights):
        raise FamilyError(f"expected `weights` to be a column, or a function of a variant, found `{weights}`")
    numbers = np.array(_numbers(family, weights) if isinstance(weights, str) else [float(weights(variant)) for variant in family])
    if (numbers < 0.0).any() or not np.isfinite(numbers).all() or numbers.sum() <= 0.0:
        raise FamilyError("expected non-negative weights, at least one of them above 0")
    return np.asarray(numbers / numbers.sum(), np.float64)


def _numbers(family: BatchResults, column: str) -> list[float]:
    cells = family.column(column)
    for variant, cell in zip(family, cells, strict=True):
        if not isinstance(cell, int | float) or not np.isfinite(cell):
            raise FamilyError(f"expected numbers in the column `{column}`, found `{cell}` for variant `{variant.name}`")
    return [float(cell) for cell in cells]


if ENVIRONMENT not in gymnasium.registry:
    gymnasium.register(ENVIRONMENT, entry_point="thingc.batch.gym.variants_env:make_env")

"""A Gymnasium environment over a batch: every episode is another variant's (`pip install thingc[learning]`).

    from thingc.batch.gym.variants_env import make_env

    env = make_env("build/leg_sweep", mode="standing", reward="hold", max_steps=200)
    observation, info = env.reset(seed=7)           # info["variant"] is whose episode it is
    env.reset(options={"variant": "leg_sweep_12"})  # an episode of this one

Importing this module registers it, for vectors of environments: `gymnasium.make_vec("thingc/Variants-v0", num_envs=8,
vectorization_mode="async", folder="build/leg_sweep", mode="standing")`.
"""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.batch.gym.episode import Episode, EpisodeRules, SimulationStep, as_actions, known_options, rules, spans_of
from thingc.batch.gym.rewards import TASKS, Array, Reward, StepInfo, Terminated
from thingc.batch.results import BatchResults, BuiltVariant, FamilyError, Sizes, load
from thingc.batch.run_options import as_names, at_least

try:
    import gymnasium
except ImportError as fault:  # pragma: no cover - said in words
    raise ImportError("environments need Gymnasium: pip install 'thingc[learning]'") from fault

if TYPE_CHECKING:
    import mujoco

__all__ = ["CACHED", "ENVIRONMENT", "TASKS", "Reward", "StepInfo", "Terminated", "VariantsEnv", "make_env"]

ENVIRONMENT = "thingc/Variants-v0"
CACHED = 16
"""Compiled models that an environment keeps, unless told otherwise."""


class VariantsEnv(gymnasium.Env[Array, Array]):
    """One robot of a batch at a time: `reset` chooses the variant. Make it with `make_env`, which says what it is given.

    An action in [-1, 1] spans each control's range. The observation is qpos, qvel and the descriptor; with `pad`, each of the
    three has room for the largest variant, and what a variant has not is 0.
    """

    metadata: dict[str, Any] = {"render_modes": []}
    render_mode = None

    def __init__(
        self, family: BatchResults, simulated: SimulationStep, rules: EpisodeRules, *, descriptor: Sequence[str], weights: Array,
        pad: bool, seed: int | None,
    ) -> None:
        self.family = family
        self.mode = simulated.mode
        self._simulated = simulated
        self._rules = rules
        self._weights = weights
        self._seed = seed
        self._episodes: OrderedDict[str, Episode] = OrderedDict()
        self.sizes = _sizes(family, simulated.mode, pad)
        self._descriptors = _descriptors(family, descriptor)
        self._length = self.sizes.nq + self.sizes.nv + len(descriptor)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (self._length,), np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (self.sizes.nu,), np.float64)
        self.variant: BuiltVariant | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin an episode: of the variant `options["variant"]` (its id, name or place), else of one that is drawn."""
        if seed is None:
            seed, self._seed = self._seed, None
        super().reset(seed=seed)
        wanted = known_options(options, ("variant",)).get("variant")
        place = self.np_random.choice(len(self.family), p=self._weights)  # drawn in any case: options do not change what follows
        self.variant = self.family[int(place) if wanted is None else wanted]
        episode = self._of(self.variant)
        episode.begin(self.np_random, self.variant.name)
        return self._observation(episode), {"variant": self.variant.id}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Apply an action (nu,) for `frame_skip` steps of the simulation. An episode ends early where `terminated` says so, or
        where the simulation has become unstable (reward 0)."""
        episode = self._now()
        episode.ask(as_actions(action, self.action_space.shape))
        episode.run()
        reward, terminated, truncated, more = episode.judge()
        return self._observation(episode), reward, terminated, truncated, {"variant": episode.variant.id, **more}

    @property
    def model(self) -> mujoco.MjModel:
        """The model of the episode's variant; another one after each `reset`."""
        return self._now().model

    @property
    def data(self) -> mujoco.MjData:
        """Its state, to look at or to draw (`mujoco.Renderer(env.model)`)."""
        return self._now().data

    def _now(self) -> Episode:
        if self.variant is None:
            raise FamilyError("reset the environment first")
        return self._of(self.variant)

    def _observation(self, episode: Episode) -> Array:
        model, data = episode.model, episode.data
        seen = np.zeros(self._length)
        seen[: model.nq] = data.qpos
        seen[self.sizes.nq: self.sizes.nq + model.nv] = data.qvel
        seen[self.sizes.nq + self.sizes.nv:] = self._descriptors[episode.variant.id]
        return seen

    def _of(self, variant: BuiltVariant) -> Episode:
        """The episode of a variant, with its compiled model; those used least lately are forgotten."""
        import mujoco

        episode = self._episodes.get(variant.id)
        if episode is None:
            one = self._simulated
            (model,) = self.family.models([variant], one.mode, scene=one.floor, visual=one.visual)
            episode = self._episodes[variant.id] = Episode(model, mujoco.MjData(model), variant, self._rules, spans_of(model))
            while len(self._episodes) > self._simulated.cache:
                self._episodes.popitem(last=False)
        self._episodes.move_to_end(variant.id)
        return episode


def make_env(
    folder: str | os.PathLike[str] | BatchResults, *, mode: str | None = None, scene: bool = True, visual: bool = True,
    reward: Reward | str = "hold", terminated: Terminated | None = None, frame_skip: int = 5, max_steps: int = 1000,
    descriptor: Sequence[str] | str = (), weights: str | Callable[[BuiltVariant], float] | None = None, pose: str | None = None,
    noise: float = 0.0, pad: bool = False, cache: int = CACHED, seed: int | None = None,
) -> VariantsEnv:
    """An environment over the variants of a batch (its folder, or a family of `load`, filtered as you like).

    `reward` is a function of a `StepInfo` or a name in `TASKS`, `terminated` one that ends an episode. An action holds for `frame_skip`
    steps of the simulation, an episode lasts `max_steps` actions. `descriptor` are columns of the table that the observation ends
    with, each scaled to [-1, 1] over the family (0 where all are equal). `weights` makes variants likelier: a column, or a function
    of a variant; uniform unless given. `pose` is the keyframe that episodes begin with (the first one unless given), `noise` [rad
    or m] how far at most each degree of freedom is moved from there. `cache` models are kept compiled; without `visual` they lack
    what is only drawn, move in the same way, and are compiled in less than half the time. `seed` is that of the first `reset`
    without one.

    Raises `FamilyError` for a batch without variants and where variants differ in nq, nv or nu (`pad` makes room for the
    largest), and `UnknownVariant` for an unknown mode, column or task.
    """
    family = folder if isinstance(folder, BatchResults) else load(folder)
    if not len(family):
        raise FamilyError(f"batch `{family.name}` has no built variant here: there is nothing to simulate")
    at_least(1, cache=cache)
    return VariantsEnv(
        family, SimulationStep(mode=family.chosen(mode), floor=scene, visual=visual, cache=cache),
        rules(reward, terminated, frame_skip, max_steps, pose, noise), descriptor=as_names(descriptor=descriptor),
        weights=_weights(family, weights), pad=pad, seed=seed,
    )


def _sizes(family: BatchResults, mode: str, pad: bool) -> Sizes:
    """The largest sizes. Raises `FamilyError` where they differ and need not be padded."""
    sizes = [variant.sizes(mode) for variant in family]
    for name in ("nq", "nv", "nu") if not pad else ():
        values = [getattr(one, name) for one in sizes]
        other = next((k for k, value in enumerate(values) if value != values[0]), None)
        if other is not None:
            raise FamilyError(
                f"in mode `{mode}` variant `{family[0].name}` has {name} = {values[0]} and `{family[other].name}` has {values[other]}: "
                "choose variants of one kind (`load(..., where=...)`), or make room for all with `pad=True`"
            )
    return Sizes(nq=max(one.nq for one in sizes), nv=max(one.nv for one in sizes), nu=max(one.nu for one in sizes))


def _descriptors(family: BatchResults, columns: Sequence[str]) -> dict[str, Array]:
    """By variant's id the cells of the columns, each scaled to [-1, 1]. Raises `FamilyError` for a cell that is no number."""
    table = np.zeros((len(family), len(columns)))
    for k, name in enumerate(columns):
        table[:, k] = _numbers(family, name)
    low, high = table.min(axis=0), table.max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    scaled = np.where(high > low, 2.0 * (table - low) / span - 1.0, 0.0)
    return {variant.id: row for variant, row in zip(family, scaled, strict=True)}


def _weights(family: BatchResults, weights: str | Callable[[BuiltVariant], float] | None) -> Array:
    """Probabilities, one for each variant. Raises `FamilyError` where they cannot be made of the weights."""
    if weights is None:
        return np.full(len(family), 1.0 / len(family))
    if not isinstance(weights, str) and not callable(weights):
        raise FamilyError(f"expected `weights` to be a column, or a function of a variant, found `{weights}`")
    numbers = np.array(_numbers(family, weights) if isinstance(weights, str) else [float(weights(variant)) for variant in family])
    if (numbers < 0.0).any() or not np.isfinite(numbers).all() or numbers.sum() <= 0.0:
        raise FamilyError("expected weights that are not negative, and not all 0")
    return np.asarray(numbers / numbers.sum(), np.float64)


def _numbers(family: BatchResults, column: str) -> list[float]:
    cells = family.column(column)
    for variant, cell in zip(family, cells, strict=True):
        if not isinstance(cell, int | float) or not np.isfinite(cell):
            raise FamilyError(f"expected numbers in the column `{column}`, found `{cell}` for variant `{variant.name}`")
    return [float(cell) for cell in cells]


if ENVIRONMENT not in gymnasium.registry:
    gymnasium.register(ENVIRONMENT, entry_point="thingc.batch.gym.variants_env:make_env")

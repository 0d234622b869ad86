"""Gymnasium vector environments for a family, in one process, with a different robot in each world (`pip install thingc[learning]`).

    from thingc.batch.gym.family_env import make_vec_env

    envs = make_vec_env("legs.yaml", 64, mode="standing", reward="forward")
    observations, infos = envs.reset(seed=7)

Importing this module registers `gymnasium.make_vec("thingc/Family-v0", num_envs=64, family="legs.yaml", mode="standing")`, and
`gymnasium.make` with this name for a single world (see `make_env`).
"""

from __future__ import annotations

import os
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import did_you_mean
from thingc.batch.families.family import RobotFamily, as_many
from thingc.batch.families.family import family as family_of
from thingc.batch.families.results import NoModel
from thingc.batch.gym.episode import Episode, EpisodeRules, SimulationStep, as_actions, known_options, rules, spans_of
from thingc.batch.gym.rewards import Array, Descriptor, Reward, StepInfo, Terminated
from thingc.batch.results import FamilyError, UnknownVariant
from thingc.batch.run_options import as_names, at_least

try:
    import gymnasium
    from gymnasium.error import ClosedEnvironmentError
    from gymnasium.utils import seeding
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError as fault:  # pragma: no cover - reported with a help text
    raise ImportError("environments need Gymnasium: pip install 'thingc[learning]'") from fault

if TYPE_CHECKING:
    import mujoco

__all__ = [
    "CACHED", "ENVIRONMENT", "FamilyEnv", "FamilyVectorEnv", "Reward", "Settings", "StepInfo", "Terminated", "make_env", "make_vec_env",
]

ENVIRONMENT = "thingc/Family-v0"
CACHED = 1024
"""Default number of cached morphologies, in addition to the morphologies that are being simulated."""
DRAWS = 100
"""Maximum number of successive refused settings when an episode starts."""

Settings = Mapping[str, Any]
Draw = Callable[[np.random.Generator], Settings]


class MorphologyDistribution(FrozenStruct):
    """The distribution of robots over episodes: uniform over `many` settings, or the function `draw` of a random generator.

    `ids` are the values of `infos["variant"]` (empty: indices), and `names` are the names of the settings.
    """

    many: Sequence[Settings] = ()
    ids: Sequence[str] = ()
    names: Sequence[str] = ()
    draw: Draw | None = None


class WorldPool(FrozenStruct):
    """The numbers of worlds and threads, the autoreset mode, and the seed of the first `reset` without a seed."""

    count: int
    threads: int
    autoreset: AutoresetMode
    seed: int | None


class Morphology:
    """A model, its descriptor, and the `spans` of its controls. Models with equal `layout` (sizes and names) can share an `MjData`."""

    __slots__ = ("described", "layout", "model", "settings", "spans")

    def __init__(self, model: mujoco.MjModel, settings: Settings, described: Array) -> None:
        self.model = model
        self.settings = settings
        self.described = described
        self.spans = spans_of(model)
        sizes = [getattr(model, name) for name in dir(model) if name.startswith("n")]
        self.layout = (model.names, *(size for size in sizes if isinstance(size, int)))


class FamilyVectorEnv(VectorEnv[Array, Array, np.ndarray[Any, Any]]):
    """Worlds with robots of a family, which are stepped together in threads. Create it with `make_vec_env`.

    A world behaves like a single environment of `thingc.batch.gym.variants_env` with the same robot: it has the same observations, rewards
    and infos, and the same episodes for the same seed. When an episode has ended, the world restarts as defined by
    `metadata["autoreset_mode"]`. If settings are refused, new settings are drawn; `refused` counts the refused settings by message.
    """

    metadata: dict[str, Any] = {"render_modes": []}
    render_mode = None

    def __init__(
        self, family: RobotFamily, worlds: WorldPool, choices: MorphologyDistribution, simulated: SimulationStep, rules: EpisodeRules, *,
        descriptor: Sequence[str], owned: bool,
    ) -> None:
        num_envs = worlds.count
        self.family = family
        self.num_envs = num_envs
        self.mode = simulated.mode
        self.metadata = {**self.metadata, "autoreset_mode": worlds.autoreset}
        self._choices = choices
        self._rules = rules
        self._simulated = simulated
        self._autoreset = worlds.autoreset
        self._seed = worlds.seed
        self._owned = owned
        self._threads = min(worlds.threads, num_envs)
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None
        self._kept: OrderedDict[Any, Morphology | NoModel] = OrderedDict()
        self.refused: Counter[str] = Counter()
        self._worlds: list[tuple[Any, Morphology, Episode] | None] = [None] * num_envs
        self._sources: list[np.random.Generator | None] = [None] * num_envs
        self._ended = np.zeros(num_envs, dtype=bool)
        if choices.many:
            self._likely = np.full(len(choices.many), 1.0 / len(choices.many)).cumsum()  # as in `choice` of numpy
            self._likely /= self._likely[-1]
        self._descriptor = Descriptor(family, descriptor)
        for key, settings in enumerate(choices.many or ({},)):
            first = self._made([key if choices.many else ()], [settings], None)[0]
            if isinstance(first, Morphology):
                break
        if isinstance(first, NoModel):
            raise _refusal(first)
        self._first = first.model
        length = self._first.nq + self._first.nv + len(descriptor)
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (length,), np.float64)
        self.single_action_space = gymnasium.spaces.Box(-1.0, 1.0, (self._first.nu,), np.float64)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._observations = np.zeros((num_envs, length))

    # --- Gymnasium API --------------------------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode in every world, or in the worlds selected by `options["reset_mask"]`.

        Each world uses a random variant, or all worlds use `options["variant"]` (an index, or for a variants document also an id or name).
        World k uses the seed `seed + k`. Raises gymnasium's `ClosedEnvironmentError` after `close`.
        """
        self._open()
        options = known_options(options, ("variant", "reset_mask"))
        mask = np.asarray(options.pop("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != bool or not mask.any():
            raise FamilyError(f"expected `reset_mask` to be {self.num_envs} flags, at least one of them set, found {mask!r}")
        if seed is None:
            seed, self._seed = self._seed, None
        seeds = self._seeds(seed)
        infos: dict[str, Any] = {}
        worlds = np.flatnonzero(mask).tolist()
        for k in worlds:
            if self._sources[k] is None or seeds[k] is not None:
                self._sources[k], _ = seeding.np_random(seeds[k])
        self._begin(worlds, infos, options.get("variant"))
        self._ended[mask] = False
        return self._observations.copy(), infos

    def step(self, actions: Array) -> tuple[Array, Array, np.ndarray[Any, Any], np.ndarray[Any, Any], dict[str, Any]]:
        """Apply actions with shape (num_envs, nu).

        With `NextStep`, worlds with ended episodes restart instead. Raises `ClosedEnvironmentError` after `close`.
        """
        self._open()
        actions = as_actions(actions, self.action_space.shape)
        if self._autoreset is AutoresetMode.DISABLED and self._ended.any():
            raise FamilyError(f"the episodes of the worlds {np.flatnonzero(self._ended).tolist()} have ended: reset them")
        infos: dict[str, Any] = {}
        rewards = np.zeros(self.num_envs)
        terminated, truncated = np.zeros(self.num_envs, dtype=bool), np.zeros(self.num_envs, dtype=bool)
        begun = np.flatnonzero(self._ended).tolist()
        going = np.flatnonzero(~self._ended).tolist()
        episodes = [self._world(k)[2] for k in going]
        for k, episode in zip(going, episodes):
            episode.ask(actions[k])
        self._simulate(episodes)
        for k, episode in zip(going, episodes):
            rewards[k], terminated[k], truncated[k], more = episode.judge()
            self._see(k)
            infos = self._add_info(infos, {**self._called(k), **more}, k)
        self._begin(begun, infos, None)
        self._ended = terminated | truncated
        if self._autoreset is AutoresetMode.SAME_STEP and self._ended.any():
            again = np.flatnonzero(self._ended).tolist()
            for k in again:
                last = {name: value[k] for name, value in infos.items() if not name.startswith("_") and infos[f"_{name}"][k]}
                infos = self._add_info(infos, {"final_obs": self._observations[k].copy(), "final_info": last}, k)
            self._begin(again, infos, None)
            self._ended[:] = False
        return self._observations.copy(), rewards, terminated, truncated, infos

    @property
    def settings(self) -> tuple[Settings, ...]:
        """The settings of the robot in each world, which change with every episode."""
        return tuple(self._world(k)[1].settings for k in range(self.num_envs))

    @property
    def models(self) -> tuple[mujoco.MjModel, ...]:
        """The model of each world. Worlds with equal settings share a model, so do not modify it."""
        return tuple(self._world(k)[2].model for k in range(self.num_envs))

    @property
    def data(self) -> tuple[mujoco.MjData, ...]:
        """The state of each world, for reading or rendering with the model of the world. `data.model` can be another model."""
        return tuple(self._world(k)[2].data for k in range(self.num_envs))

    @property
    def sources(self) -> tuple[np.random.Generator, ...]:
        """The random generator of each world."""
        return tuple(self._source(k) for k in range(self.num_envs))

    def close_extras(self, **named: Any) -> None:
        """End the threads, and the worker of a family that this environment opened."""
        if self._pool is not None:
            self._pool.shutdown()
        if self._owned:
            self.family.close()

    # --- implementation -------------------------------------------------------------------------------------------------

    def _open(self) -> None:
        """Raise `ClosedEnvironmentError` after `close`, with Gymnasium's message."""
        if self.closed:
            raise ClosedEnvironmentError(f"Trying to operate on `{type(self).__name__}`, after a call to `close()`.")

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """Return a seed for each world. None means that the random generator of the world does not change."""
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, Integral):
            return [int(seed) + k for k in range(self.num_envs)]
        seeds = list(seed) if isinstance(seed, Iterable) and not isinstance(seed, str) else []
        if len(seeds) != self.num_envs or not all(one is None or isinstance(one, Integral) for one in seeds):
            raise FamilyError(f"expected a seed, or {self.num_envs} of them, one for each world, found `{seed}`")
        return [None if one is None else int(one) for one in seeds]

    def _simulate(self, episodes: Sequence[Episode]) -> None:
        """Run the episodes. A large number of episodes runs in threads, because MuJoCo releases the GIL while it steps."""
        if self._pool is None or len(episodes) < 2 * self._threads:
            _run(episodes)
        else:
            list(self._pool.map(_run, [episodes[k:: self._threads] for k in range(self._threads)]))

    def _begin(self, worlds: Sequence[int], infos: dict[str, Any], wanted: Any) -> None:
        """Start episodes. Refused settings are redrawn. Raises `FamilyError` if `wanted` or too many other settings are refused."""
        refused: NoModel | None = None
        for _ in range(DRAWS if wanted is None else 1):
            drawn = [self._drawn(self._source(k), wanted) for k in worlds]
            keys, again = [key for key, _ in drawn], []
            for k, key, morphology in zip(worlds, keys, self._made(keys, [settings for _, settings in drawn], self._first)):
                if isinstance(morphology, NoModel):
                    refused = morphology
                    self.refused[morphology.reason] += 1
                    again.append(k)
                    continue
                episode = Episode(morphology.model, self._state(k, morphology), morphology.settings, self._rules, morphology.spans)
                self._worlds[k] = (key, morphology, episode)
                episode.begin(self._source(k), self._name(key))
                self._see(k)
                self._add_info(infos, self._called(k), k)
            worlds = again
        if worlds and refused is not None:
            raise _refusal(refused)

    def _drawn(self, source: np.random.Generator, wanted: Any) -> tuple[Any, Settings]:
        """Return the key of settings in the cache, and the settings."""
        if self._choices.draw is not None:
            if wanted is not None:
                raise UnknownVariant(f"there is no variant `{wanted}`: a function draws the settings")
            settings = self._choices.draw(source)
            return _key(settings), settings
        place = int(self._likely.searchsorted(source.random(), side="right"))  # always draw, so that options do not change later draws
        if wanted is not None:
            place = self._place(wanted)
        return place, self._choices.many[place]

    def _place(self, wanted: Any) -> int:
        ids, names, count = self._choices.ids, self._choices.names, len(self._choices.many)
        if isinstance(wanted, str) and wanted in ids:
            return list(ids).index(wanted)
        if isinstance(wanted, str) and wanted in names:
            return list(names).index(wanted)
        if isinstance(wanted, bool) or not isinstance(wanted, Integral) or not -count <= int(wanted) < count:
            known = did_you_mean(wanted, names, what="variants") if isinstance(wanted, str) and names else f"there are {count}"
            raise UnknownVariant(f"there is no variant `{wanted}`: {known}")
        return int(wanted) % count

    def _made(self, keys: Sequence[Any], many: Sequence[Settings], first: mujoco.MjModel | None) -> list[Morphology | NoModel]:
        """Return the morphologies, or `NoModel` for refused settings. Raises `FamilyError` if the sizes of a model differ from `first`."""
        new = {key: settings for key, settings in zip(keys, many) if key not in self._kept}
        simulated = self._simulated
        models = self.family.models(new.values(), mode=simulated.mode, visual=simulated.visual, floor=simulated.floor)
        for (key, settings), model in zip(new.items(), models):
            if isinstance(model, NoModel):
                self._kept[key] = model
                continue
            if first is not None and (model.nq, model.nv, model.nu) != (first.nq, first.nv, first.nu):
                sizes = [f"nq, nv, nu = {one.nq}, {one.nv}, {one.nu}" for one in (model, first)]
                raise FamilyError(f"in mode `{self.mode}` the settings {dict(settings)} have {sizes[0]}, but others {sizes[1]}")
            self._kept[key] = Morphology(model, settings, self._descriptor(settings))
        morphologies = [self._kept[key] for key in keys]
        for key in keys:
            self._kept.move_to_end(key)
        while len(self._kept) > simulated.cache:
            self._kept.popitem(last=False)
        return morphologies

    def _state(self, k: int, morphology: Morphology) -> mujoco.MjData:
        """Return the state of a world for this morphology. The state is reused if the models have the same layout."""
        import mujoco

        world = self._worlds[k]
        return world[2].data if world is not None and world[1].layout == morphology.layout else mujoco.MjData(morphology.model)

    def _world(self, k: int) -> tuple[Any, Morphology, Episode]:
        world = self._worlds[k]
        if world is None:
            raise FamilyError("reset the environments first")
        return world

    def _source(self, k: int) -> np.random.Generator:
        source = self._sources[k]
        assert source is not None
        return source

    def _see(self, k: int) -> None:
        _, morphology, episode = self._world(k)
        nq, nv = episode.model.nq, episode.model.nv
        row = self._observations[k]
        row[:nq], row[nq: nq + nv] = episode.data.qpos, episode.data.qvel
        row[nq + nv:] = morphology.described

    def _called(self, k: int) -> dict[str, Any]:
        """Return the `infos` of a world, which contain the variant of its episode."""
        key = self._world(k)[0]
        return {} if self._choices.draw is not None else {"variant": self._choices.ids[key] if self._choices.ids else key}

    def _name(self, key: Any) -> str:
        return self._choices.names[key] if self._choices.names else str(key)


def make_vec_env(
    family: RobotFamily | str | os.PathLike[str], num_envs: int = 1, *, settings: Iterable[Settings] | Draw | None = None,
    mode: str | None = None, floor: bool = True, visual: bool = False, reward: Reward | str = "hold", terminated: Terminated | None = None,
    frame_skip: int = 5, max_steps: int = 1000, descriptor: Sequence[str] | str = (), pose: str | None = None, noise: float = 0.0,
    threads: int = 0, cache: int = CACHED, autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP, seed: int | None = None,
) -> FamilyVectorEnv:
    """Create `num_envs` worlds with robots of a family or document (see `thingc.family`), which are stepped together in threads.

    Args:
        settings: The settings of episodes, with equal probability, or a function that draws them with a `numpy.random.Generator`. By
            default, the valid variants of the document that satisfy its rules.
        descriptor: Names in `family.space` whose values, scaled from their bounds to [-1, 1], are appended to the observation.
        threads: Number of threads (0: one per core).
        cache: Number of morphologies to cache.
        autoreset_mode: When a world restarts after its episode (`NextStep`, `SameStep` or `Disabled`).

    The other arguments are as in `thingc.batch.gym.variants_env.make_env`; `floor` is called `scene` there.

    If settings are refused, new settings are drawn. Raises `FamilyError` if no settings are given or too many successive settings are
    refused, `UnknownVariant` for an unknown task or descriptor, `UnknownChoice` for an unknown mode, and `CompileError` for a document with
    errors.
    """
    made = rules(reward, terminated, frame_skip, max_steps, pose, noise)
    threads = threads or os.cpu_count() or 1
    at_least(1, num_envs=num_envs, cache=cache, threads=threads)
    resetting = [mode.value for mode in AutoresetMode]
    if autoreset_mode not in (*AutoresetMode, *resetting):
        raise FamilyError(f"there is no `autoreset_mode` `{autoreset_mode}`: {did_you_mean(str(autoreset_mode), resetting, what='modes')}")
    robots = family if isinstance(family, RobotFamily) else family_of(family)
    try:
        return FamilyVectorEnv(
            robots, WorldPool(count=num_envs, threads=threads, autoreset=AutoresetMode(autoreset_mode), seed=seed),
            _choices(robots, settings),
            SimulationStep(mode=robots.mode if mode is None else mode, floor=floor, visual=visual, cache=cache), made,
            descriptor=as_names(descriptor=descriptor), owned=robots is not family,
        )
    except BaseException:
        if robots is not family:
            robots.close()
        raise


class FamilyEnv(gymnasium.Env[Array, Array]):
    """One world of a family as a single environment. Create it with `make_env`."""

    metadata: dict[str, Any] = {"render_modes": []}
    render_mode = None

    def __init__(self, world: FamilyVectorEnv) -> None:
        self._world = world
        self.observation_space = world.single_observation_space
        self.action_space = world.single_action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Start an episode with a random variant, or with `options["variant"]` (see `FamilyVectorEnv.reset`)."""
        observations, infos = self._world.reset(seed=seed, options=known_options(options, ("variant",)))
        self.np_random = self._world.sources[0]
        return observations[0], _first(infos)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Apply an action with shape (nu,). Call `reset` after an episode has ended."""
        actions = as_actions(action, self.action_space.shape)[None]
        observations, rewards, terminated, truncated, infos = self._world.step(actions)
        return observations[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), _first(infos)

    @property
    def settings(self) -> Settings:
        """The settings of the robot of the episode."""
        return self._world.settings[0]

    @property
    def model(self) -> mujoco.MjModel:
        """The model of the robot of the episode. It changes with each `reset`. Do not modify it."""
        return self._world.models[0]

    @property
    def data(self) -> mujoco.MjData:
        """The state, for reading or rendering (`mujoco.Renderer(env.model)`)."""
        return self._world.data[0]

    def close(self) -> None:
        """End the worker of a family that this environment opened."""
        self._world.close()


def _first(infos: Mapping[str, Any]) -> dict[str, Any]:
    """Return the `infos` of the only world."""
    return {name: values[0] for name, values in infos.items() if not name.startswith("_")}


def make_env(
    family: RobotFamily | str | os.PathLike[str], *, settings: Iterable[Settings] | Draw | None = None, mode: str | None = None,
    floor: bool = True, visual: bool = False, reward: Reward | str = "hold", terminated: Terminated | None = None, frame_skip: int = 5,
    max_steps: int = 1000, descriptor: Sequence[str] | str = (), pose: str | None = None, noise: float = 0.0, cache: int = CACHED,
    seed: int | None = None,
) -> FamilyEnv:
    """Create a single environment. The first world of `make_vec_env` has the same episodes. `make_vec_env` describes the arguments."""
    return FamilyEnv(make_vec_env(
        family, 1, settings=settings, mode=mode, floor=floor, visual=visual, reward=reward, terminated=terminated, frame_skip=frame_skip,
        max_steps=max_steps, descriptor=descriptor, pose=pose, noise=noise, threads=1, cache=cache,
        autoreset_mode=AutoresetMode.DISABLED, seed=seed,
    ))


def _choices(family: RobotFamily, settings: Iterable[Settings] | Draw | None) -> MorphologyDistribution:
    if callable(settings):
        return MorphologyDistribution(draw=settings)
    if settings is not None:
        many = list(as_many(settings))
        if not many:
            raise FamilyError("expected at least one item in `settings`")
        return MorphologyDistribution(many=[dict(_key(one)) for one in many])
    planned = [variant for variant in family.variants if variant.failed is None]
    kept = [variant for variant, evaluated in zip(planned, family.evaluate(planned)) if evaluated.kept]
    if not kept:
        raise FamilyError(f"`{family.name}` has no valid variants that satisfy the rules: use `settings` to specify what may be set")
    return MorphologyDistribution(
        many=[{**one.parameters, **one.choices} for one in kept], ids=[one.id for one in kept], names=[one.name for one in kept],
    )


def _key(settings: Settings) -> tuple[tuple[str, Any], ...]:
    """Return the cache key of settings. Raises `FamilyError` for settings that are not a mapping from names to numbers or strings."""
    try:
        key = tuple(sorted(settings.items()))
        hash(key)
    except (AttributeError, TypeError):
        raise FamilyError(f"expected settings as a mapping from names to numbers or strings, found `{settings!r}`") from None
    return key


def _refusal(refused: NoModel) -> FamilyError:
    return FamilyError(f"the settings {dict(refused.settings)} are rejected: {refused.reason}")


def _run(episodes: Iterable[Episode]) -> None:
    for episode in episodes:
        episode.run()


if ENVIRONMENT not in gymnasium.registry:
    gymnasium.register(
        ENVIRONMENT, entry_point="thingc.batch.gym.family_env:make_env",
        vector_entry_point="thingc.batch.gym.family_env:make_vec_env",
    )

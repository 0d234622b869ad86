"""Gymnasium vector environments in which each world simulates a different robot of a family (`pip install thingc[learning]`).

    from thingc.batch.gym.family_env import make_vec_env

    envs = make_vec_env("legs.yaml", 64, mode="standing", reward="forward")
    observations, infos = envs.reset(seed=7)

Importing this module registers `gymnasium.make_vec("thingc/Family-v0", num_envs=64, family="legs.yaml", mode="standing")`, and
`gymnasium.make` with this name for a single world (see `make_env`).
"""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from numbers import Integral
from typing import Any, Unpack

import mujoco
import numpy as np
from msgspec.structs import replace

from thingc.base.suggestions import did_you_mean
from thingc.batch.families.family import RobotFamily, family as family_of
from thingc.batch.families.results import NoModel
from thingc.batch.gym.env_options import CACHED, EnvOptions, EnvRules, Settings, env_rules
from thingc.batch.gym.episode import Episode, as_actions, known_options
from thingc.batch.gym.morphologies import Morphologies, Morphology, distribution, refusal
from thingc.batch.gym.observations import Observer
from thingc.batch.gym.rewards import Array, Reward, StepInfo, Terminated
from thingc.batch.results import FamilyError
from thingc.batch.run_options import as_names, at_least
from thingc.targets.render.picture import NoGraphics, ready

try:
    import gymnasium
    from gymnasium.error import ClosedEnvironmentError
    from gymnasium.utils import seeding
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError as fault:  # pragma: no cover - reported with a help text
    raise ImportError("environments require Gymnasium: pip install 'thingc[learning]'") from fault

__all__ = [
    "CACHED", "ENVIRONMENT", "EnvOptions", "FamilyEnv", "FamilyVectorEnv", "Reward", "Settings", "StepInfo", "Terminated", "make_env",
    "make_vec_env",
]

ENVIRONMENT = "thingc/Family-v0"
DRAWS = 100
"""Maximum number of refused settings in succession when an episode starts."""

RENDERERS = 8
"""Maximum number of open renderers. Each renderer belongs to one model."""


class FamilyVectorEnv(VectorEnv[Array, Any, np.ndarray[Any, Any]]):
    """A Gymnasium vector environment whose worlds simulate robots of a family in threads.

    To create an environment of this class, call `make_vec_env`. Each world behaves like a single environment of
    `thingc.batch.gym.variants_env` with the same robot. Observations, rewards and infos have the same form, and the same seed results in
    the same episodes. When an episode has ended, the world starts a new episode as specified by `metadata["autoreset_mode"]`. If drawn
    settings of a robot are refused, other settings are drawn. `refused` counts refused settings by error message.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}

    def __init__(self, family: RobotFamily, num_envs: int, rules: EnvRules, *, threads: int, autoreset: AutoresetMode, owned: bool) -> None:
        self.family = family
        self.num_envs = num_envs
        self.metadata = {**self.metadata, "autoreset_mode": autoreset}
        self.render_mode = rules.render_mode
        self._modes = rules.modes
        self._autoreset = autoreset
        self._seed = rules.seed
        self._owned = owned
        self._threads = min(threads, num_envs)
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None
        self._renderers: OrderedDict[int, tuple[Any, Any]] = OrderedDict()
        self._worlds: list[tuple[Any, Morphology, Episode] | None] = [None] * num_envs
        self._sources: list[np.random.Generator | None] = [None] * num_envs
        self._ended = np.zeros(num_envs, dtype=bool)
        self._morphologies = Morphologies(family, distribution(family, rules.settings), rules)
        self.refused = self._morphologies.refused
        self.mode = self._morphologies.modes[0]
        example = self._morphologies.episode(self._morphologies.first, None)
        self.metadata["render_fps"] = round(1.0 / (example.model.opt.timestep * rules.frame_skip))
        self._controls = len(self._morphologies.actuators) if rules.modes else example.model.nu
        rules.check_controls(self._controls)
        example.action = np.zeros(self._controls)
        self._observer = Observer(rules.observation, rules.observation_noise, example)
        length = self._observer.length + len(rules.descriptor)
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (length,), np.float64)
        joints = gymnasium.spaces.Box(-1.0, 1.0, (self._controls,), np.float64)
        self.single_action_space = joints if not rules.modes else gymnasium.spaces.Dict(
            mode=gymnasium.spaces.Discrete(len(rules.modes)), joints=joints,
        )
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._observations = np.zeros((num_envs, length))

    # --- Gymnasium API --------------------------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode in every world, or in the worlds selected by `options["reset_mask"]`.

        Each world simulates a random variant. With `options["variant"]`, all worlds simulate this variant, given by its index, or, for a
        variants document, also by its id or name. The world with the index k uses the seed `seed + k`. After `close`, this method raises
        gymnasium's `ClosedEnvironmentError`.
        """
        self._require_open()
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
        self._start_episodes(worlds, infos, options.get("variant"))
        self._ended[mask] = False
        return self._observations.copy(), infos

    def step(self, actions: Any) -> tuple[Array, Array, np.ndarray[Any, Any], np.ndarray[Any, Any], dict[str, Any]]:
        """Apply an action in every world. `actions` is an array (num_envs, nu). With several modes, `actions` is a mapping.

        The mapping of actions contains `mode` (num_envs,) and `joints` (num_envs, nu). Each robot first switches to the mode, and then the
        action is applied. If a switch is refused, `infos["refused"]` contains the reason. With the autoreset mode `NextStep`, a world whose
        episode has ended ignores the action and starts a new episode. After `close`, this method raises `ClosedEnvironmentError`.
        """
        self._require_open()
        modes, actions = self._split(actions)
        if self._autoreset is AutoresetMode.DISABLED and self._ended.any():
            raise FamilyError(f"the episodes of the worlds {np.flatnonzero(self._ended).tolist()} have ended", "reset them")
        infos: dict[str, Any] = {}
        rewards = np.zeros(self.num_envs)
        terminated, truncated = np.zeros(self.num_envs, dtype=bool), np.zeros(self.num_envs, dtype=bool)
        starting = np.flatnonzero(self._ended).tolist()
        running = np.flatnonzero(~self._ended).tolist()
        episodes = [self._world(k)[2] for k in running]
        for k, episode in zip(running, episodes):
            episode.ask(actions[k], modes[k])
        self._simulate(episodes)
        for k, episode in zip(running, episodes):
            rewards[k], terminated[k], truncated[k], step_info = episode.judge()
            self._observe(k)
            infos = self._add_info(infos, {**self._start_infos(k), **step_info}, k)
        self._start_episodes(starting, infos, None)
        self._ended = terminated | truncated
        if self._autoreset is AutoresetMode.SAME_STEP and self._ended.any():
            ended = np.flatnonzero(self._ended).tolist()
            for k in ended:
                last = {name: value[k] for name, value in infos.items() if not name.startswith("_") and infos[f"_{name}"][k]}
                infos = self._add_info(infos, {"final_obs": self._observations[k].copy(), "final_info": last}, k)
            self._start_episodes(ended, infos, None)
            self._ended[:] = False
        return self._observations.copy(), rewards, terminated, truncated, infos

    @property
    def settings(self) -> tuple[Settings, ...]:
        """The settings of the robot in each world. The settings of a world change with every episode."""
        return tuple(self._world(k)[1].settings for k in range(self.num_envs))

    @property
    def models(self) -> tuple[mujoco.MjModel, ...]:
        """The MuJoCo model of each world. Worlds whose robots have equal settings share a model. Do not modify these models."""
        return tuple(self._world(k)[2].model for k in range(self.num_envs))

    @property
    def data(self) -> tuple[mujoco.MjData, ...]:
        """The MuJoCo data of each world, for reading or rendering with the model of this world.

        The attribute `model` of a returned `MjData` can be a different model with the same layout.
        """
        return tuple(self._world(k)[2].data for k in range(self.num_envs))

    @property
    def sources(self) -> tuple[np.random.Generator, ...]:
        """The random generator of each world."""
        return tuple(self._source(k) for k in range(self.num_envs))

    def render(self) -> tuple[Any, ...] | None:
        """Return an image (480, 640, 3) of each world if `render_mode` is `"rgb_array"`, otherwise None."""
        return None if self.render_mode is None else tuple(self._image(k) for k in range(self.num_envs))

    def close_extras(self, **named: Any) -> None:
        """End all threads of the environment. If this environment opened the family, also end the worker process that builds parts."""
        for renderer, _ in self._renderers.values():
            renderer.close()
        if self._pool is not None:
            self._pool.shutdown()
        if self._owned:
            self.family.close()

    # --- implementation -------------------------------------------------------------------------------------------------

    def _require_open(self) -> None:
        """Raise `ClosedEnvironmentError` if `close` has been called. The error message is the same as in Gymnasium."""
        if self.closed:
            raise ClosedEnvironmentError(f"Trying to operate on `{type(self).__name__}`, after a call to `close()`.")

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """Return a list with a seed for each world. For a seed of None, the random generator of the world is not seeded again."""
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, Integral):
            return [int(seed) + k for k in range(self.num_envs)]
        seeds = list(seed) if isinstance(seed, Iterable) and not isinstance(seed, str) else []
        if len(seeds) != self.num_envs or not all(one is None or isinstance(one, Integral) for one in seeds):
            raise FamilyError(f"expected a seed, or {self.num_envs} seeds (one per world), found `{seed}`")
        return [None if one is None else int(one) for one in seeds]

    def _split(self, actions: Any) -> tuple[Sequence[int], Array]:
        """Split the actions of all worlds into mode indices and action arrays. Raises `FamilyError` for invalid actions."""
        shape = (self.num_envs, self._controls)
        if not self._modes:
            return [0] * self.num_envs, as_actions(actions, shape)
        if not isinstance(actions, Mapping) or set(actions) != {"mode", "joints"}:
            raise FamilyError(f"expected actions as a mapping with `mode` and `joints`, found `{actions}`")
        modes = np.asarray(actions["mode"])
        if modes.shape != shape[:1] or modes.dtype.kind not in "iu" or not ((modes >= 0) & (modes < len(self._modes))).all():
            raise FamilyError(f"expected `mode` to be {self.num_envs} mode indices from 0 to {len(self._modes) - 1}, found `{modes}`")
        return modes.tolist(), as_actions(actions["joints"], shape)

    def _image(self, k: int) -> Any:
        _, _, episode = self._world(k)
        renderer, model = self._renderers.pop(id(episode.model), (None, None))
        if renderer is None:
            renderer, model = mujoco.Renderer(episode.model, 480, 640), episode.model
        self._renderers[id(model)] = renderer, model
        if len(self._renderers) > RENDERERS:
            self._renderers.popitem(last=False)[1][0].close()
        renderer.update_scene(episode.data)
        return renderer.render()

    def _simulate(self, episodes: Sequence[Episode]) -> None:
        """Simulate one action in each of the given episodes.

        Many episodes run in several threads, because MuJoCo releases the GIL during a simulation step.
        """
        if self._pool is None or len(episodes) < 2 * self._threads:
            _run(episodes)
        else:
            list(self._pool.map(_run, [episodes[k:: self._threads] for k in range(self._threads)]))

    def _start_episodes(self, worlds: Sequence[int], infos: dict[str, Any], variant: Any) -> None:
        """Start a new episode in the given worlds. If drawn settings of a robot are refused, draw other settings.

        Raises `FamilyError` if the settings of the given variant are refused, or if too many drawn settings are refused.
        """
        refused: NoModel | None = None
        for _ in range(DRAWS if variant is None else 1):
            draws = [self._morphologies.draw(self._source(k), variant) for k in worlds]
            keys, remaining = [key for key, _ in draws], []
            for k, key, morphology in zip(worlds, keys, self._morphologies.get_many(keys, [settings for _, settings in draws])):
                if isinstance(morphology, NoModel):
                    refused = morphology
                    self.refused[morphology.reason] += 1
                    remaining.append(k)
                    continue
                episode = self._morphologies.episode(morphology, self._worlds[k])
                self._worlds[k] = (key, morphology, episode)
                episode.begin(self._source(k), self._name(key), self._controls)
                self._observe(k)
                self._add_info(infos, self._start_infos(k), k)
            worlds = remaining
        if worlds and refused is not None:
            raise refusal(refused)

    def _world(self, k: int) -> tuple[Any, Morphology, Episode]:
        world = self._worlds[k]
        if world is None:
            raise FamilyError("reset the environments first")
        return world

    def _source(self, k: int) -> np.random.Generator:
        source = self._sources[k]
        assert source is not None
        return source

    def _observe(self, k: int) -> None:
        _, morphology, episode = self._world(k)
        row = self._observations[k]
        self._observer(episode, self._source(k), row)
        row[self._observer.length :] = morphology.described

    def _start_infos(self, k: int) -> dict[str, Any]:
        """Return the `infos` of a world at the start of an episode: the variant of its robot, and the current mode."""
        key, _, episode = self._world(k)
        choices = self._morphologies.choices
        mode = {"mode": episode.simulations[episode.mode].name} if self._modes else {}
        return mode if choices.draw is not None else {"variant": choices.ids[key] if choices.ids else key, **mode}

    def _name(self, key: Any) -> str:
        return self._morphologies.choices.names[key] if self._morphologies.choices.names else str(key)


def make_vec_env(
    family: RobotFamily | str | os.PathLike[str], num_envs: int = 1, *, threads: int = 0,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP, **options: Unpack[EnvOptions],
) -> FamilyVectorEnv:
    """Create a Gymnasium vector environment with `num_envs` worlds, which simulate robots of a family or document in threads.

    Args:
        threads: Number of threads (0: one per core).
        autoreset_mode: When a world starts a new episode after the end of an episode (`NextStep`, `SameStep` or `Disabled`).
        options: Further options, see `EnvOptions`.

    If drawn settings of a robot are refused, other settings are drawn. Raises `FamilyError` if `settings` is empty, or if too many settings
    are refused in succession. Also raises `UnknownVariant` for an unknown task or descriptor, `UnknownChoice` for an unknown mode, and
    `CompileError` for a document with errors.
    """
    raw_rules = env_rules(options)
    rules = replace(raw_rules, modes=as_names(modes=raw_rules.modes), descriptor=as_names(descriptor=raw_rules.descriptor))
    threads = threads or os.cpu_count() or 1
    at_least(1, num_envs=num_envs, threads=threads)
    resetting = [mode.value for mode in AutoresetMode]
    if autoreset_mode not in (*AutoresetMode, *resetting):
        raise FamilyError(f"unknown `autoreset_mode` `{autoreset_mode}`", did_you_mean(str(autoreset_mode), resetting, what="modes"))
    if rules.render_mode is not None:
        try:
            ready()
        except NoGraphics as fault:
            raise FamilyError(str(fault), "set the environment variable `MUJOCO_GL=egl` before MuJoCo is imported") from fault
    robots = family if isinstance(family, RobotFamily) else family_of(family)
    owned = robots is not family
    try:
        return FamilyVectorEnv(robots, num_envs, rules, threads=threads, autoreset=AutoresetMode(autoreset_mode), owned=owned)
    except BaseException:
        if owned:
            robots.close()
        raise


class FamilyEnv(gymnasium.Env[Array, Any]):
    """A Gymnasium environment that simulates one robot of a family at a time. To create an environment of this class, call `make_env`."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}

    def __init__(self, world: FamilyVectorEnv) -> None:
        self._world = world
        self.metadata = {**self.metadata, "render_fps": world.metadata["render_fps"]}
        self.render_mode = world.render_mode
        self.observation_space = world.single_observation_space
        self.action_space = world.single_action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Start an episode with a random variant.

        With `options["variant"]`, start an episode with this variant (see `FamilyVectorEnv.reset`).
        """
        observations, infos = self._world.reset(seed=seed, options=known_options(options, ("variant",)))
        self.np_random = self._world.sources[0]
        return observations[0], _first(infos)

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Apply an action, which is an array (nu,). With several modes, an action is a mapping that contains `mode` and `joints` (nu,).

        If a switch to another mode is refused, `info["refused"]` contains the reason. After an episode has ended, call `reset`.
        """
        actions: Any = action
        if not isinstance(self.action_space, gymnasium.spaces.Dict):
            actions = as_actions(action, self.action_space.shape)[None]
        elif isinstance(action, Mapping):
            actions = {name: np.asarray(value)[None] for name, value in action.items()}
        observations, rewards, terminated, truncated, infos = self._world.step(actions)
        return observations[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), _first(infos)

    def render(self) -> Any:
        """Return an image (480, 640, 3) if `render_mode` is `"rgb_array"`, otherwise None."""
        images = self._world.render()
        return None if images is None else images[0]

    @property
    def settings(self) -> Settings:
        """The settings of the robot in the current episode."""
        return self._world.settings[0]

    @property
    def model(self) -> mujoco.MjModel:
        """The MuJoCo model of the robot in the current episode. Do not modify this model. The model changes with each call of `reset`."""
        return self._world.models[0]

    @property
    def data(self) -> mujoco.MjData:
        """The MuJoCo data of the current episode, for reading or rendering (`mujoco.Renderer(env.model)`)."""
        return self._world.data[0]

    def close(self) -> None:
        """Close the environment. If the environment opened the family, also end the worker process that builds parts."""
        self._world.close()


def _first(infos: Mapping[str, Any]) -> dict[str, Any]:
    """Convert the `infos` of a vector environment with one world to the form of an environment that is not vectorized."""
    return {name: values[0] for name, values in infos.items() if not name.startswith("_")}


def make_env(family: RobotFamily | str | os.PathLike[str], **options: Unpack[EnvOptions]) -> FamilyEnv:
    """Create a Gymnasium environment for one robot at a time.

    The episodes of this environment equal the episodes of the first world of `make_vec_env`. The class `EnvOptions` documents the options.
    """
    return FamilyEnv(make_vec_env(family, 1, threads=1, autoreset_mode=AutoresetMode.DISABLED, **options))


def _run(episodes: Iterable[Episode]) -> None:
    for episode in episodes:
        episode.run()


if ENVIRONMENT not in gymnasium.registry:
    gymnasium.register(
        ENVIRONMENT, entry_point="thingc.batch.gym.family_env:make_env",
        vector_entry_point="thingc.batch.gym.family_env:make_vec_env",
    )

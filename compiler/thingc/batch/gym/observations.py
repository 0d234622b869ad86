"""Compute the observations of an environment in each episode.

An observation is an array that consists of the values of named terms, such as `qpos` or `gravity`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from thingc.batch.gym.episode import Episode
from thingc.batch.gym.rewards import Array
from thingc.batch.results import FamilyError, require_known
from thingc.batch.run_options import as_names, is_number

Term = Callable[[Episode], Array]
ALONE = ("qpos", "qvel")
"""Default terms of an observation for robots in a single mode."""
SWITCHED = ("joints", "gravity", "mode")
"""Default terms of an observation for robots with several modes, in which `qpos` and `qvel` have different meanings."""
EXACT = ("action", "mode")
"""Names of the observation terms that do not have noise."""


def _joints(episode: Episode) -> Array:
    """Return the positions and velocities of all joints.

    The order of the joints is the same in every mode. The values of joints that the mode cuts are 0.
    """
    from thingc.modes.mjdata import map_model, read_state

    if episode.robot is None:
        raise FamilyError(
            "the observation `joints` requires an environment with `modes`",
            "in an environment with a single mode, use the observations `qpos` and `qvel`",
        )
    mode = episode.robot[episode.simulations[episode.mode].name]
    state = read_state(mode, map_model(mode, episode.model), episode.data)
    return np.concatenate([state.q, state.v])


def _gravity(episode: Episode) -> Array:
    """Return the direction of gravity as a unit vector in the axes of the root link of the first mode."""
    model, data = episode.model, episode.data
    root = 1 if episode.robot is None else model.body(episode.robot[episode.simulations[0].name].root_link).id
    size = float(np.linalg.norm(model.opt.gravity))
    down: Array = data.xmat[root].reshape(3, 3).T @ model.opt.gravity / (size or 1.0)
    return down


TERMS: Mapping[str, Term] = {
    "qpos": lambda episode: episode.data.qpos,
    "qvel": lambda episode: episode.data.qvel,
    "joints": _joints,
    "sensors": lambda episode: episode.data.sensordata,
    "gravity": _gravity,
    "action": lambda episode: episode.action,
    "mode": lambda episode: np.eye(len(episode.simulations))[episode.mode],
}
"""The functions that compute the observation terms, by the name of the term."""


class Observer:
    """Computes observations with the given terms, and adds random noise to the observations.

    `noise` is the maximum random change of a number, or a mapping from terms to such changes. `example` is an episode with the same sizes
    as all other episodes. Raises `UnknownVariant` for an unknown term and for noise of another term, and `FamilyError` for invalid noise.
    """

    def __init__(self, terms: Sequence[str] | str | None, noise: float | Mapping[str, float], example: Episode) -> None:
        names = (ALONE if example.robot is None else SWITCHED) if terms is None else as_names(observation=terms)
        noise_by_term = noise if isinstance(noise, Mapping) else {name: noise for name in names if name not in EXACT}
        for name in names:
            require_known(name, TERMS, f"there is no observation `{name}`", what="observations")
        for name, value in noise_by_term.items():
            require_known(name, names, f"`observation_noise` contains `{name}`, but `observation` does not", what="observations")
            if not is_number(value) or value < 0.0:
                raise FamilyError(f"expected `observation_noise` to be numbers of at least 0, found {value} for `{name}`")
        self._names = names
        lengths = np.array([len(TERMS[name](example)) for name in names], dtype=int)
        self.length = int(lengths.sum())
        self._noise: Any = np.repeat([float(noise_by_term.get(name, 0.0)) for name in names], lengths)

    def __call__(self, episode: Episode, source: np.random.Generator, row: Array) -> None:
        """Write the observation of an episode into the array `row`.

        Raises `FamilyError` if the size of this observation differs from the size of other observations.
        """
        values = np.concatenate([[], *(TERMS[name](episode) for name in self._names)])
        if len(values) != self.length:
            mode = episode.simulations[episode.mode].name
            raise FamilyError(f"expected an observation of {self.length} numbers in mode `{mode}`, found {len(values)}")
        row[: self.length] = values + source.uniform(-self._noise, self._noise) if self._noise.any() else values

"""The robots that the environments of a family simulate: drawing settings for each episode, and caching the models."""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Iterable, Sequence
from numbers import Integral
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import did_you_mean
from thingc.batch.families.family import RobotFamily, as_many
from thingc.batch.families.results import NoModel
from thingc.batch.gym.env_options import Draw, EnvRules, Settings
from thingc.batch.gym.episode import Episode, ModeSimulation
from thingc.batch.gym.rewards import Array, Descriptor
from thingc.batch.results import FamilyError, UnknownVariant

if TYPE_CHECKING:
    from thingc.modes import Modes


class MorphologyDistribution(FrozenStruct):
    """The probability distribution of the settings of robots, which is uniform over `many` settings or defined by the function `draw`.

    The function `draw` is called with a random generator. `ids` contains the values of `infos["variant"]`. If `ids` is empty, these values
    are indices. `names` contains the names of all settings.
    """

    many: Sequence[Settings] = ()
    ids: Sequence[str] = ()
    names: Sequence[str] = ()
    draw: Draw | None = None


class Morphology:
    """A robot with given settings: a simulation of each mode, and a descriptor.

    If there are several modes, the object `robot` switches between the modes. `layout` contains sizes and names of the models. Robots with
    an equal `layout` can share an `MjData`.
    """

    def __init__(self, simulations: Sequence[ModeSimulation], robot: Modes | None, settings: Settings, described: Array) -> None:
        self.simulations = simulations
        self.models = [simulation.model for simulation in simulations]
        self.robot = robot
        self.settings = settings
        self.described = described
        names = [name for name in dir(self.models[0]) if name.startswith("n")]
        sizes = [[getattr(model, name) for name in names] for model in self.models]
        self.layout = [(model.names, *(size for size in own if isinstance(size, int))) for model, own in zip(self.models, sizes)]

    @property
    def sizes(self) -> list[tuple[int, int, int]]:
        """The sizes nq, nv and nu of the MuJoCo model of the robot in each mode."""
        return [(model.nq, model.nv, model.nu) for model in self.models]


class Morphologies:
    """Draws robots from the distribution `choices`, and caches their MuJoCo models in all `modes`.

    `refused` counts refused settings by error message.
    """

    def __init__(self, family: RobotFamily, choices: MorphologyDistribution, rules: EnvRules) -> None:
        self.choices = choices
        self.refused: Counter[str] = Counter()
        self._family = family
        self._rules = rules
        self.modes = rules.modes or (family.mode if rules.mode is None else rules.mode,)
        self._descriptor = Descriptor(family, rules.descriptor)
        self._cached: OrderedDict[Any, Morphology | NoModel] = OrderedDict()
        if choices.many:
            self._cumulative = np.full(len(choices.many), 1.0 / len(choices.many)).cumsum()  # as in `choice` of numpy
            self._cumulative /= self._cumulative[-1]
        self._first: Morphology | None = None
        self.actuators: Sequence[str] = ()
        for key, settings in enumerate(choices.many or ({},)):
            first = self.get_many([key if choices.many else ()], [settings])[0]
            if isinstance(first, Morphology):
                break
        if isinstance(first, NoModel):
            raise refusal(first)
        self._first = self.first = first

    def draw(self, source: np.random.Generator, variant: Any) -> tuple[Any, Settings]:
        """Draw the settings of a robot, or select those of the given variant. Return their key in the cache, and the settings."""
        if self.choices.draw is not None:
            if variant is not None:
                raise UnknownVariant(f"variant `{variant}` cannot be selected with random settings")
            settings = self.choices.draw(source)
            return settings_key(settings), settings
        place = int(self._cumulative.searchsorted(source.random(), side="right"))  # always draw, so that options do not change later draws
        if variant is not None:
            place = self._index_of(variant)
        return place, self.choices.many[place]

    def _index_of(self, variant: Any) -> int:
        ids, names, count = self.choices.ids, self.choices.names, len(self.choices.many)
        for known_names in (ids, names):
            if isinstance(variant, str) and variant in known_names:
                return list(known_names).index(variant)
        if isinstance(variant, bool) or not isinstance(variant, Integral) or not -count <= int(variant) < count:
            known = did_you_mean(variant, names, what="variants") if isinstance(variant, str) and names else f"there are {count}"
            raise UnknownVariant(f"there is no variant `{variant}`", known)
        return int(variant) % count

    def get_many(self, keys: Sequence[Any], settings_of_robots: Sequence[Settings]) -> list[Morphology | NoModel]:
        """Return the robot for each set of settings. Robots in the cache are reused. For refused settings, the list contains a `NoModel`.

        `keys` contains the cache keys of the settings. Raises `FamilyError` if the model of a robot has different sizes than the model of
        the first robot.
        """
        new = {key: settings for key, settings in zip(keys, settings_of_robots) if key not in self._cached}
        rules = self._rules
        models = [self._family.models(new.values(), mode=mode, visual=rules.shows_visual, floor=rules.floor) for mode in self.modes]
        for (key, settings), *models_of_robot in zip(new.items(), *models):
            self._cached[key] = self._morphology(settings, models_of_robot)
        morphologies = [self._cached[key] for key in keys]
        for key in keys:
            self._cached.move_to_end(key)
        while len(self._cached) > rules.cache:
            self._cached.popitem(last=False)
        return morphologies

    def _morphology(self, settings: Settings, models: Sequence[mujoco.MjModel | NoModel]) -> Morphology | NoModel:
        robot = self._family.modes(settings, *self.modes) if self._rules.modes else None
        built = [one for one in models if not isinstance(one, NoModel)]
        for one in (*models, robot):
            if isinstance(one, NoModel):
                return one
        assert not isinstance(robot, NoModel)
        if self._first is None:
            self.actuators = list(dict.fromkeys(model.actuator(number).name for model in built for number in range(model.nu)))
        undelayed = self._rules.action_delay is not None
        simulations = [
            ModeSimulation(mode, model, np.arange(model.nu) if robot is None else self._controls(model), undelayed=undelayed)
            for mode, model in zip(self.modes, built, strict=True)
        ]
        morphology = Morphology(simulations, robot, settings, self._descriptor(settings))
        for mode, mine, others in zip(self.modes, morphology.sizes, morphology.sizes if self._first is None else self._first.sizes):
            if mine != others:
                sizes = [f"nq, nv, nu = {', '.join(map(str, one))}" for one in (mine, others)]
                raise FamilyError(f"expected {sizes[1]} in mode `{mode}` for the settings {dict(settings)}, found {sizes[0]}")
        return morphology

    def episode(self, morphology: Morphology, previous: tuple[Any, Morphology, Episode] | None) -> Episode:
        """Create an episode of a robot.

        If the models of both robots have the same layout, the `MjData` of the episode `previous` are reused.
        """
        states: Sequence[mujoco.MjData]
        if previous is not None and previous[1].layout == morphology.layout:
            states = previous[2].states
        else:
            states = [mujoco.MjData(model) for model in morphology.models]
        return Episode(morphology.simulations, states, morphology.settings, self._rules, morphology.robot)

    def _controls(self, model: mujoco.MjModel) -> Any:
        """For each control of a model, return its index in an action. An action has one element for each actuator of any mode."""
        return np.array([self.actuators.index(model.actuator(number).name) for number in range(model.nu)], dtype=int)


def distribution(family: RobotFamily, settings: Iterable[Settings] | Draw | None) -> MorphologyDistribution:
    """Return the probability distribution from which the settings of the robots are drawn.

    By default, the settings are all valid variants of the document that satisfy its rules, or the settings of an assembly itself.
    """
    if callable(settings):
        return MorphologyDistribution(draw=settings)
    if settings is not None:
        listed = list(as_many(settings))
        if not listed:
            raise FamilyError("expected at least one item in `settings`")
        return MorphologyDistribution(many=[{name: value for name, value, _ in settings_key(one)} for one in listed])
    variants = list(family.variants)
    if not variants:
        return MorphologyDistribution(many=[{}])
    planned = [variant for variant in variants if variant.failed is None]
    valid = [variant for variant, evaluated in zip(planned, family.evaluate(planned)) if evaluated.kept]
    if not valid:
        raise FamilyError(f"`{family.name}` has no valid variants that satisfy the rules", "use `settings` to list settings")
    return MorphologyDistribution(
        many=[{**one.parameters, **one.choices} for one in valid], ids=[one.id for one in valid], names=[one.name for one in valid],
    )


def settings_key(settings: Settings) -> tuple[tuple[str, Any, bool], ...]:
    """Return the cache key of settings. The order of the settings matters, because several names can match the same value.

    The key distinguishes True from 1, which are equal in Python. Raises `FamilyError` if the settings are not a mapping from names to
    numbers or strings.
    """
    try:
        key = tuple((name, value, isinstance(value, (bool, np.bool_))) for name, value in settings.items())
        hash(key)
    except (AttributeError, TypeError):
        raise FamilyError(f"expected settings as a mapping from names to numbers or strings, found `{settings!r}`") from None
    return key


def refusal(refused: NoModel) -> FamilyError:
    """Return an exception for refused settings, whose message contains the errors."""
    return FamilyError(f"the settings {dict(refused.settings)} are rejected: {refused.reason}")

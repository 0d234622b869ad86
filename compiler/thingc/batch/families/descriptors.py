"""What of its settings the observations of an environment end with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from thingc.base.suggestions import did_you_mean
from thingc.batch.families.family import RobotFamily
from thingc.batch.gym.rewards import Array
from thingc.batch.results import FamilyError, UnknownVariant


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

"""The search space of a family of robots, for optimization: the settings that can be varied, and their bounds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from thingc.base.one_line_repr import OneLineStruct
from thingc.base.units import Quantity
from thingc.batch.axes import Axis
from thingc.batch.results import require_known
from thingc.batch.values import standard_unit
from thingc.documents.expressions.evaluation import ExpressionValue, plain
from thingc.documents.spec.assembly import AssemblySpec, ParameterSpec


class SpaceDimension(OneLineStruct):
    """A dimension of a search space, which is either a number between `low` and `high`, or one of `choices`.

    `low` and `high` are in SI units (`unit`). `low` or `high` is None if the number does not have this bound. If `whole` is true, the
    number must be an integer. `value` is the value of the setting in the document.
    """

    name: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    whole: bool = False
    choices: tuple[Any, ...] = ()
    value: Any = None

    @property
    def bounded(self) -> bool:
        """True if the dimension has bounds or choices, so that its values can be sampled."""
        return bool(self.choices) or (self.low is not None and self.high is not None)


class SearchSpace(Sequence[SpaceDimension]):
    """The dimensions of the search space of a family, in the order of its document."""

    def __init__(self, dimensions: Sequence[SpaceDimension]) -> None:
        self._dimensions = tuple(dimensions)

    def __len__(self) -> int:
        return len(self._dimensions)

    def __getitem__(self, key: Any) -> Any:
        """Return the dimension with this index or name.

        Raises `UnknownVariant` (a `KeyError`) for an unknown name, and `IndexError` for an invalid index.
        """
        if isinstance(key, str):
            require_known(key, self.names, f"unknown setting `{key}`", what="names")
            key = self.names.index(key)
        return self._dimensions[key]

    def __repr__(self) -> str:
        return f"Space({', '.join(dimension.name for dimension in self)})"

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the dimensions of the search space."""
        return tuple(dimension.name for dimension in self)

    def _bounded_dimensions(self) -> Iterator[SpaceDimension]:
        return (dimension for dimension in self if dimension.bounded)

    def suggest(self, trial: Any) -> dict[str, Any]:
        """Ask an `optuna.Trial` for a value of each bounded dimension, and return a mapping of settings with these values."""
        settings: dict[str, Any] = {}
        for axis in self._bounded_dimensions():
            if axis.choices:
                settings[axis.name] = trial.suggest_categorical(axis.name, list(axis.choices))
            elif axis.whole:
                settings[axis.name] = trial.suggest_int(axis.name, round(axis.low or 0.0), round(axis.high or 0.0))
            else:
                settings[axis.name] = trial.suggest_float(axis.name, axis.low, axis.high)
        return settings

    def gymnasium(self) -> Any:
        """Return a `gymnasium.spaces.Dict` that contains a space for each bounded dimension.

        The space of a number is a `Box`. The space of an integer or of the index of a choice is a `Discrete`. To convert a point of this
        space to settings, use the method `settings`.
        """
        import numpy as np
        from gymnasium import spaces

        subspaces: dict[str, Any] = {}
        for axis in self._bounded_dimensions():
            if axis.choices:
                subspaces[axis.name] = spaces.Discrete(len(axis.choices))
            elif axis.whole:
                subspaces[axis.name] = spaces.Discrete(round((axis.high or 0.0) - (axis.low or 0.0)) + 1, start=round(axis.low or 0.0))
            else:
                subspaces[axis.name] = spaces.Box(axis.low or 0.0, axis.high or 0.0, shape=(), dtype=np.float64)
        return spaces.Dict(subspaces)

    def settings(self, point: Mapping[str, Any]) -> dict[str, Any]:
        """Convert a point of the space `gymnasium()` to settings.

        Raises `UnknownVariant`, a `KeyError`, for an unknown name, and `ValueError` for an invalid point.
        """
        if not isinstance(point, Mapping):
            raise ValueError(f"expected a sample of the space `gymnasium()`, found `{point}`")
        dimensions = {name: self[name] for name in point}
        try:
            return {
                name: axis.choices[int(point[name])] if axis.choices else int(point[name]) if axis.whole else float(point[name])
                for name, axis in dimensions.items()
            }
        except (TypeError, ValueError, IndexError, OverflowError):
            raise ValueError(f"expected a sample of the space `gymnasium()`, found `{point}`") from None

    def bounds(self) -> tuple[tuple[float, float], ...]:
        """Return the lower and upper bound of each bounded number, in the form that `scipy.optimize` requires.

        To convert a vector within these bounds to settings, use the method `at`.
        """
        return tuple((axis.low, axis.high) for axis in self._bounded_dimensions() if axis.low is not None and axis.high is not None)

    def at(self, vector: Sequence[float]) -> dict[str, float]:
        """Convert a vector with a value for each bounded number to settings. The values of integer dimensions are rounded.

        Raises `ValueError` if the vector has another length, or if the argument is not a vector of numbers.
        """
        numbers = [axis for axis in self._bounded_dimensions() if not axis.choices]
        try:
            if len(vector) == len(numbers):
                return {axis.name: float(round(value)) if axis.whole else float(value) for axis, value in zip(numbers, vector, strict=True)}
            count = str(len(vector))
        except (TypeError, ValueError, OverflowError):
            count = f"`{vector}`"
        raise ValueError(f"expected {len(numbers)} numbers ({', '.join(axis.name for axis in numbers)}), found {count}")


def of_axes(axes: Sequence[Axis], document_values: Mapping[str, ExpressionValue]) -> SearchSpace:
    """Create the search space of a variants document from its axes. `own` contains the values in the assembly document."""
    return SearchSpace([_of_axis(axis, document_values.get(axis.key)) for axis in axes])


def _of_axis(axis: Axis, document_value: ExpressionValue | None) -> SpaceDimension:
    value = None if document_value is None else plain(document_value)
    unit = next((standard_unit(entry.dimension) for entry in axis.range or axis.values if isinstance(entry, Quantity)), "")
    if axis.range is not None:
        low, high = axis.range
        return SpaceDimension(name=axis.key, unit=unit, low=low.value, high=high.value, whole=axis.whole, value=value)
    return SpaceDimension(name=axis.key, unit=unit, choices=tuple(plain(entry) for entry in axis.values), value=value)


def of_parameters(spec: AssemblySpec, values: Mapping[str, ExpressionValue], bound: Any) -> SearchSpace:
    """Create the search space of an assembly document from its parameters.

    The callback `bound(name, key)` returns a bound of a parameter [SI].
    """
    dimensions: list[SpaceDimension] = []
    for name, value in values.items():
        entry = spec.parameters[name]
        if isinstance(value, bool):
            dimensions.append(SpaceDimension(name=name, choices=(False, True), value=value))
        elif isinstance(value, Quantity):
            low, high = (bound(name, key) if isinstance(entry, ParameterSpec) else None for key in ("min", "max"))
            dimensions.append(SpaceDimension(name=name, unit=standard_unit(value.dimension), low=low, high=high, value=value.value))
        else:
            dimensions.append(SpaceDimension(name=name, value=value))
    return SearchSpace(dimensions)

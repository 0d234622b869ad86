"""Parameters of a part: annotations for units, bounds, and validation of values.

Values are in author units: millimetres, degrees, kilograms. This module does not import the CAD kernel.
"""

from __future__ import annotations

import difflib
import math
import numbers
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, TypeAlias

Value: TypeAlias = "float | int | bool | str"
"""The value of a parameter in canonical form. If two parameters are equal, their canonical values have the same type."""

WHOLE = frozenset({"count", "integer"})
NUMERIC = frozenset({"length", "angle", "mass", "ratio", "number", *WHOLE})
UNITS = {"length": " mm", "angle": " deg", "mass": " kg"}
NOUNS = {
    "length": "a length in mm", "angle": "an angle in deg", "mass": "a mass in kg", "ratio": "a ratio", "number": "a number",
    "count": "a whole number", "integer": "a whole number", "flag": "a boolean", "text": "a string",
}


class ParameterError(ValueError):
    """Raised if a part cannot be built with a value of a parameter.

    The exception is raised before any geometry is created. `parameter` is the name of the parameter, and `owner` is the name of the
    class or function.
    """

    def __init__(self, message: str, *, owner: str, parameter: str) -> None:
        super().__init__(message)
        self.owner = owner
        self.parameter = parameter


class CallError(ParameterError, TypeError):
    """Raised if a Thing is called with an unknown parameter or without a required parameter.

    The exception is also a `TypeError`, which Python raises for such calls.
    """


class SignatureError(TypeError):
    """Raised if an argument of `__init__` cannot be a parameter. Possible reasons are an unknown annotation, `*args`, and a default out of
    bounds.
    """


@dataclass(frozen=True, slots=True)
class Kind:
    """The marker of a parameter kind in annotations such as `Length` and `Angle`."""

    kind: str


@dataclass(frozen=True, slots=True)
class Range:
    """Inclusive bounds of a parameter in the units of part code, such as `Annotated[Length, Range(10, 200)]` or `Range(minimum=0)`.

    Raises `SignatureError` if a bound is not a number, or if the minimum is larger than the maximum.
    """

    minimum: float | None = None
    maximum: float | None = None

    def __post_init__(self) -> None:
        for bound in (self.minimum, self.maximum):
            if bound is not None and (isinstance(bound, bool) or not isinstance(bound, (int, float)) or math.isnan(bound)):
                raise SignatureError(f"a bound of Range must be a number, found {bound!r}")
        if self.minimum is not None and self.maximum is not None and self.minimum > self.maximum:
            raise SignatureError(f"Range({self.minimum!r}, {self.maximum!r}) is empty")


Length: TypeAlias = Annotated[float, Kind("length")]
"""A length in millimetres."""
Angle: TypeAlias = Annotated[float, Kind("angle")]
"""An angle in degrees."""
Mass: TypeAlias = Annotated[float, Kind("mass"), Range(minimum=0)]
"""A mass in kilograms, which must not be negative."""
Count: TypeAlias = Annotated[int, Kind("count"), Range(minimum=0)]
"""A number of items, which must not be negative. Use a plain `int` for integers that may be negative."""
Ratio: TypeAlias = Annotated[float, Kind("ratio")]
"""A dimensionless number. Documents can write such a number in percent, for example 15 % for 0.15."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A parameter of a part, which is an argument of its `__init__`.

    `kind` is `length` [mm], `angle` [deg], `mass` [kg], `ratio` or `number` (floats), `count` or `integer` (ints), `flag` (bool), `text` (a
    string) or `choice` (one of `choices`). `default` is None if the parameter is `required`. `minimum` and `maximum` are inclusive, in the
    unit of the value.
    """

    name: str
    kind: str
    required: bool
    default: Value | None
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Value, ...] = ()
    doc: str = ""

    @property
    def noun(self) -> str:
        """The type of the parameter's values for messages, such as `a length in mm`."""
        if self.kind == "choice":
            return "one of " + ", ".join(repr(choice) for choice in self.choices)
        return NOUNS[self.kind]

    def canonical(self, value: object, owner: str) -> Value:
        """Check a value of the parameter and convert it to canonical form: a float for a quantity, or an int, bool or str for the other
        kinds. For example, the canonical form of the length 60 is 60.0.

        Raises `ParameterError` for a wrong type, a number that is not finite or out of bounds, or an unknown choice. `owner` is the name of
        the part, which is used in the message.
        """
        typed = self._to_kind(value)
        if typed is None:
            raise self.error(f"must be {self.noun}, found {value!r}", owner)
        if isinstance(typed, (int, float)) and not isinstance(typed, bool) and self.kind != "choice":
            if not math.isfinite(typed):
                raise self.error(f"must be finite, found {value!r}", owner)
            if self.minimum is not None and typed < self.minimum:
                raise self.error(f"must be at least {self._format_number(self.minimum)}, found {self._format_number(typed)}", owner)
            if self.maximum is not None and typed > self.maximum:
                raise self.error(f"must be at most {self._format_number(self.maximum)}, found {self._format_number(typed)}", owner)
        return typed

    def error(self, problem: str, owner: str) -> ParameterError:
        """Create a `ParameterError` whose message names the parameter, its owner, and the problem."""
        return ParameterError(f"`{self.name}` of `{owner}` {problem}", owner=owner, parameter=self.name)

    def _to_kind(self, value: object) -> Value | None:
        """Convert a value to the Python type of the parameter kind. Return None if the value has another type."""
        if self.kind == "choice":
            return next((choice for choice in self.choices if _same(choice, value)), None)
        if self.kind == "flag":
            return value if isinstance(value, bool) else None
        if self.kind == "text":
            return str(value) if isinstance(value, str) else None
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            return None
        if self.kind in WHOLE:
            if isinstance(value, numbers.Integral):
                return int(value)
            number = float(value)
            return int(number) if number.is_integer() else None if math.isfinite(number) else number
        try:
            return float(value) + 0.0
        except OverflowError:
            return math.inf

    def _format_number(self, value: float) -> str:
        """Format a number with its unit for display."""
        text = repr(value)
        return text.removesuffix(".0") + UNITS.get(self.kind, "")


def suggestion(name: str, candidates: Iterable[str]) -> str:
    """Return the end of an error message about an unknown name, such as `; did you mean ...?`.

    If no candidate is similar to the name, the text lists all candidates. Return an empty string if there are no candidates.
    """
    names = list(candidates)
    closest = difflib.get_close_matches(name, names, n=1)
    if closest:
        return f"; did you mean `{closest[0]}`?"
    return f"; there are {', '.join(f'`{candidate}`' for candidate in names)}" if names else ""


def _same(choice: Value, value: object) -> bool:
    """Return whether a value equals one of the choices of a parameter. 3.0 equals 3, but True does not equal 1."""
    return isinstance(value, bool) is isinstance(choice, bool) and choice == value

"""Numeric operations with the same results in every Python version. The operations also accept recorded numbers."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable
from functools import reduce, wraps
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])
Formatter = Callable[[float], str]

OPERATIONS: dict[str, Callable[..., Any]] = {}
"""Functions that a `Recorded` records as one operation, by name."""
FORMATTERS: dict[str, Formatter] = {}
"""Functions that format numbers in files, by name of the format."""


class Recorded:
    """A placeholder for numbers. Computations with a placeholder are recorded and can be repeated with other values."""

    __slots__ = ()

    def operate(self, name: str, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Return the result of `function`, one of `OPERATIONS`. At least one of the arguments is recorded."""
        raise NotImplementedError

    def slot(self, form: str) -> str:
        """Return the placeholder for this number in files. `form` is one of `FORMATTERS`, or `:` and a format specification."""
        raise NotImplementedError

    def for_text(self) -> Any:
        """Return this number if texts are recorded with placeholders, otherwise its value."""
        raise NotImplementedError


def for_text(value: float) -> float:
    """Return a number for use in a text. If texts are not recorded, return the value of a recorded number."""
    return cast("float", value.for_text()) if isinstance(value, Recorded) else value


def one_operation(function: Function) -> Function:
    """Decorate a function of numbers, so that calls are recorded as one operation.

    It must return a number, a boolean, or tuples of numbers.
    """
    name = function.__name__
    OPERATIONS[name] = function

    @wraps(function)
    def operation(*arguments: Any) -> Any:
        for one in arguments:
            if isinstance(one, Recorded):
                return one.operate(name, function, arguments)
        return function(*arguments)

    return cast("Function", operation)


def formatter(form: str) -> Callable[[Formatter], Callable[[float | Recorded], str]]:
    """Decorate a function that formats a number. The decorated function returns a placeholder for a recorded number."""

    def decorate(function: Formatter) -> Callable[[float | Recorded], str]:
        FORMATTERS[form] = function

        @wraps(function)
        def write(value: float | Recorded) -> str:
            return value.slot(form) if isinstance(value, Recorded) else function(value)

        return write

    return decorate


def _extreme(function: Function) -> Function:
    """Wrap `min` or `max` of numbers without a `key`. For recorded numbers, any argument may be the result."""
    extreme = one_operation(function)

    def operation(*arguments: Any, **default: Any) -> Any:
        listed = tuple(arguments[0]) if len(arguments) == 1 else arguments
        return function(listed, **default) if len(listed) < 2 else extreme(*listed)

    return cast("Function", operation)


inf, nan, pi, tau = math.inf, math.nan, math.pi, math.tau
minimum, maximum = _extreme(min), _extreme(max)
sqrt, sin, cos, tan = one_operation(math.sqrt), one_operation(math.sin), one_operation(math.cos), one_operation(math.tan)
asin, acos, atan, atan2 = one_operation(math.asin), one_operation(math.acos), one_operation(math.atan), one_operation(math.atan2)
radians, degrees, copysign = one_operation(math.radians), one_operation(math.degrees), one_operation(math.copysign)
remainder, isfinite, isinf = one_operation(math.remainder), one_operation(math.isfinite), one_operation(math.isinf)


@one_operation
def rounded(value: float, digits: int) -> float:
    """Round a number to significant digits."""
    return float(f"{value:.{digits}g}")


def sum_of(values: Iterable[float]) -> float:
    """Return the sum of floats, added from left to right with each addition rounded.

    Since Python 3.12, `sum` compensates rounding errors. The compensation would change the last digits in files, and the results of `plans`
    would differ from the results of the passes.
    """
    return reduce(operator.add, values, 0)


def fsum(values: Iterable[float]) -> float:
    """Return the sum of floats, rounded once."""
    return _fsum(*values)


@one_operation
def _fsum(*values: float) -> float:
    return math.fsum(values)


def dist(p: Iterable[float], q: Iterable[float]) -> float:
    """Return the distance between two points with the same number of coordinates."""
    return hypot(*(a - b for a, b in zip(p, q, strict=True)))


@one_operation
def hypot(*components: float) -> float:
    """Return the Euclidean length of a vector, rounded once to the nearest float.

    `math.hypot` and `math.dist` differ in the last digit between Python versions: for 0.075 m and 0.18 m the result is 0.195 m in 3.11, and
    0.19499999999999998 m since 3.12. Floats are integers divided by a power of two, so the sum of squares is exact. The root has at least
    64 bits. The last bit of an inexact root is set, so that the root is never mistaken for the middle of two floats. For values that are
    not finite, and on overflow, the result is the same as from `math.hypot`.
    """
    try:
        ratios = [value.as_integer_ratio() for value in components]
        scale = max((denominator for _, denominator in ratios), default=1)
        square = sum((numerator * (scale // denominator)) ** 2 for numerator, denominator in ratios) << 128
        root = math.isqrt(square)
        return (root | (root * root != square)) / (scale << 64)
    except (OverflowError, ValueError):
        return math.hypot(*components)

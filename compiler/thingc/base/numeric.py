"""Mathematical functions with the same results in every Python version.

The functions also accept `Recorded` numbers, which record computations.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable
from functools import reduce, wraps
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])
Formatter = Callable[[float], str]

OPERATIONS: dict[str, Callable[..., Any]] = {}
"""Functions by name. A call of one of these functions with a `Recorded` number is recorded as a single operation."""
FORMATTERS: dict[str, Formatter] = {}
"""Functions that format numbers in files, by name of the format."""


class Recorded:
    """Base class of numbers that record how they are used in computations, so that the computations can be repeated for other values."""

    __slots__ = ()

    def operate(self, name: str, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Record the call `function(*arguments)` and return its result. `name` is the key of the function in `OPERATIONS`.

        At least one of the arguments is a recorded number.
        """
        raise NotImplementedError

    def slot(self, form: str) -> str:
        """Return a placeholder text for this number, to be written into a file in place of the number.

        `form` is the format of the number: a key of `FORMATTERS`, or `:` followed by a format specification.
        """
        raise NotImplementedError

    def for_text(self) -> Any:
        """Return this recorded number if it can be written into texts as a placeholder.

        If texts cannot contain placeholders, return the plain value of the number.
        """
        raise NotImplementedError


def for_text(value: float) -> float:
    """Return a number that can be formatted as text.

    For a recorded number, return the plain value unless texts can contain placeholders.
    """
    return cast("float", value.for_text()) if isinstance(value, Recorded) else value


def one_operation(function: Function) -> Function:
    """Decorate a function of numbers so that a call with recorded numbers is recorded as a single operation.

    The decorated function must return a number, a boolean, or nested tuples of numbers.
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
    """Return a decorator for functions that format a number. For a recorded number, the decorated function returns a placeholder text.

    `form` is the name under which the function is registered in `FORMATTERS`.
    """

    def decorate(function: Formatter) -> Callable[[float | Recorded], str]:
        FORMATTERS[form] = function

        @wraps(function)
        def write(value: float | Recorded) -> str:
            return value.slot(form) if isinstance(value, Recorded) else function(value)

        return write

    return decorate


def _extreme(function: Function) -> Function:
    """Wrap the built-in function `min` or `max` so that a call with recorded numbers is recorded as a single operation.

    The wrapped function does not accept the argument `key`.
    """
    extreme = one_operation(function)

    def operation(*arguments: Any, **default: Any) -> Any:
        numbers = tuple(arguments[0]) if len(arguments) == 1 else arguments
        return function(numbers, **default) if len(numbers) < 2 else extreme(*numbers)

    return cast("Function", operation)


inf, nan, pi, tau = math.inf, math.nan, math.pi, math.tau
minimum, maximum = _extreme(min), _extreme(max)
sqrt, sin, cos, tan = one_operation(math.sqrt), one_operation(math.sin), one_operation(math.cos), one_operation(math.tan)
asin, acos, atan, atan2 = one_operation(math.asin), one_operation(math.acos), one_operation(math.atan), one_operation(math.atan2)
radians, degrees, copysign = one_operation(math.radians), one_operation(math.degrees), one_operation(math.copysign)
remainder, isfinite, isinf = one_operation(math.remainder), one_operation(math.isfinite), one_operation(math.isinf)
erf = one_operation(math.erf)


@one_operation
def round_significant(value: float, digits: int) -> float:
    """Round a number to `digits` significant decimal digits."""
    return float(f"{value:.{digits}g}")


def sum_of(values: Iterable[float]) -> float:
    """Return the sum of floating-point numbers, added from left to right without compensation of rounding errors.

    Since Python 3.12, the built-in `sum` compensates rounding errors. With this compensation, the last digits of numbers in files would
    change, and the results of `plans` would differ from the results of the passes.
    """
    return reduce(operator.add, values, 0)


def fsum(values: Iterable[float]) -> float:
    """Return the exact sum of floating-point numbers, rounded once to the nearest float, as `math.fsum` does."""
    return _fsum(*values)


@one_operation
def _fsum(*values: float) -> float:
    return math.fsum(values)


def dist(p: Iterable[float], q: Iterable[float]) -> float:
    """Return the distance between two points with the same number of coordinates."""
    return hypot(*(a - b for a, b in zip(p, q, strict=True)))


@one_operation
def hypot(*components: float) -> float:
    """Return the Euclidean norm of a vector. The exact norm is rounded once to the nearest float.

    `math.hypot` and `math.dist` differ in the last digit between Python versions. For 0.075 m and 0.18 m, the result is 0.195 m in Python
    3.11 and 0.19499999999999998 m since Python 3.12.

    Every float is an integer divided by a power of two, so the sum of squares can be computed exactly. The root is computed with at least
    64 bits. If the root is inexact, its last bit is set, so that the root is never rounded as if it were exactly between two floats. If a
    value is not finite or the sum overflows, the result is the same as from `math.hypot`.
    """
    try:
        ratios = [value.as_integer_ratio() for value in components]
        scale = max((denominator for _, denominator in ratios), default=1)
        square = sum((numerator * (scale // denominator)) ** 2 for numerator, denominator in ratios) << 128
        root = math.isqrt(square)
        return (root | (root * root != square)) / (scale << 64)
    except (OverflowError, ValueError):
        return math.hypot(*components)

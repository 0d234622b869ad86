"""The operations that a tape records, with valid arguments, and functions of mpmath for comparison."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any

import mpmath

from thingc.base import numeric
from thingc.base.pose import quarter_exact

Draw = Callable[[random.Random], Sequence[float]]
Oracle = Callable[..., Any]


def between(*bounds: tuple[float, float]) -> Draw:
    """Return a function that draws one number between each pair of bounds."""
    return lambda source: [source.uniform(low, high) for low, high in bounds]


ANY = (-3.0, 3.0)
POSITIVE = (0.05, 4.0)

OPERATIONS: dict[str, tuple[Callable[..., Any], Draw, Oracle]] = {
    "+": (lambda a, b: a + b, between(ANY, ANY), lambda a, b: a + b),
    "-": (lambda a, b: a - b, between(ANY, ANY), lambda a, b: a - b),
    "negative": (lambda a: -a, between(ANY), lambda a: -a),
    "*": (lambda a, b: a * b, between(ANY, ANY), lambda a, b: a * b),
    "/": (lambda a, b: a / b, between(ANY, POSITIVE), lambda a, b: a / b),
    "%": (lambda a, b: a % b, between(ANY, POSITIVE), lambda a, b: a - b * mpmath.floor(a / b)),
    "% of a negative divisor": (lambda a: a % -0.7, between(ANY), lambda a: a + mpmath.mpf(0.7) * mpmath.floor(a / mpmath.mpf(-0.7))),
    "square": (lambda a: a**2, between(ANY), lambda a: a**2),
    "cube": (lambda a: a**3.0, between(ANY), lambda a: a**3),
    "inverse": (lambda a: a**-1, between(POSITIVE), lambda a: 1 / a),
    "**": (lambda a, b: a**b, between(POSITIVE, ANY), lambda a, b: a**b),
    "exponent": (lambda a: 1.7**a, between(ANY), lambda a: mpmath.mpf(1.7) ** a),
    "abs": (abs, between(ANY), abs),
    "sqrt": (numeric.sqrt, between(POSITIVE), mpmath.sqrt),
    "sin": (numeric.sin, between(ANY), mpmath.sin),
    "cos": (numeric.cos, between(ANY), mpmath.cos),
    "tan": (numeric.tan, between((-1.4, 1.4)), mpmath.tan),
    "asin": (numeric.asin, between((-0.99, 0.99)), mpmath.asin),
    "acos": (numeric.acos, between((-0.99, 0.99)), mpmath.acos),
    "atan": (numeric.atan, between(ANY), mpmath.atan),
    "atan2": (numeric.atan2, between(ANY, ANY), mpmath.atan2),
    "radians": (numeric.radians, between(ANY), mpmath.radians),
    "degrees": (numeric.degrees, between(ANY), mpmath.degrees),
    "erf": (numeric.erf, between(ANY), mpmath.erf),
    "copysign": (numeric.copysign, between(ANY, ANY), lambda a, b: abs(a) * mpmath.sign(b)),
    "remainder": (numeric.remainder, between((-9.0, 9.0), POSITIVE), lambda a, b: a - b * mpmath.nint(a / b)),
    "fsum": (lambda a, b, c: numeric.fsum((a, b, c)), between(ANY, ANY, ANY), lambda a, b, c: a + b + c),
    "hypot": (numeric.hypot, between(ANY, ANY, ANY), lambda a, b, c: mpmath.sqrt(a * a + b * b + c * c)),
    "dist": (lambda a, b: numeric.dist((a, 0.25), (0.5, b)), between(ANY, ANY), lambda a, b: mpmath.hypot(a - 0.5, b - 0.25)),
    "min": (numeric.minimum, between(ANY, ANY, ANY), min),
    "max": (numeric.maximum, between(ANY, ANY, ANY), max),
    "quarter_exact": (lambda a: numeric.sum_of(quarter_exact(a)), between(ANY), lambda a: mpmath.cos(a) + mpmath.sin(a)),
    "a sum of products": (lambda a, b: a * b + a * a - b / (a * a), between(POSITIVE, ANY), lambda a, b: a * b + a * a - b / (a * a)),
}

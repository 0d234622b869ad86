"""Sums of floats and of their squares, the same in every Python and of numbers on a tape."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable
from functools import reduce


def sum_of(values: Iterable[float]) -> float:
    """The sum from left to right, each addition rounded by itself. From Python 3.12 on `sum` keeps what additions of floats lose, so that
    a file would have other last digits there, and `plans` other numbers than the passes."""
    return reduce(operator.add, values, 0)


def hypot(*components: float) -> float:
    """The length of a vector. `math.hypot` and `math.dist` have another last digit in some Pythons: of 0.075 m and 0.18 m it is
    0.195 m in 3.11, and 0.19499999999999998 m from 3.12 on."""
    return hypot_of(components)


def dist(p: Iterable[float], q: Iterable[float]) -> float:
    """The distance of two points of as many coordinates."""
    return hypot_of([a - b for a, b in zip(p, q, strict=True)])


def hypot_of(values: Iterable[float]) -> float:
    """The root of the sum of the squares, rounded once: the float nearest to it. Floats are whole numbers over a power of two, and with
    those nothing is lost. The root has 64 bits or more, of which the last is set where others would follow it: what is not half way between
    two floats does not look so. Where something is not finite, or the root greater than all floats, it is what `math.hypot` has."""
    listed = list(values)
    try:
        ratios = [value.as_integer_ratio() for value in listed]
        scale = max((denominator for _, denominator in ratios), default=1)
        square = sum((numerator * (scale // denominator)) ** 2 for numerator, denominator in ratios) << 128
        root = math.isqrt(square)
        return (root | (root * root != square)) / (scale << 64)
    except (OverflowError, ValueError):
        return math.hypot(*listed)

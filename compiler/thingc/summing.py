"""Sums of floats, the same in every Python and of numbers on a tape."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from functools import reduce


def plain_sum(values: Iterable[float]) -> float:
    """The sum from left to right, each addition rounded by itself. From Python 3.12 on `sum` keeps what additions of floats lose, so that
    a file would have other last digits there, and `plans` other numbers than the passes."""
    return reduce(operator.add, values, 0)

"""Compute a Python function of numbers for many rows of numbers at once.

The function runs with traced numbers for one row. The tape then gives the results of all rows for which the function makes the same
decisions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from thingc.batch.plans.columns import Floats, column_function
from thingc.batch.plans.program import program_of
from thingc.batch.plans.tape import Number, Tape

T = TypeVar("T")

PATHS = 32
"""Maximum number of rows for which the function is traced."""
FEW = 8
"""Minimum number of rows that are computed together."""


def compute_rows(
    function: Callable[[Sequence[Number]], tuple[T, Sequence[Number]] | None], rows: Floats,
) -> list[tuple[T, list[Any]] | None]:
    """Return the results of a function for all rows `(k, n)`.

    The function returns a value that depends only on its decisions, and computed numbers. It returns None if its result would depend on
    something that a tape does not contain, such as an exception. The result of a row is also None if too many rows differ in decisions.
    """
    found: list[tuple[T, list[Any]] | None] = [None] * len(rows)
    left = np.arange(len(rows))
    for _ in range(PATHS):
        if len(left) < FEW:
            break
        tape = Tape()
        try:
            result = function([tape.variable(value) for value in rows[left[0]].tolist()])
        except (TypeError, ValueError, ArithmeticError, AttributeError):  # it does not support traced numbers
            result = None
        done = np.arange(len(left)) == 0
        if result is not None:
            outputs, applies = column_function(program_of(tape, result[1]))(rows[left])
            for place, numbers in zip(left[applies].tolist(), outputs[applies].tolist()):
                found[place] = result[0], numbers
            done |= applies
        left = left[~done]
    return found

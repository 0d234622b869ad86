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
    """Call a function of n numbers for all rows `(k, n)`, and return a list of k results.

    The function returns a value that depends only on the outcomes of comparisons in the function, and a list of computed numbers. It
    returns None if the result depends on something that a tape does not contain, such as an exception. The result of a row is also None
    if the comparisons have too many different outcomes in the rows.
    """
    results: list[tuple[T, list[Any]] | None] = [None] * len(rows)
    remaining = np.arange(len(rows))
    for _ in range(PATHS):
        if len(remaining) < FEW:
            break
        tape = Tape()
        try:
            result = function([tape.variable(value) for value in rows[remaining[0]].tolist()])
        except (TypeError, ValueError, ArithmeticError, AttributeError):  # it does not support traced numbers
            result = None
        is_done = np.arange(len(remaining)) == 0
        if result is not None:
            outputs, applies = column_function(program_of(tape, result[1]))(rows[remaining])
            for place, numbers in zip(remaining[applies].tolist(), outputs[applies].tolist()):
                results[place] = result[0], numbers
            is_done |= applies
        remaining = remaining[~is_done]
    return results

"""Run a program for many settings at the same time.

In such a run, each number of the program is a numpy array with one value per setting. All results equal the results of `Program.run` bit by
bit. NumPy is used only for operations that IEEE 754 defines exactly: sums, products, quotients, square roots and comparisons. For other
functions, the last bit of NumPy's results may differ from Python. For this reason, Python computes these functions for one value at a time.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import repeat
from typing import Any

import numpy as np
import numpy.typing as npt

from thingc.base import numeric
from thingc.batch.plans.program import Guard, Operation, Program, value_in
from thingc.batch.plans.tape import OPERATORS, Ref

Floats = npt.NDArray[np.float64]
Booleans = npt.NDArray[np.bool_]
ColumnFunction = Callable[[Floats], "tuple[Floats, Booleans]"]
"""A function that maps values `(k, n)` of the variables to outputs `(k, m)` and flags `(k,)`.

The flag of a row is True if the program applies to the values in this row.
"""

_LAST = 1e-9
"""If a result is closer than this distance to the middle of two neighbouring floats, Python computes the result again.

The distance is given in units of the distance between the two floats.
"""

_DECIDED = 1e-11
"""Relative difference of two inexact values above which a comparison of the values is reliable."""

MOMENTS = "_principal_moments"


def column_function(program: Program) -> ColumnFunction:
    """Convert a program to a function of arrays that contain one value per setting."""
    last: dict[int, int] = {int(argument): len(program.statements) for argument in program.outputs if isinstance(argument, Ref)}
    for place in range(len(program.statements) - 1, -1, -1):
        for argument in program.statements[place].arguments:
            if isinstance(argument, Ref):
                last.setdefault(int(argument), place)
    functions = {**numeric.OPERATIONS, **program.operations, **ONE_BY_ONE}
    unused: list[list[int]] = [[] for _ in (*program.statements, None)]
    for index, place in last.items():
        unused[place].append(index)
    inexact = _guards_only(program)

    def run(values: Floats) -> tuple[Floats, Booleans]:
        columns: dict[int, Any] = dict(zip(program.variables, np.ascontiguousarray(values.T, dtype=np.float64), strict=True))
        ok = np.ones(len(values), dtype=np.bool_)
        with np.errstate(all="ignore"):
            for statement, dropped in zip(program.statements, unused[:-1], strict=True):
                _execute(statement, columns, ok, inexact, functions)
                for index in dropped:
                    columns.pop(index, None)
        outputs = np.empty((len(values), len(program.outputs)))
        for place, argument in enumerate(program.outputs):
            outputs[:, place] = value_in(argument, columns)
        return outputs, ok

    return run


def _guards_only(program: Program) -> set[int]:
    """Return the indices of values that depend on principal moments and that are used only in guards.

    Such values need not be computed exactly.
    """
    inexact: set[int] = set()
    for statement in program.statements:
        depends = any(int(argument) in inexact for argument in statement.arguments if isinstance(argument, Ref))
        if isinstance(statement, Operation) and statement.target not in program.needed and (depends or statement.operation == MOMENTS):
            inexact.add(statement.target)
    return inexact


def _execute(
    statement: Operation | Guard, columns: dict[int, Any], ok: Booleans, inexact: set[int], functions: Mapping[str, Callable[..., Any]],
) -> None:
    """Execute one statement of a program for all settings at once.

    `ok` contains a flag for each setting. This function sets the flag to False if the program does not apply to the setting. The program
    does not apply if a guard has a different outcome, or if an operation fails. The program also does not apply if the outcome of a guard
    is uncertain because it compares inexact values, which are listed in `inexact`.
    """
    arguments = [value_in(argument, columns) for argument in statement.arguments]
    if isinstance(statement, Operation):
        approximate = statement.operation == MOMENTS and statement.target in inexact
        columns[statement.target] = _moments(arguments, ok) if approximate else _operation(statement.operation, arguments, ok, functions)
        return
    ok &= np.asarray(_operation(statement.operation, arguments, ok, functions), dtype=np.bool_) == statement.outcome
    if len(arguments) == 2 and any(int(argument) in inexact for argument in statement.arguments if isinstance(argument, Ref)):
        ok &= np.abs(np.subtract(*arguments)) > _DECIDED * np.maximum(*map(np.abs, arguments))


def _operation(name: str, arguments: Sequence[Any], ok: Booleans, functions: Mapping[str, Callable[..., Any]]) -> Any:
    if name == "item" and isinstance(arguments[0], np.ndarray):  # an item of principal moments
        return arguments[0][arguments[1]]
    if name == "item":  # an item of each tuple in a list
        items = [row[arguments[1]] for row in arguments[0]]
        return items if isinstance(items[0], tuple) else np.array(items, dtype=np.float64)
    if name in EXACT:
        return EXACT[name](*arguments)
    if name == "/":
        ok &= np.not_equal(arguments[1], 0.0)
        return np.divide(*arguments)
    if name == "sqrt":
        ok &= ~np.less(arguments[0], 0.0)
        return np.sqrt(arguments[0])
    if name == "hypot":
        return _hypot(arguments, ok)
    if name == "_fsum":
        return _fsum(arguments, ok)
    return _call_per_row(functions[name], arguments, ok)


def _call_per_row(function: Callable[..., Any], arguments: Sequence[Any], ok: Booleans) -> Any:
    """Call a function once per setting, and return the results as an array or a list of tuples.

    If a call fails, set the flag of this setting in `ok` to False.
    """
    rows = list(zip(*(argument.tolist() if isinstance(argument, np.ndarray) else repeat(argument, len(ok)) for argument in arguments)))
    try:
        results = [function(*row) for row in rows]
    except (ArithmeticError, ValueError):
        results = [_attempt(function, row) for row in rows]
        ok &= np.array([result is not None for result in results])
        filler = next((result for result in results if result is not None), np.nan)
        results = [filler if result is None else result for result in results]
    return results if isinstance(results[0], tuple) else np.array(results)


def _attempt(function: Callable[..., Any], row: Iterable[Any]) -> Any:
    try:
        return function(*row)
    except (ArithmeticError, ValueError):
        return None


def _hypot(arguments: Sequence[Any], ok: Booleans) -> Any:
    """Compute `numeric.hypot` for arrays. Each result is the exact value, rounded once.

    The sum of squares is computed with twice the digits of a float (Dekker 1971), and the square root with one correction step. Python
    computes results that are close to the middle of two floats, and results for values whose squares overflow or underflow.
    """
    components = [np.broadcast_to(np.asarray(values, dtype=np.float64), ok.shape) for values in arguments]
    sizes = [np.abs(values) for values in components]
    largest = np.max(sizes, axis=0)
    tiny = np.any([(values < 1e-120) & (values != 0.0) for values in sizes], axis=0)
    high, low = _square(components[0])
    for values in components[1:]:
        square, lost = _square(values)
        high, error = _sum(high, square)
        low = low + lost + error
    root = np.sqrt(high)
    square, lost = _square(root)
    change = (((high - square) - lost) + low) / (2.0 * root)
    result = np.where(high == 0.0, 0.0, root + change)
    distance = np.abs(change - (result - root)) / np.spacing(result)  # below a power of two, the middle is at a quarter
    sure = (np.abs(distance - 0.5) > _LAST) & (np.abs(distance - 0.25) > _LAST)
    _compute_again(~((largest < 1e120) & ~tiny & ((high == 0.0) | sure)), numeric.hypot, components, result, ok)
    return result


def _compute_again(rows: Booleans, function: Callable[..., Any], arguments: Sequence[Floats], results: Floats, ok: Booleans) -> None:
    """Replace the results in the given rows by the results of a Python function. If a call fails, set the flag in `ok` to False."""
    for row in np.flatnonzero(rows):
        exact = _attempt(function, [float(values[row]) for values in arguments])
        ok[row] &= exact is not None
        results[..., row] = np.nan if exact is None else exact


def _moments(arguments: Sequence[Any], ok: Booleans) -> Floats:
    """Compute the principal moments `(3, k)` of k inertia matrices in ascending order, with a relative error of about 1e-12.

    The algorithm is the same as in the function `principal_axes`. If moments have very different sizes, the relative error of this method
    would be greater, so Python computes the result.
    """
    entries = [np.broadcast_to(np.asarray(entry, dtype=np.float64), ok.shape) for entry in arguments]
    m = [[(entries[3 * row + column] + entries[3 * column + row]) / 2.0 for column in range(3)] for row in range(3)]
    for _ in range(8):
        for p, q, r in ((0, 1, 2), (0, 2, 1), (1, 2, 0)):
            theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q])
            t = np.where(m[p][q] == 0.0, 0.0, np.copysign(1.0, theta) / (np.abs(theta) + np.sqrt(theta * theta + 1.0)))
            c = 1.0 / np.sqrt(t * t + 1.0)
            m[p][p], m[q][q] = m[p][p] - t * m[p][q], m[q][q] + t * m[p][q]
            x, y = m[p][r], m[q][r]
            m[p][r] = m[r][p] = c * (x - t * y)
            m[q][r] = m[r][q] = c * (y + t * x)
            m[p][q] = m[q][p] = np.zeros(ok.shape)
        off_diagonal = np.abs(m[0][1]) + np.abs(m[0][2])
        if not np.any(off_diagonal > 1e-16 * np.abs(m[0][0])):
            break
    moments: Floats = np.sort([m[0][0], m[1][1], m[2][2]], axis=0)
    unsure = ~((off_diagonal <= 1e-15 * moments[2]) & (moments[0] > 1e-3 * moments[2]))
    _compute_again(unsure, numeric.OPERATIONS[MOMENTS], entries, moments, ok)
    return moments


def _fsum(arguments: Sequence[Any], ok: Booleans) -> Any:
    """Compute `math.fsum` for arrays. Each result is the exact sum, rounded once.

    The result is the sum of all floats, plus the sum of all rounding errors (Ogita, Rump and Oishi 2005). Python computes sums that are
    close to the middle of two floats, or that are much smaller than the summands.
    """
    arrays = [one for one in arguments if isinstance(one, np.ndarray)]
    constants = _as_two_numbers([value for value in arguments if not isinstance(value, np.ndarray)])
    values = [*arrays, *(np.broadcast_to(np.float64(one), ok.shape) for one in constants)]
    total, errors, lost_sum = values[0], np.zeros(ok.shape), np.zeros(ok.shape)
    for one in values[1:]:
        total, error = _sum(total, one)
        errors, lost = _sum(errors, error)
        lost_sum = lost_sum + np.abs(lost)
    result = total + errors
    spacing = np.spacing(np.abs(result))
    distance = np.abs(errors - (result - total)) / spacing
    sure = (np.abs(distance - 0.5) > _LAST) & (np.abs(distance - 0.25) > _LAST) & (lost_sum < _LAST / 4.0 * spacing)
    result = result + 0.0  # for zeros with a sign, `math.fsum` returns 0.0
    _compute_again(~((lost_sum == 0.0) | sure) | ~np.isfinite(result), lambda *row: math.fsum(row), values, result, ok)
    return result


def _as_two_numbers(numbers: Sequence[float]) -> Sequence[float]:
    """Return two numbers whose exact sum equals the exact sum of `numbers`. If two such numbers do not exist, return `numbers`."""
    try:
        high = math.fsum(numbers)
        low = math.fsum((*numbers, -high))
        return (high, low) if len(numbers) > 2 and math.fsum((*numbers, -high, -low)) == 0.0 else numbers
    except (OverflowError, ValueError):
        return numbers


def _sum(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Return the rounded sum of two arrays, and the rounding error of the sum (Knuth 1969)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _square(value: Floats) -> tuple[Floats, Floats]:
    """Square each element of an array. Return the squares, and their rounding errors."""
    square = value * value
    scaled = 134217729.0 * value  # 2**27 + 1
    high = scaled - (scaled - value)
    low = value - high
    return square, ((high * high - square) + 2.0 * high * low) + low * low


def _power(base: float, exponent: float) -> float:
    result = base**exponent
    if not isinstance(result, float):
        raise ValueError("not a real number")
    return result


def _extreme(replaces: Callable[[Any, Any], Any], first: Any, *others: Any) -> Any:
    """Return the first of the smallest or largest values, in the same way as Python's `min` or `max`.

    The order of the values matters for NaN, and for zeros with different signs.
    """
    for value in others:
        first = np.where(replaces(value, first), value, first)
    return first


EXACT: dict[str, Callable[..., Any]] = {
    **{name: OPERATORS[name] for name in ("+", "-", "*", "<", "<=", ">", ">=", "==", "!=")},
    "abs": operator.abs, "copysign": np.copysign, "isfinite": np.isfinite, "isinf": np.isinf,
    "min": partial(_extreme, np.less), "max": partial(_extreme, np.greater),
}
"""Operations that never fail and that have the same results in NumPy as in Python."""
ONE_BY_ONE: dict[str, Callable[..., Any]] = {"**": _power, "%": operator.mod, "round": round}
"""Operations that NumPy may round differently than Python."""

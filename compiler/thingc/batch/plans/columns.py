"""Run a program over columns: arrays with one value per setting. Every value is equal to the last bit to that of `Program.run`.

NumPy computes only what IEEE 754 defines exactly (sums, products, quotients, square roots, comparisons). Its other functions may differ in
the last bit from those of Python, which are therefore applied to one value after the other.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import repeat
from typing import Any

import numpy as np
import numpy.typing as npt

from thingc.base import numeric
from thingc.batch.plans.program import Argument, Guard, Line, Program
from thingc.batch.plans.tape import OPERATORS, Ref

Floats = npt.NDArray[np.float64]
Booleans = npt.NDArray[np.bool_]
ColumnFunction = Callable[[Floats], "tuple[Floats, Booleans]"]
"""Maps `(k, n)` values of the variables to `(k, m)` outputs and `(k,)` flags: whether the program applies to a row."""

_LAST = 1e-9
"""`_hypot` computes a length again if it is nearer than this to the middle of two floats, in units of their distance."""


def column_function(program: Program) -> ColumnFunction:
    """Return the program as a function of columns."""
    last: dict[int, int] = {int(one): len(program.statements) for one in program.outputs if isinstance(one, Ref)}
    for place in range(len(program.statements) - 1, -1, -1):
        for one in program.statements[place].arguments:
            if isinstance(one, Ref):
                last.setdefault(int(one), place)
    functions = {**numeric.OPERATIONS, **program.operations, **ONE_BY_ONE}
    unused: list[list[int]] = [[] for _ in (*program.statements, None)]
    for index, place in last.items():
        unused[place].append(index)

    def run(values: Floats) -> tuple[Floats, Booleans]:
        columns: dict[int, Any] = dict(zip(program.variables, np.ascontiguousarray(values.T, dtype=np.float64), strict=True))
        ok = np.ones(len(values), dtype=np.bool_)
        with np.errstate(all="ignore"):
            for statement, dropped in zip(program.statements, unused[:-1], strict=True):
                _execute(statement, columns, ok, functions)
                for index in dropped:
                    columns.pop(index, None)
        outputs = np.empty((len(values), len(program.outputs)))
        for place, one in enumerate(program.outputs):
            outputs[:, place] = _value(one, columns)
        return outputs, ok

    return run


def _execute(statement: Line | Guard, columns: dict[int, Any], ok: Booleans, functions: Mapping[str, Callable[..., Any]]) -> None:
    """Compute a line, or clear the flags of rows that a guard excludes or for which an operation fails."""
    arguments = [_value(one, columns) for one in statement.arguments]
    result = _operation(statement.operation, arguments, ok, functions)
    if isinstance(statement, Line):
        columns[statement.target] = result
    else:
        ok &= np.asarray(result, dtype=np.bool_) == statement.outcome


def _value(argument: Argument, columns: dict[int, Any]) -> Any:
    return columns[int(argument)] if isinstance(argument, Ref) else argument.value


def _operation(name: str, arguments: Sequence[Any], ok: Booleans, functions: Mapping[str, Callable[..., Any]]) -> Any:
    if name == "item":  # of a column of tuples
        items = [one[arguments[1]] for one in arguments[0]]
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
    return _each(functions[name], arguments, ok)


def _each(function: Callable[..., Any], arguments: Sequence[Any], ok: Booleans) -> Any:
    """Apply a function to one row after the other: return an array, or a list of tuples. Clear the flags of rows for which it fails."""
    rows = zip(*(one.tolist() if isinstance(one, np.ndarray) else repeat(one, len(ok)) for one in arguments))
    try:
        results = [function(*row) for row in rows]
        return results if isinstance(results[0], tuple) else np.array(results)
    except (ArithmeticError, ValueError):
        pass
    rows = zip(*(one.tolist() if isinstance(one, np.ndarray) else repeat(one, len(ok)) for one in arguments))
    found = [_attempt(function, row) for row in rows]
    ok &= np.array([one is not None for one in found])
    filler = next((one for one in found if one is not None), np.nan)
    results = [filler if one is None else one for one in found]
    return results if isinstance(filler, tuple) else np.array(results)


def _attempt(function: Callable[..., Any], row: Iterable[Any]) -> Any:
    try:
        return function(*row)
    except (ArithmeticError, ValueError):
        return None


def _hypot(arguments: Sequence[Any], ok: Booleans) -> Any:
    """Return `numeric.hypot`, which rounds once.

    The sum of squares has twice the digits of a float (Dekker 1971); its root is that of a float with one correction. Python computes
    lengths near the middle of two floats, and of values whose squares are too large or small for this.
    """
    components = [np.broadcast_to(np.asarray(one, dtype=np.float64), ok.shape) for one in arguments]
    sizes = [np.abs(one) for one in components]
    largest = np.max(sizes, axis=0)
    tiny = np.any([(one < 1e-120) & (one != 0.0) for one in sizes], axis=0)
    high, low = _square(components[0])
    for one in components[1:]:
        (square, rest), before = _square(one), high
        high = before + square
        part = high - before
        low = low + rest + ((before - (high - part)) + (square - part))
    root = np.sqrt(high)
    square, rest = _square(root)
    change = (((high - square) - rest) + low) / (2.0 * root)
    result = np.where(high == 0.0, 0.0, root + change)
    distance = np.abs(change - (result - root)) / np.spacing(result)  # below a power of two, the middle is at a quarter
    sure = (np.abs(distance - 0.5) > _LAST) & (np.abs(distance - 0.25) > _LAST)
    for row in np.flatnonzero(~((largest < 1e120) & ~tiny & ((high == 0.0) | sure))):
        length = _attempt(numeric.hypot, [float(one[row]) for one in components])
        ok[row] &= length is not None
        result[row] = np.nan if length is None else length
    return result


def _square(value: Floats) -> tuple[Floats, Floats]:
    """Return the square of numbers as the sum of a float and its rounding error."""
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


def _minus(first: Any, *second: Any) -> Any:
    return first - second[0] if second else -first


def _minimum(first: Any, *others: Any) -> Any:
    """Return the first of the least values, as `min` does: it matters for zeros with different signs, and if one is not a number."""
    for one in others:
        first = np.where(np.less(one, first), one, first)
    return first


def _maximum(first: Any, *others: Any) -> Any:
    for one in others:
        first = np.where(np.greater(one, first), one, first)
    return first


EXACT: dict[str, Callable[..., Any]] = {
    **{name: OPERATORS[name] for name in ("+", "*", "<", "<=", ">", ">=", "==", "!=")}, "-": _minus,
    "abs": operator.abs, "copysign": np.copysign, "isfinite": np.isfinite, "isinf": np.isinf, "min": _minimum, "max": _maximum,
}
"""Operations with the same results in NumPy, which never fail."""
ONE_BY_ONE: dict[str, Callable[..., Any]] = {"**": _power, "%": operator.mod, "round": round}
"""Operations of Python that NumPy may round differently."""

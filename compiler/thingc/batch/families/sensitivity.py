"""Compute how sensitive the results of a robot are to numbers in the document, as derivatives with units and errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from fnmatch import fnmatchcase
from math import nan

import numpy as np

from thingc.base.one_line_repr import OneLineStruct
from thingc.base.source import ScalarNode, Span
from thingc.base.units import Dimension, Quantity
from thingc.batch.families.function import FamilyFunction, NotDifferentiable
from thingc.batch.measurements import TEST, tested_values
from thingc.batch.rules import dimension_of
from thingc.batch.values import unit_in


class Sensitivity(OneLineStruct):
    """The `derivative` of the result `result` by one number in the document, in SI units.

    `error` is an estimate of the error of the derivative, which is 0 for an exact derivative. `value` is the value of the result, and
    `number` is the value of the number in the document. The number is at `span` in the document, and has the unit `unit`. If the derivative
    does not exist, `derivative` is NaN, and `missing` contains the reason with a help text.
    """

    result: str
    name: str
    value: Quantity
    number: Quantity
    derivative: float
    error: float
    unit: str = ""
    span: Span | None = None
    missing: NotDifferentiable | None = None

    @property
    def change(self) -> float:
        """The change of the result in SI units for an increase of the number by 1 %."""
        return self.derivative * self.number.value / 100.0


def results_by_function(patterns: Iterable[str], kinds: Mapping[str, str]) -> list[list[str]]:
    """Divide names of results into groups, so that one function can compute each group.

    All results except tests form a single group, and each test forms a separate group. `kinds` maps the name of each test to its kind. A
    pattern such as `tests.*` matches all tests whose measured value is a smooth number.
    """
    results, tests = list[str](), dict[str, list[str]]()
    for text in patterns:
        if text.startswith(TEST) and "*" in text:
            matching = [group for group, kind in kinds.items() if tested_values(kind) and fnmatchcase(group, text[len(TEST):])]
            tests.update((group, [TEST + group]) for group in matching or [text[len(TEST):]])
        elif text.startswith(TEST):
            tests.setdefault(text.split(".")[1], []).append(text)
        else:
            results.append(text.removesuffix(".*"))
    return [group for group in (results, *tests.values()) if group]


def sensitivities(
    function: FamilyFunction, x: Mapping[str, float], kinds: Mapping[str, str], nodes: Mapping[str, ScalarNode],
    alone: Callable[[str, str], FamilyFunction],
) -> Iterator[Sensitivity]:
    """Yield the derivative of each result of a function by each of its numbers, at the values `x`.

    If the derivatives cannot be computed together, each derivative is computed with the function that `alone(result, name)` returns.
    `nodes` maps names to the nodes of the document that contain the numbers.
    """
    point = np.array([x[name] for name in function.names])
    values = function.value(point)
    derivatives: dict[tuple[int, int], tuple[float, float, NotDifferentiable | None]] = {}
    with suppress(NotDifferentiable):
        jacobian = function.jacobian(point)
        assert jacobian.error is not None
        entries = zip(np.ndenumerate(jacobian), jacobian.error.flat)
        derivatives = {place: (float(value), float(error), None) for (place, value), error in entries}
    for row, result in enumerate(function.outputs):
        for column, name in enumerate(function.names):
            derivative, error, missing = derivatives.get((row, column)) or _derivative(alone(result, name), x[name])
            node = nodes.get(name)
            yield Sensitivity(
                result=result, name=name, value=Quantity(float(values[row]), _dimension_of(result, kinds)),
                number=Quantity(x[name], function.dimensions[column]), derivative=derivative, error=error,
                unit=unit_in(node.text) if node is not None else "", span=node.span if node is not None else None, missing=missing,
            )


def _derivative(function: FamilyFunction, x: float) -> tuple[float, float, NotDifferentiable | None]:
    """Return a tuple with the derivative of a function of a single number at `x`, the error of this derivative, and None.

    If the derivative does not exist, the third item is the exception with the reason.
    """
    try:
        jacobian = function.jacobian([x])
    except NotDifferentiable as fault:
        return nan, 0.0, fault
    assert jacobian.error is not None
    return float(jacobian[0, 0]), float(jacobian.error[0, 0]), None


def _dimension_of(result: str, kinds: Mapping[str, str]) -> Dimension:
    names = result.split(".")
    if not result.startswith(TEST):
        return dimension_of(result)
    keys = tested_values(kinds[names[1]])
    return keys.get(names[-1], next(iter(keys.values())))

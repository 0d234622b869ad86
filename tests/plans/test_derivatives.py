"""Derivatives of programs, compared with differences that mpmath computes with 60 digits."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from typing import Any

import mpmath
import numpy as np
import pytest

from plans.operations import OPERATIONS
from thingc.base import inertia, numeric, pose
from thingc.base.inertia import principal_moments
from thingc.base.numeric import hypot, maximum, minimum, round_significant, sin, sqrt
from thingc.batch.plans import derivatives
from thingc.batch.plans.derivatives import RULES, NotSmooth, derivative_function
from thingc.batch.plans.program import Operation, program_of
from thingc.batch.plans.tape import Tape, Traced


def traced(*values: float) -> tuple[Traced, ...]:
    tape = Tape()
    return tuple(tape.variable(value) for value in values)


def program(*outputs: Any) -> Any:
    tape = next(one.tape for one in outputs if isinstance(one, Traced))
    return program_of(tape, outputs)


@pytest.mark.parametrize("name", OPERATIONS)
@pytest.mark.parametrize("arrays", [False, True], ids=["code", "arrays"])
def test_rule_is_the_derivative(name: str, arrays: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if arrays:
        monkeypatch.setattr(derivatives, "LONGEST", -1)
    function, draw, oracle = OPERATIONS[name]
    source = random.Random(name)
    compared = 0
    for _ in range(12):
        values = draw(source)
        found = derivative_function(program(function(*traced(*values))))(values)
        if found is None:
            continue
        with mpmath.workdps(60):
            exact = [
                mpmath.diff(oracle, tuple(map(mpmath.mpf, values)), tuple(int(one == place) for one in range(len(values))))
                for place in range(len(values))
            ]
        assert found.jacobian[0] == pytest.approx([float(one) for one in exact], rel=2e-14, abs=2e-15)
        compared += 1
    assert compared == 12


def test_every_rule_is_tested() -> None:
    used = set()
    for function, draw, _ in OPERATIONS.values():
        line = program(function(*traced(*draw(random.Random(1))))).statements
        used |= {one.operation for one in line if isinstance(one, Operation)}
    assert set(RULES) - used == {
        "negative", "cosine of", "sine of", "round", "round_significant",
    }  # tested as `-`, `quarter_exact`, and below


def test_every_smooth_operation_has_a_rule() -> None:
    without = (numeric.isfinite, numeric.isinf, pose.quarter_exact, inertia._principal_moments, inertia._principal_axes)
    assert set(numeric.OPERATIONS) - set(RULES) == {one.__name__ for one in without}


def composed(a: Any, b: Any, c: Any) -> list[Any]:
    """Compute many values that depend on others in several ways."""
    x = [a, b, c]
    for _ in range(6):
        x = [x[0] * x[1] + 0.3 * x[2], sin(x[0] - x[2]), hypot(x[1], x[2], 1.0) / (1.0 + x[0] ** 2)]
    return [*x, x[0] + x[1], a, -b, 7.0]


@pytest.mark.parametrize("way", ["forward", "backward", "arrays"])
def test_all_methods_give_the_same_jacobian(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if way == "arrays":
        monkeypatch.setattr(derivatives, "LONGEST", -1)
    else:
        monkeypatch.setattr(derivatives, f"_{'backward' if way == 'forward' else 'forward'}", getattr(derivatives, f"_{way}"))
    values = (0.4, -0.7, 1.1)
    found = derivative_function(program(*composed(*traced(*values))))(values)
    assert found is not None and found.values == pytest.approx([*(one.value for one in composed(*traced(*values))[:-1]), 7.0], rel=1e-15)

    def exact(row: int) -> Callable[..., Any]:
        def output(a: Any, b: Any, c: Any) -> Any:
            x = [a, b, c]
            for _ in range(6):
                x = [
                    x[0] * x[1] + mpmath.mpf(0.3) * x[2], mpmath.sin(x[0] - x[2]),
                    mpmath.sqrt(x[1] ** 2 + x[2] ** 2 + 1) / (1 + x[0] ** 2),
                ]
            return [*x, x[0] + x[1], a, -b, mpmath.mpf(7)][row]

        return output

    with mpmath.workdps(60):
        for row in range(7):
            for place in range(3):
                wanted = float(mpmath.diff(exact(row), tuple(map(mpmath.mpf, values)), tuple(int(one == place) for one in range(3))))
                assert found.jacobian[row, place] == pytest.approx(wanted, rel=1e-13, abs=1e-15)


def test_method_with_fewer_statements_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[int] = []
    generated = derivatives._generate_function
    monkeypatch.setattr(derivatives, "_generate_function", lambda *given: taken.append(len(given[3][0])) or generated(*given))
    many = traced(*(0.1 * place for place in range(20)))
    chain = many[0]
    for one in many[1:]:
        chain = sin(chain * one)
    derivative_function(program(chain))
    one, = traced(0.5)
    derivative_function(program(*(sin(one * place) for place in range(1, 20))))
    assert taken[0] < 150 and taken[1] < 60  # forward, the chain would take over 300, and backward, the fan over 70


@pytest.mark.parametrize(("function", "values", "why"), [
    (lambda a: abs(a), (0.0,), "absolute value of 0"),
    (lambda a: sqrt(a * a), (0.0,), "square root of 0"),
    (lambda a, b: hypot(a, b), (0.0, 0.0), "length 0"),
    (lambda a, b: maximum(a, b), (1.5, 1.5), "maximum of equal values"),
    (lambda a, b: minimum(a, 2.0 * b) * 3.0, (1.0, 0.5), "minimum of equal values"),
    (lambda a: a % 0.5, (1.5,), "remainder"),
    (lambda a: round(a, 2), (0.3,), "is rounded"),
])
def test_kink_is_an_error(function: Callable[..., Any], values: Sequence[float], why: str) -> None:
    inputs = traced(*values)
    with pytest.raises(NotSmooth, match=why) as caught:
        derivative_function(program(inputs[0] * 2.0, function(*inputs)))(values)
    assert caught.value.output == 1


def test_missing_rule_does_not_affect_other_derivatives() -> None:
    a, b = traced(4.0, 2.0)
    moment = principal_moments(((a, 0.1, 0.0), (0.1, 2.0, 0.3), (0.0, 0.3, 1.5)))[0]
    found = derivative_function(program(a * b, moment, moment * b, moment * 0.0 + b))((4.0, 2.0))
    assert found is not None and np.isnan(found.jacobian).tolist() == [[False, False], [True, False], [True, False], [True, False]]
    assert found.jacobian[0].tolist() == [2.0, 4.0] and found.jacobian[2, 1] == found.values[1] and found.jacobian[3, 1] == 1.0


@pytest.mark.parametrize("way", ["forward", "backward", "arrays"])
def test_equal_derivatives_of_branches_are_not_a_kink(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Except for long programs, the derivatives of branches are compared by generated code."""
    if way == "arrays":
        monkeypatch.setattr(derivatives, "LONGEST", -1)
    else:
        monkeypatch.setattr(derivatives, "_by_arrays", lambda *given: pytest.fail("the derivatives are computed with arrays"))
    original = derivatives._forward
    if way == "backward":
        monkeypatch.setattr(derivatives, "_forward", lambda *given: (original(*given)[0] + ["pass"] * 99, original(*given)[1]))
    a, b = traced(1.5, 2.0)
    x, zero = maximum(a + b, b + a, 1.0 + 0.5 * b), a * 0.0
    y = maximum(x, 2.0 * b - x + 2.0 * a, 3.0)
    outputs = program(
        x * x, abs(zero) + b, minimum(a, b), hypot(zero, zero) * b, y * b, minimum(1.0, 1.0, a + b), maximum(7.5, -b, 7.5, x * 2.0),
    )
    steps = derivatives._steps_of(outputs, outputs.variables)
    forward, backward = (len(find(outputs, steps, outputs.variables)[0]) for find in (derivatives._forward, derivatives._backward))
    assert (2 * backward < forward) == (way == "backward")
    found = derivative_function(outputs)((1.5, 2.0))
    assert found is not None
    assert found.jacobian.tolist() == [[7.0, 7.0], [0.0, 1.0], [1.0, 0.0], [0.0, 0.0], [2.0, 5.5], [0.0, 0.0], [0.0, 0.0]]


def test_different_derivatives_of_inner_branches_are_a_kink() -> None:
    a, b = traced(1.5, 2.0)
    run = derivative_function(program(a, maximum(maximum(a + b, b + a), 2.0 * b - 0.5) + minimum(0.0, 0.0, a)))
    with pytest.raises(NotSmooth, match="maximum of equal values"):
        run((1.5, 2.0))
    found = run((1.5, 2.1))
    assert found is not None and found.jacobian.tolist() == [[1.0, 0.0], [0.0, 2.0]]


def test_decisions_between_equal_numbers_are_reported_by_variable() -> None:
    a, b, c = traced(1.0, 2.0, 3.0)
    assert a * 2.0 <= b and a + b > 1.0 and c != 0.0 and a != math.inf
    run = derivative_function(program(a * b + c))
    for values, special in [((1.0, 2.0, 3.0), {0, 1}), ((0.5, 2.0, 3.0), set()), ((0.5, 0.5, 1.0), None), ((0.4, 1.0, 0.0), None)]:
        found = run(values)
        assert (found is None) == (special is None)
        if found is not None:
            assert found.special == special and found.jacobian.tolist() == [[values[1], values[0], 1.0]]
    only = derivative_function(program(a * b + c), [2])((1.0, 2.0, 3.0))
    assert only is not None and only.special == frozenset() and only.jacobian.tolist() == [[1.0]]


def test_rounding_to_many_digits_has_the_derivative_of_the_number() -> None:
    a, = traced(0.3)
    found = derivative_function(program(round(a * 2.0, 7), round_significant(a, 9)))((0.4,))
    assert found is not None and found.jacobian.tolist() == [[2.0], [1.0]]


def test_other_decisions_and_failures_have_no_derivatives() -> None:
    a, = traced(2.0)
    assert a > 1.0
    run = derivative_function(program(1.0 / (a - 3.0)))
    assert run((0.5,)) is None
    found = run((2.5,))
    assert found is not None and np.array_equal(found.jacobian, [[-4.0]])
    with pytest.raises(ZeroDivisionError):
        run((3.0,))

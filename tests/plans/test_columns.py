"""Columns compute the same bits as the function for single settings."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from plans.operations import OPERATIONS
from thingc.base.inertia import physical_fault, principal_axes, principal_moments
from thingc.base.numeric import fsum, hypot, isfinite, maximum, minimum, round_significant, sqrt
from thingc.batch.plans.columns import column_function
from thingc.batch.plans.program import Program, program_of
from thingc.batch.plans.tape import Tape

ODD = [0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 3.0, 4.0, 1e-200, 1e-308, 5e-324, 1e200, -1e200, 1.7e308, math.inf, -math.inf, math.nan, math.pi]


def assert_same(program: Program, rows: np.ndarray) -> int:
    """Compare all rows bit by bit; return the number of those to which the program applies."""
    found, ok = column_function(program)(rows)
    for row, outputs, applies in zip(rows.tolist(), found, ok, strict=True):
        try:
            alone = program.run(*row)
        except (ArithmeticError, ValueError):
            alone = None
        assert (alone is not None) == applies, row
        if alone is not None:
            assert outputs.tobytes() == np.array(alone, dtype=np.float64).tobytes() or np.isnan(outputs).any(), (row, alone, outputs)
            assert np.array_equal(np.isnan(outputs), np.isnan(np.array(alone, dtype=np.float64)))
    return int(ok.sum())


@pytest.mark.parametrize("name", OPERATIONS)
def test_operation_has_the_same_bits(name: str) -> None:
    function, draw, _ = OPERATIONS[name]
    tape, source = Tape(), random.Random(name)
    variables = [tape.variable(value) for value in draw(source)]
    program = program_of(tape, [function(*variables)])
    rows = [draw(source) for _ in range(2000)]
    assert assert_same(program, np.array(rows)) >= 1000 or name in ("abs",)
    strange = [[source.choice(ODD) for _ in variables] for _ in range(400)]
    assert_same(program, np.array(strange))


def test_lengths_are_rounded_once() -> None:
    tape, source = Tape(), random.Random(4)
    variables = [tape.variable(1.0), tape.variable(2.0), tape.variable(3.0)]
    program = program_of(tape, [hypot(*variables), hypot(variables[0], 0.0), hypot(variables[0], 0.18)])
    rows = [[source.uniform(-1, 1) * 10.0 ** source.randint(-12, 12) for _ in range(3)] for _ in range(5000)]
    rows += [[float(source.randint(-40, 40)) for _ in range(3)] for _ in range(3000)]
    rows += [[source.choice(ODD) for _ in range(3)] for _ in range(500)]
    assert assert_same(program, np.array([*rows, [0.075, 0.18, 0.0]])) > 8000


def test_sums_are_rounded_once() -> None:
    tape, source = Tape(), random.Random(5)
    variables = [tape.variable(1.0), tape.variable(2.0), tape.variable(3.0), tape.variable(4.0)]
    constants = (0.1, 1e-17, -0.3, 1e9, 7e-5, -0.0)
    program = program_of(tape, [
        fsum(variables), fsum((variables[0], 1.0, -1.0)), fsum(variables[:2]), fsum((*constants, *variables[:2])),
        fsum((variables[0], 1e300, 0.1, 1e-300)), fsum((variables[0], math.inf, 1.0, 2.0)),
    ])
    rows = [[source.uniform(-1, 1) * 10.0 ** source.randint(-9, 9) for _ in variables] for _ in range(5000)]
    rows += [[float(source.randint(-9, 9)) * 0.1 for _ in variables] for _ in range(3000)]
    for _ in range(3000):
        a = source.uniform(-1, 1)
        rows.append([a, -a * (1.0 + source.randint(-1, 1) * 2.0**-52), a * 1e-17, source.choice((a, -a))])
    rows += [[1.0, source.choice((2.0**-53, -(2.0**-54), 2.0**-52)), 2.0 ** -source.randint(53, 120), 0.0] for _ in range(500)]
    rows += [[source.choice(ODD) for _ in variables] for _ in range(1000)]
    assert assert_same(program, np.array(rows)) > 11000


def test_guards_exclude_rows_and_tuples_are_unpacked() -> None:
    tape = Tape()
    a, b = tape.variable(2.0), tape.variable(0.3)
    least, *_ = principal_moments(((a, 0.1, 0.0), (0.1, 2.0, b), (0.0, b, 1.5)))
    answers = [least * 2.0, round_significant(a * b, 3), round(b, 2), sqrt(a), maximum(a, b, 1.0), minimum(a, -b), 7.0]
    assert a > 0.5 and isfinite(b) and not b > 1.0 and bool(a != 1.25)
    source = random.Random(2)
    rows = [[source.uniform(-1.0, 3.0), source.uniform(-1.0, 2.0)] for _ in range(1000)]
    applied = assert_same(program_of(tape, answers), np.array([*rows, [1.25, 0.1], [math.inf, 0.1], [1.0, math.nan]]))
    assert applied - 1 == sum(a > 0.5 and b <= 1.0 for a, b in rows) > 100  # and the row with an infinite moment


def test_moments_in_guards_decide_or_exclude_a_row() -> None:
    tape, source = Tape(), random.Random(6)
    xx, yy, zz, xy = (tape.variable(value) for value in (1.0, 2.0, 2.5, 0.1))
    assert physical_fault(((xx, xy, 0.02), (xy, yy, 0.0), (0.02, 0.0, zz))) is None
    program = program_of(tape, [xx + yy])
    rows = [[source.uniform(1.0, 3.0) for _ in range(3)] + [source.uniform(-0.5, 0.5)] for _ in range(3000)]
    rows += [[1.0, 2.0, 3.0 + source.choice((0.0, 1e-9, 3e-9, -1e-9, 1e-12)), 0.0] for _ in range(100)]  # near the limit of a plane body
    rows += [[10.0 ** -source.randint(2, 18), 2.0, 2.0, 0.0] for _ in range(100)]
    found, ok = column_function(program)(np.array(rows))
    alone = [program.run(*row) for row in rows]
    assert not any(applies and one is None for applies, one in zip(ok, alone, strict=True))
    assert [one for one, applies in zip(alone, ok, strict=True) if applies] == [tuple(one) for one in found[ok].tolist()]
    exact = sum(one is not None for one in alone[:3000])
    assert 500 < exact < 2900 and ok[:3000].sum() == exact


def test_axes_in_guards_are_exact() -> None:
    tape = Tape()
    xx, xy = tape.variable(1.0), tape.variable(0.3)
    _, axes = principal_axes(((xx, xy, 0.0), (xy, 2.0, 0.1), (0.0, 0.1, 3.0)))
    assert axes[0][0] > 0.9
    source = random.Random(7)
    rows = [[source.uniform(0.0, 2.0), source.uniform(0.0, 0.5)] for _ in range(500)]
    assert 50 < assert_same(program_of(tape, [xx]), np.array(rows)) < 450

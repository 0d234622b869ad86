"""Sums of floats and lengths of vectors."""

from __future__ import annotations

import math
from decimal import Context, Decimal

import pytest
from hypothesis import example, given, strategies as st

from thingc.base.numeric import dist, hypot, sum_of

FLOATS = st.floats(allow_nan=False, allow_infinity=False)


def test_sum_is_not_compensated() -> None:
    """The built-in `sum` of Python 3.12 and newer returns 1.0 for the first list."""
    assert sum_of([1e16, 1.0, -1e16]) == 0.0
    assert sum_of([0.1] * 10) == 0.9999999999999999
    assert sum_of([]) == 0


@given(st.lists(FLOATS))
def test_sum_adds_from_left_to_right(values: list[float]) -> None:
    by_hand = 0.0
    for one in values:
        by_hand = by_hand + one
    assert repr(float(sum_of(iter(values)))) == repr(by_hand)


def test_hypot_returns_the_nearest_float() -> None:
    """`math.hypot` returns another last digit for the first two in Python 3.12, and for the third in 3.11."""
    assert hypot(0.075, 0.18) == 0.195 and hypot(0.15, 0.36) == 0.39 and hypot(1.004, 0.753) == 1.255
    assert dist((0.1, 0.0, 0.2), (0.025, 0.0, 0.02)) == hypot(0.1 - 0.025, 0.2 - 0.02)
    assert hypot() == 0.0 and hypot(-0.0) == 0.0 and hypot(-3, 4) == 5.0


@given(st.lists(FLOATS, min_size=1, max_size=4))
@example([5e-324, 5e-324])
@example([1.5e308, 1.5e308])
def test_hypot_is_correctly_rounded(values: list[float]) -> None:
    """The oracle is decimal arithmetic with enough digits to represent the squares exactly."""
    wide = Context(prec=2400)
    square = Decimal(0)
    for one in values:
        square = wide.add(square, wide.multiply(Decimal(one), Decimal(one)))
    assert hypot(*values) == float(wide.sqrt(square))


@pytest.mark.parametrize("values", [(math.inf, 1.0), (math.nan, math.inf), (math.nan, 1.0), (1.7e308, 1.7e308)])
def test_hypot_of_infinite_and_nan_values(values: tuple[float, ...]) -> None:
    assert repr(hypot(*values)) == repr(math.hypot(*values))

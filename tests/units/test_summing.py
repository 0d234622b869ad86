"""Sums of floats."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from thingc.summing import plain_sum

FLOATS = st.floats(allow_nan=False, allow_infinity=False)


def test_what_additions_lose_is_lost() -> None:
    """A `sum` of Python 3.12 or newer has 1.0."""
    assert plain_sum([1e16, 1.0, -1e16]) == 0.0
    assert plain_sum([0.1] * 10) == 0.9999999999999999
    assert plain_sum([]) == 0


@given(st.lists(FLOATS))
def test_it_adds_from_left_to_right(values: list[float]) -> None:
    by_hand = 0.0
    for one in values:
        by_hand = by_hand + one
    assert repr(float(plain_sum(iter(values)))) == repr(by_hand)

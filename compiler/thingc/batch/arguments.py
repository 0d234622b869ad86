"""Arguments as they are given from Python: what cannot be meant is said at once."""

from __future__ import annotations

import math
from collections.abc import Iterable
from numbers import Integral, Real
from typing import Any

from thingc.batch.results import FamilyError


def is_whole(value: Any, least: int) -> bool:
    """Whether this is a whole number of at least so much."""
    return isinstance(value, Integral) and not isinstance(value, bool) and int(value) >= least


def is_number(value: Any) -> bool:
    """Whether this is a number, and not NaN."""
    return isinstance(value, Real) and not isinstance(value, bool) and not math.isnan(value)


def at_least(least: int, **numbers: Any) -> None:
    """Raises `FamilyError` for what is no whole number of at least so much, by its name."""
    for name, value in numbers.items():
        if not is_whole(value, least):
            raise FamilyError(f"expected `{name}` to be a whole number of at least {least}, found {value}")


def as_names(**given: Any) -> tuple[Any, ...]:
    """Names, of which one may stand for itself. Raises `FamilyError` for what is no list of them."""
    ((argument, names),) = given.items()
    if isinstance(names, str):
        return (names,)
    if not isinstance(names, Iterable):
        raise FamilyError(f"expected `{argument}` to be a list of names, found `{names}`")
    return tuple(names)

"""`frozen.dataclass` against that of the standard library: the same class, made by both."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError, field, replace
from typing import Any

import pytest

from thingc.base import frozen

Maker = Callable[..., Any]
MAKERS: dict[str, Maker] = {"ours": frozen.dataclass, "standard": dataclasses.dataclass}


def classes(maker: Maker) -> dict[str, type]:
    """A class with every kind of field, one derived from it, one without fields, one by position, and one compared by identity."""

    @maker(frozen=True, slots=True, kw_only=True)
    class Whole:
        """Documented."""

        name: str
        size: float = 1.5
        items: list[int] = field(default_factory=list)
        note: str = field(default="", compare=False)
        hidden: int = field(default=7, repr=False)
        found: dict[str, int] = field(default_factory=dict, init=False, compare=False)

        def __post_init__(self) -> None:
            if self.size < 0.0:
                raise ValueError("size")

    @maker(frozen=True, slots=True, kw_only=True)
    class Derived(Whole):
        """Documented."""

        more: int = 3

    @maker(frozen=True, slots=True)
    class Nothing:
        """Documented."""

    @maker(frozen=True, slots=True)
    class Pair:
        """Documented."""

        left: int
        right: int = 2

    @maker(frozen=True, slots=True, kw_only=True)
    class One:
        """Documented."""

        value: Any

    @maker(frozen=True, slots=True, kw_only=True, eq=False)
    class Alone:
        """Documented."""

        value: int

    return {one.__name__: one for one in (Whole, Derived, Nothing, Pair, One, Alone)}


OURS, STANDARD = classes(frozen.dataclass), classes(dataclasses.dataclass)

MADE: dict[str, Callable[[dict[str, type]], Any]] = {
    "defaults": lambda of: of["Whole"](name="a"),
    "all": lambda of: of["Whole"](name="a", size=2.0, items=[1], note="n", hidden=8),
    "derived": lambda of: of["Derived"](name="a", more=4),
    "replaced": lambda of: replace(of["Derived"](name="a", more=4), name="b"),
    "nothing": lambda of: of["Nothing"](),
    "by position": lambda of: of["Pair"](1, 5),
    "by name": lambda of: of["Pair"](left=1),
    "one": lambda of: of["One"](value=(1, 2)),
    "alone": lambda of: of["Alone"](value=1),
    "copied": lambda of: copy.deepcopy(of["Whole"](name="a", items=[1, 2])),
}
WRONG: dict[str, Callable[[dict[str, type]], Any]] = {
    "missing": lambda of: of["Whole"](),
    "unknown": lambda of: of["Whole"](name="a", nme="b"),
    "not by position": lambda of: of["Whole"]("a"),
    "no parameter": lambda of: of["Whole"](name="a", found={}),
    "after init": lambda of: of["Whole"](name="a", size=-1.0),
    "unhashable": lambda of: hash(of["Whole"](name="a")),
    "assigned": lambda of: setattr(of["Pair"](1), "left", 2),
    "deleted": lambda of: delattr(of["Pair"](1), "left"),
}


@pytest.mark.parametrize("case", MADE)
def test_instances_are_those_of_the_standard_library(case: str) -> None:
    ours, standard = MADE[case](OURS), MADE[case](STANDARD)
    assert repr(ours) == repr(standard)
    assert dataclasses.asdict(ours) == dataclasses.asdict(standard)
    assert type(ours).__slots__ == type(standard).__slots__ and not hasattr(ours, "__dict__")
    again, other = MADE[case](OURS), MADE[case](STANDARD)
    assert (ours == again, ours != again, ours == standard) == (standard == other, standard != other, False)


@pytest.mark.parametrize("case", WRONG)
def test_errors_are_those_of_the_standard_library(case: str) -> None:
    with pytest.raises(Exception) as standard:
        WRONG[case](STANDARD)
    with pytest.raises(type(standard.value)) as ours:
        WRONG[case](OURS)
    assert str(ours.value) == str(standard.value)


def test_hashes_are_of_what_is_compared() -> None:
    for name, values in {"Pair": {"left": 1}, "One": {"value": "x"}, "Nothing": {}}.items():
        assert hash(OURS[name](**values)) == hash(STANDARD[name](**values))
    assert OURS["Whole"](name="a", note="n") == OURS["Whole"](name="a", note="m")
    assert OURS["Whole"](name="a", size=1.0) != OURS["Whole"](name="a", size=2.0)


def test_defaults_are_made_for_each() -> None:
    first, second = OURS["Whole"](name="a"), OURS["Whole"](name="b")
    first.items.append(1)
    assert second.items == [] and second.found == {}


@frozen.dataclass(frozen=True, slots=True, kw_only=True)
class Sent:
    """What travels between processes."""

    name: str
    items: tuple[int, ...] = ()


def test_what_is_pickled_comes_back_and_stays_frozen() -> None:
    back = pickle.loads(pickle.dumps(Sent(name="a", items=(1, 2))))
    assert back == Sent(name="a", items=(1, 2))
    with pytest.raises(FrozenInstanceError):
        back.name = "b"

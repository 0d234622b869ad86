"""The cache for pure functions stores only the last result of each call site."""

from __future__ import annotations

from thingc.base import memo as module
from thingc.base.memo import Memo


def test_equal_inputs_give_the_same_object() -> None:
    memo, asked = Memo(), []

    def pair(*inputs: object) -> list[object]:
        asked.append(inputs)
        return list(inputs)

    first = memo("here", pair, 1, "a")
    assert memo("here", pair, 1, "a") is first and len(asked) == 1
    assert memo("there", pair, 1, "a") is not first, "another place knows nothing of it"
    assert memo("here", pair, 2, "a") == [2, "a"]
    again = memo("here", pair, 1, "a")
    assert again == first and again is not first, "only the last inputs are known"
    assert asked == [(1, "a"), (1, "a"), (2, "a"), (1, "a")]


def test_equal_results_are_the_same_object() -> None:
    memo = Memo()
    first = memo.same("here", (1.0, [2.0]))
    assert memo.same("here", (1.0, [2.0])) is first
    other = memo.same("here", (1.0, [3.0]))
    assert other is not first and memo.same("here", (1.0, [3.0])) is other


def test_results_can_be_stored_explicitly() -> None:
    memo = Memo()
    assert memo.last("here", (1,)) is None
    memo.keep("here", (1,), "one")
    assert memo.last("here", (1,)) == "one" and memo.last("here", (2,)) is None


def test_cache_is_bounded(monkeypatch) -> None:
    monkeypatch.setattr(module, "PLACES", 10)
    memo = Memo()
    for place in range(1000):
        memo(place, str, place)
    assert len(memo._entries) <= 10
    assert memo(999, str, 999) == "999"

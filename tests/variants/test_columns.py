"""Columns whose buffers are written directly equal those that pyarrow creates."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import pyarrow
import pytest

from thingc.batch import packed_layout

VALUES: dict[Any, Callable[[random.Random], Any]] = {
    pyarrow.int64(): lambda chance: chance.randrange(-2**63, 2**63),
    pyarrow.float64(): lambda chance: chance.choice([-0.0, 0.0, 7, 1.5, float("inf"), chance.random()]),
    pyarrow.bool_(): lambda chance: chance.random() < 0.5,
    pyarrow.string(): lambda chance: chance.choice(["", "a", "\u00e9\n", "\U0001f916"]),
    pyarrow.binary(): lambda chance: chance.choice([b"", b"\0x", bytes(300)]),
}


@pytest.mark.parametrize("type", VALUES, ids=str)
def test_column_equals_the_array_of_pyarrow(type: Any) -> None:
    chance = random.Random(1)
    for length in (0, 1, 7, 8, 9, 64, 65):
        for absent in (0.0, 0.3, 1.0):
            values = [None if chance.random() < absent else VALUES[type](chance) for _ in range(length)]
            found, wanted = packed_layout._column(values, type), pyarrow.array(values, type)
            found.validate(full=True)
            assert found.type == type and found.null_count == wanted.null_count and repr(found.to_pylist()) == repr(wanted.to_pylist())


def test_long_texts_use_pyarrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packed_layout, "LARGEST", 3)
    assert packed_layout._column(["ab", "cd", None], pyarrow.string()).to_pylist() == ["ab", "cd", None]
    with pytest.raises(TypeError):
        packed_layout._column([1.5], pyarrow.int64())

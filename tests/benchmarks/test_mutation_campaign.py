"""The mutants of the mutation campaign: every kind of change, none where a change means nothing, and each is Python."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "mutation"
SOURCE = '''\
"""A docstring: 1 + 1."""
from typing import TYPE_CHECKING, Literal
Kind = Literal["a", "b"]
if TYPE_CHECKING:
    LEFT = 1 + 1
def f(ä: tuple[int, str] = (), *, x: int) -> dict[str, int]:
    if not x:
        report.add(Code.X, f"{x + 1} of 2", help="a" + "b")
    y = ä + x; z = x * 0.5; seen.add(3)
    return min(y, z) if -x < y and x in (1, y) else (z, y)
'''
CHANGES = {
    (7, "not x", "x"), (9, "ä + x", "(ä - x)"), (9, "ä + x", "ä"), (9, "x * 0.5", "(x / 0.5)"), (9, "x * 0.5", "(-(x * 0.5))"),
    (9, "0.5", "1.0"), (9, "3", "4"), (10, "min(y, z)", "max(y, z)"), (10, "-x < y", "(-x <= y)"), (10, "-x", "x"), (10, "1", "2"),
    (10, "-x < y and x in (1, y)", "(-x < y or x in (1, y))"), (10, "-x < y and x in (1, y)", "(-x < y)"),
    (10, "-x < y and x in (1, y)", "(x in (1, y))"), (10, "x in (1, y)", "(x not in (1, y))"), (10, "(z, y)", "(y, z)"),
    (10, "min(y, z) if -x < y and x in (1, y) else (z, y)", "((z, y) if -x < y and x in (1, y) else min(y, z))"),
}


def test_mutants_of_a_module(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(FOLDER))
    from mutants import mutants

    found = list(mutants("m.py", SOURCE))
    assert sorted((one.line, one.old, one.new) for one in found) == sorted(CHANGES)
    before = SOURCE.splitlines()
    for one in found:
        ast.parse(one.text)
        assert [k for k, (a, b) in enumerate(zip(before, one.text.splitlines(), strict=True), 1) if a != b] == [one.line]

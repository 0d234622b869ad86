"""The findings of checkers in `make conformance`, including URDF files that a reader misinterprets."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "conformance"
ROBOT = """\
<robot name="r">
  <link name="base"><inertial><mass value="2"/></inertial></link>
  <link name="tip"><inertial><mass value="1"/></inertial></link>
  <joint name="turn" type="revolute"/>
  <joint name="hold" type="fixed"/>
</robot>
"""


@pytest.fixture(autouse=True)
def on_path(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.syspath_prepend(str(FOLDER))
    yield
    for name in ("checkers", "findings"):
        sys.modules.pop(name, None)


def test_explained_findings_do_not_count() -> None:
    from checkers import Checker, Verdict, row

    checker, verdict = Checker("lint", ("URDF",), ("lint==1",), explained={"^W1:": "It is meant."}), Verdict("1")
    verdict.add(checker, "a", [("warning", "W1: x"), ("warning", "W2: x"), ("error", "E1: y"), ("info", "I1: z")])
    verdict.add(checker, "b", [("warning", "not W1: x")])
    assert row(checker, "URDF", verdict) == "| lint | URDF | 1 | 2 | 1 | 2 | 1 |"
    assert "python -m pip install lint==1" in row(checker, "URDF", None)


def test_partial_run_keeps_the_rows_of_other_checkers() -> None:
    from checkers import CHECKERS, page

    before = "| usdchecker | USD | 1 | 2 | 0 | 0 | 0 |\n| yourdfpy | URDF | 1 | 2 | 3 | 0 | 0 |\n| removed | USD | 1 | 2 | 0 | 0 | 0 |\n"
    text = page(["| yourdfpy | URDF | 2 | 4 | 0 | 0 | 0 |"], before)
    assert [line for line in text.splitlines() if line.startswith(("| u", "| y", "| r"))] == [
        "| usdchecker | USD | 1 | 2 | 0 | 0 | 0 |", "| yourdfpy | URDF | 2 | 4 | 0 | 0 | 0 |",
    ]
    assert page([], text) == text and len({checker.name for checker in CHECKERS}) == len(CHECKERS)


def test_misread_files_and_output_of_readers_are_findings(tmp_path: Path) -> None:
    from findings import checked, differences

    file = tmp_path / "r.urdf"
    file.write_text(ROBOT)
    assert list(differences(str(file), links=["base", "tip"], joints=["turn"], mass=3.0)) == []
    read = [[*differences(str(file), **wrong)] for wrong in ({"links": ["base"]}, {"joints": ["turn", "hold"]}, {"mass": 4.0})]
    assert [level for found in read for level, _ in found] == ["error"] * 3

    def reader(path: str) -> Iterator[tuple[str, str]]:
        os.write(1, b"loud\n")  # as a library in C++ does
        warnings.warn("odd", stacklevel=1)
        yield "error", path

    assert checked(reader, "f") == [("error", "f"), ("warning", "loud"), ("warning", "odd")]

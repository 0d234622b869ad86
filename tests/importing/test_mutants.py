"""Files with one random mistake each cause no traceback, and errors are reported near the mistake. `benchmarks/importing/slips.py` runs
more of them."""

from __future__ import annotations

import random
import runpy
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BENCH = runpy.run_path(str(ROOT / "benchmarks" / "importing" / "slips.py"))
ROBOTS = BENCH["robots_in"](Path(__file__).parent / "robots")


def test_errors_are_reported_near_the_mistake() -> None:
    found, odd = BENCH["tried"](ROBOTS, 200, 5)
    assert found["raised"] == 0 and found["refused"] > 100, odd
    assert found["near"] >= 0.95 * found["refused"], odd


def test_every_mutation_changes_some_line() -> None:
    lines = [line for robot in ROBOTS for line in robot.read_text().split("\n")]
    for name, slip in BENCH["SLIPS"].items():
        assert any(slip(line, random.Random(1)) != line for line in lines), name

"""The study of invalid documents: its page meets the criteria. `tests/cases/test_mutants.py` judges some mutants."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_page_contains_a_complete_and_sufficient_run() -> None:
    page = (ROOT / "docs" / "studies" / "mutants.md").read_text()
    assert page.startswith((ROOT / "benchmarks" / "mutants" / "page.md").read_text())
    found = re.search(r"make mutants\n```\n\n(\d+) mutants: (\d+) refused .* (\d+) refused mutants ", page)
    assert found is not None
    every, refused, right = map(int, found.groups())
    assert every >= 2000 and refused >= 0.8 * every and right >= 0.95 * refused

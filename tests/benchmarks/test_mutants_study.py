"""The study of invalid documents: its criteria, and a short run of it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_few_mutants_are_accepted_and_errors_have_the_right_line(shared_store: str) -> None:
    done = subprocess.run(
        [
            sys.executable, ROOT / "benchmarks/mutants/study.py", "--count", "40", "--seed", "5", "--jobs", "1", "--store", shared_store,
            "--print",
        ],
        capture_output=True, text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"(\d+) mutants: (\d+) refused .* (\d+) accepted.* (\d+) refused mutants .* right line", done.stdout)
    assert found is not None, done.stdout
    every, refused, accepted, right = map(int, found.groups())
    assert every >= 40 and refused + accepted == every
    assert refused >= 0.8 * every and right >= 0.95 * refused


def test_page_contains_a_complete_and_sufficient_run() -> None:
    page = (ROOT / "docs" / "studies" / "mutants.md").read_text()
    assert page.startswith((ROOT / "benchmarks" / "mutants" / "page.md").read_text())
    found = re.search(r"make mutants\n```\n\n(\d+) mutants: (\d+) refused .* (\d+) refused mutants ", page)
    assert found is not None
    every, refused, right = map(int, found.groups())
    assert every >= 2000 and refused >= 0.8 * every and right >= 0.95 * refused

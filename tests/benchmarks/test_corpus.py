"""The corpus of outputs is reproducible, and a changed byte is detected."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ENTRY = "codes/TC618"
"""A robot without build123d parts."""


def asked(program: str, *words: object) -> str:
    """Return the output of a program that uses `corpus`."""
    command = [sys.executable, "-c", f"import json, sys, corpus\n{program}", *map(str, words)]
    return subprocess.run(command, cwd=ROOT / "benchmarks", capture_output=True, text=True, check=True).stdout


CHANGE = """
kept, words = sys.argv[1], sys.argv[2:]
sys.argv[1:] = "freeze", kept, *words
corpus.main()
with open(kept) as stream:
    (entry,) = (entries := json.load(stream)).values()
assert entry["exit"] == "0"
name = next(path for path in entry if path.endswith(".xml"))
entry[name] = "0" * 64
with open(kept, "w") as stream:
    json.dump(entries, stream)
sys.argv[1:] = "compare", kept, *words
print(name, corpus.main())
"""


def test_comparison_finds_exactly_the_changed_file(tmp_path: Path, shared_store: str) -> None:
    """Only the changed file is reported, so all others are equal."""
    first, *said, last = asked(CHANGE, tmp_path / "corpus.json", "--store", shared_store, "--only", ENTRY).splitlines()
    name, code = last.split()
    assert first.startswith("1 entries, ") and said == [f"{ENTRY}: {name}", "1 entries: 1 x .xml differ"] and code == "1"


def test_equal_corpora_are_reported() -> None:
    one = {"docs/things.md": {"exit": "0", "a.xml": "0" * 64}}
    assert asked(f"print(corpus.compared({one}, {one}))") == "1 entries: all equal\n0\n"


def test_entries_of_a_page_are_selected_by_its_name() -> None:
    patterns = {"docs/things.md": True, "*": True, "docs/*": True, "docs/thing": False}
    said = asked(f"print([corpus.fits('docs/things.md/rack.yaml', [one]) for one in {list(patterns)}])")
    assert said == f"{list(patterns.values())}\n"

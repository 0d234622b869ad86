"""The corpus of outputs is reproducible, and a changed byte is detected."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ENTRY = "codes/TC618"
"""A robot without build123d parts."""


def corpus(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, ROOT / "benchmarks/corpus.py", *words, "--only", ENTRY]
    return subprocess.run([str(word) for word in command], capture_output=True, text=True)


def asked(program: str) -> str:
    """Return the output of a program that uses `corpus`."""
    command = [sys.executable, "-c", f"import corpus; {program}"]
    return subprocess.run(command, cwd=ROOT / "benchmarks", capture_output=True, text=True, check=True).stdout


def test_comparison_finds_exactly_the_changed_file(tmp_path: Path, shared_store: str) -> None:
    """Only the changed file is reported, so all others are equal."""
    kept = tmp_path / "corpus.json"
    first = corpus("freeze", kept, "--store", shared_store)
    assert first.returncode == 0 and first.stdout.startswith("1 entries, "), first.stderr
    entries = json.loads(kept.read_text())
    (entry,) = entries.values()
    assert entry["exit"] == "0"
    name = next(path for path in entry if path.endswith(".xml"))
    entry[name] = "0" * 64
    kept.write_text(json.dumps(entries))
    changed = corpus("compare", kept, "--store", shared_store)
    assert changed.returncode == 1 and changed.stdout == f"{ENTRY}: {name}\n1 entries: 1 x .xml differ\n"


def test_equal_corpora_are_reported() -> None:
    one = {"docs/things.md": {"exit": "0", "a.xml": "0" * 64}}
    assert asked(f"print(corpus.compared({one}, {one}))") == "1 entries: all equal\n0\n"


def test_entries_of_a_page_are_selected_by_its_name() -> None:
    patterns = {"docs/things.md": True, "*": True, "docs/*": True, "docs/thing": False}
    said = asked(f"print([corpus.fits('docs/things.md/rack.yaml', [one]) for one in {list(patterns)}])")
    assert said == f"{list(patterns.values())}\n"

"""The edits of `make bench` apply to the current robots."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def test_every_edit_changes_the_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each edit finds exactly one place, and never repeats an earlier text."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    monkeypatch.delitem(sys.modules, "run", raising=False)
    import run  # type: ignore[import-not-found]

    workspace = run.Workspace(tmp_path)
    files = [path for folder in ("assemblies", "parts") for path in (tmp_path / folder).rglob("*.*") if path.is_file()]
    seen: set[tuple[bytes, ...]] = set()
    saves = run.saves(workspace)
    for saved in [*saves, *saves]:
        saved.save()
        seen.add(tuple(path.read_bytes() for path in files))
    assert len(seen) == 2 * len(saves) == 8

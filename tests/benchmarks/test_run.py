"""The edits of `make bench` find their places in the robots as they are."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def test_every_save_is_another_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each finds the one place that it edits, and never says what was said before."""
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

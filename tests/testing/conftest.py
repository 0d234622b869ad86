"""Fixtures for the tests of `thingc test`."""

from __future__ import annotations

from pathlib import Path

import pytest

from testing.rig import Workspace


@pytest.fixture
def rig(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    """Return a workspace of plain parts."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    return Workspace(tmp_path / "workspace")

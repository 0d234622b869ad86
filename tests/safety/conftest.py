"""A workspace with the robots of the repository, and a lock file for it."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))
from harness import ran


@pytest.fixture(scope="session")
def locked(tmp_path_factory: pytest.TempPathFactory, root: Path, shared_store: str) -> Path:
    """Return a folder with the arm, MInchW and `parts.lock.json`. Tests must copy it instead of changing it."""
    folder = tmp_path_factory.mktemp("locked") / "workspace"
    folder.mkdir()
    ignored = shutil.ignore_patterns("__pycache__", "thingc_stock")
    for name in ("assemblies", "parts"):
        shutil.copytree(root / name, folder / name, ignore=ignored)
    shutil.copy(root / "thingc.toml", folder)
    made = ran(["lock", "--store", shared_store], folder)
    assert made.code == 0, made
    return folder


@pytest.fixture
def workspace(locked: Path, tmp_path: Path) -> Path:
    """Return a copy of `locked` for one test."""
    folder = tmp_path / "workspace"
    shutil.copytree(locked, folder)
    return folder

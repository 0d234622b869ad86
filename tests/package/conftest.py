from __future__ import annotations

from pathlib import Path

import pytest

from conformance.harness import once
from package.installed import ROOT, Installed, build, install, installed_in


@pytest.fixture(scope="session")
def dist(shared_store: str) -> Path:
    """A folder that contains the wheel and the sdist."""
    folder = Path(shared_store).parent / "packages"
    return once(folder, lambda: build(ROOT, folder / "dist")) / "dist"


@pytest.fixture(scope="session")
def installed(dist: Path, shared_store: str) -> Installed:
    """An environment in which the wheel is installed, one for all test processes, so that its modules are compiled once."""
    (wheel,) = dist.glob("*.whl")
    folder = Path(shared_store).parent / "installed"
    return installed_in(once(folder, lambda: install(folder / "venv", wheel)) / "venv", shared_store)

from __future__ import annotations

from pathlib import Path

import pytest

from conformance.harness import once
from package.installed import ROOT, build


@pytest.fixture(scope="session")
def dist(shared_store: str) -> Path:
    """A folder that contains the wheel and the sdist."""
    folder = Path(shared_store).parent / "packages"
    return once(folder, lambda: build(ROOT, folder / "dist")) / "dist"

"""The arm, built once per run by the command line into a folder that all tests read."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

import pytest

from conformance.harness import ROOT, build_here

ARM = "assemblies/arm.yaml"


@pytest.fixture(scope="session")
def arm(shared_store: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder `arm` of a build of everything; one of several test processes builds, the others wait."""
    base = tmp_path_factory.getbasetemp()
    if os.environ.get("PYTEST_XDIST_WORKER"):
        base = base.parent
    folder = base / "conformance"
    with open(base / "conformance.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "arm" / "manifest.json").exists():
            build_here(ARM, "-o", folder, store=shared_store, cwd=ROOT)
    return folder / "arm"

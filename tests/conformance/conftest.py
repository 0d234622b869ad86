"""The arm, built once per run by the command line into a folder that all tests read."""

from __future__ import annotations

from pathlib import Path

import pytest

from conformance.harness import built

ARM = "assemblies/arm.yaml"


@pytest.fixture(scope="session")
def arm(shared_store: str) -> Path:
    """The folder `arm` of a build without `--emit`."""
    return built(ARM, shared_store)

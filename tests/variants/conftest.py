"""Batches that several tests load. Each batch is built once: one test process builds it, and the others wait."""

from __future__ import annotations

import fcntl
from pathlib import Path

import pytest

from variants.families import built


def once(store: str, name: str) -> Path:
    """Return the folder of the batch with this name."""
    folder = Path(store).parent / "batches" / name
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        kept = folder / "place"
        if not kept.exists():
            kept.write_text(str(built(folder, store, name)))
        return Path(kept.read_text())


@pytest.fixture(scope="session")
def some(shared_store: str) -> Path:
    """Twelve pendulums. A rule on parameters excludes one of them, and a rule on results excludes three."""
    return once(shared_store, "some")


@pytest.fixture(scope="session")
def arms(shared_store: str) -> Path:
    """Two arms, of which one has an additional joint."""
    return once(shared_store, "arms")


@pytest.fixture(scope="session")
def boards(shared_store: str) -> Path:
    """Three boards of different sizes with the same mast."""
    return once(shared_store, "boards")


@pytest.fixture(scope="session")
def sliders(shared_store: str) -> Path:
    """Eight masses on slides, which fall on a floor: contacts, limits, meshes and boxes."""
    return once(shared_store, "sliders")

"""Batches that several tests load, built once; one of several test processes builds, the others wait."""

from __future__ import annotations

import fcntl
from pathlib import Path

import pytest

from variants.families import built


def once(store: str, name: str) -> Path:
    """The folder of the batch of this name."""
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
    """Twelve pendulums, of which one is kept out by a rule on parameters and three by one on results."""
    return once(shared_store, "some")


@pytest.fixture(scope="session")
def arms(shared_store: str) -> Path:
    """Two arms, one with a joint more."""
    return once(shared_store, "arms")


@pytest.fixture(scope="session")
def boards(shared_store: str) -> Path:
    """Three boards of different size, with a mast that is the same."""
    return once(shared_store, "boards")


@pytest.fixture(scope="session")
def sliders(shared_store: str) -> Path:
    """Eight masses on a slide, which fall on a floor: contacts, limits, meshes and boxes."""
    return once(shared_store, "sliders")

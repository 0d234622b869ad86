"""Batches that several tests load, built once."""

from __future__ import annotations

from pathlib import Path

import pytest

from variants.families import built


@pytest.fixture(scope="session")
def some(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Path:
    """Twelve pendulums, of which one is kept out by a rule on parameters and three by one on results."""
    return built(tmp_path_factory.mktemp("some"), shared_store, "some")


@pytest.fixture(scope="session")
def arms(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Path:
    """Two arms, one with a joint more."""
    return built(tmp_path_factory.mktemp("arms"), shared_store, "arms")


@pytest.fixture(scope="session")
def boards(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Path:
    """Three boards of different size, with a mast that is the same."""
    return built(tmp_path_factory.mktemp("boards"), shared_store, "boards")


@pytest.fixture(scope="session")
def sliders(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Path:
    """Eight masses on a slide, which fall on a floor: contacts, limits, meshes and boxes."""
    return built(tmp_path_factory.mktemp("sliders"), shared_store, "sliders")

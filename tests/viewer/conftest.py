"""The pages of the arm and of MInchW, built once, and one browser context for all tests of a file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from conformance.harness import with_all_formats
from viewer.browser import chromium


@dataclass(frozen=True)
class Pages:
    """The build folder of each robot."""

    arm: Path
    minchw: Path


@pytest.fixture(scope="session")
def pages(shared_store: str) -> Pages:
    return Pages(*(with_all_formats(f"assemblies/{name}.yaml", shared_store) for name in ("arm", "minchw/minchw")))


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as steered:
        context = steered.new_context()
        context.new_page()  # with the last page of a context its process would end
        yield context

"""The pages of the arm and of MInchW, built once, and one context of a browser for all tests of a file."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from conformance.harness import ROOT, build_here
from viewer.browser import chromium


@dataclass(frozen=True)
class Pages:
    """The build folder of each robot."""

    arm: Path
    minchw: Path


@pytest.fixture(scope="session")
def pages(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Pages:
    folder = Path(shared_store).parent / "pages"
    folder.mkdir(exist_ok=True)
    built = Pages(arm=folder / "arm", minchw=folder / "minchw")
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for document, out in (("assemblies/arm.yaml", built.arm), ("assemblies/minchw/minchw.yaml", built.minchw)):
            if not out.exists():
                build_here(document, "--output", folder, "--emit", "html,mjcf", store=shared_store, cwd=ROOT)
    return built


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as steered:
        context = steered.new_context()
        context.new_page()  # with the last page of a context its process would end
        yield context

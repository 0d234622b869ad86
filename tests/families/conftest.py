from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import thingc
from families.documents import WORKSPACE


@pytest.fixture(scope="session")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("families")
    for name, text in WORKSPACE.items():
        (folder / name).write_text(text)
    return folder


@pytest.fixture(scope="session")
def everything(workspace: Path) -> Iterator[thingc.RobotFamily]:
    with thingc.family(workspace / "everything.yaml", verify=0) as family:
        yield family


@pytest.fixture(scope="session")
def strung(workspace: Path) -> Iterator[thingc.RobotFamily]:
    with thingc.family(workspace / "strung.yaml", verify=0) as family:
        yield family


@pytest.fixture(scope="session")
def many(workspace: Path) -> Iterator[thingc.RobotFamily]:
    with thingc.family(workspace / "many.yaml") as family:
        yield family

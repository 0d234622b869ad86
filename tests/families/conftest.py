from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import thingc
from families.documents import EVERYTHING, MANY, TOOL


@pytest.fixture(scope="package")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("families")
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (folder / "everything.yaml").write_text(EVERYTHING)
    (folder / "tool.yaml").write_text(TOOL)
    (folder / "many.yaml").write_text(MANY)
    return folder


@pytest.fixture(scope="package")
def everything(workspace: Path) -> Iterator[thingc.RobotFamily]:
    with thingc.family(workspace / "everything.yaml", verify=0) as family:
        yield family


@pytest.fixture(scope="package")
def many(workspace: Path) -> Iterator[thingc.RobotFamily]:
    with thingc.family(workspace / "many.yaml") as family:
        yield family

"""Small workspaces with parts, one worker pool for all tests of a process, and helpers that create part definitions."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from thingc.documents.workspace import DEFAULT_MESH, DEFAULT_SIMULATION, Workspace
from thingc.geometry import client
from thingc.geometry.client import Workers
from thingc.geometry.record import PartDefinition, Value, definition_text
from thingc.geometry.service import GeometryService
from thingc.geometry.store.local import Store
from thingc.geometry.worker.lazy_build123d import import_cheaply

import_cheaply("build123d")  # modules of tests use it, and a worker imports it in the same way, in half of the time

TIMEOUT = 60.0


@dataclass
class Place:
    """A workspace in its own folder, with a store next to it."""

    root: Path
    store: Store
    workers: Workers
    parts: Path = field(init=False)

    def __post_init__(self) -> None:
        self.parts = self.root / "parts"
        self.parts.mkdir(parents=True, exist_ok=True)

    @property
    def workspace(self) -> Workspace:
        """Return the workspace, with a tessellation of 0.1 mm and 10 deg."""
        return Workspace(
            root=str(self.root), parts=(str(self.parts),), packages=("thingc_stock", "bd_warehouse"),
            build=str(self.root / "build"), part_timeout=TIMEOUT, mesh=DEFAULT_MESH, simulation=DEFAULT_SIMULATION,
        )

    def write(self, name: str, text: str) -> Path:
        """Write a dedented file into the workspace."""
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text))
        return path

    def service(self, timeout: float = TIMEOUT, **options: object) -> GeometryService:
        """Return a service as in a new process: its only state is the store."""
        options.setdefault("workers", self.workers)
        return GeometryService(self.workspace, self.store, 2, timeout, **options)  # type: ignore[arg-type]


def part(reference: str, **parameters: Value) -> PartDefinition:
    """Return the definition of a code part; the parameters are in SI units."""
    return PartDefinition(
        reference=reference, kind="code", parameters=tuple(sorted(parameters.items())),
        text=definition_text(reference, parameters, {}), label=reference,
    )


def modelled_parts(service: GeometryService) -> list[str]:
    """Return the definition texts of the parts that the last `realize` built, in the order in which they were finished."""
    return [text for text, decision in service.decisions.items() if not decision.reused]


def file_part(path: str) -> PartDefinition:
    """Return the definition of a `file:` part."""
    return PartDefinition(reference=path, kind="file", parameters=(), text=path, label=path)


@pytest.fixture(scope="session")
def workers() -> Workers:
    """Return the forking worker pool that all tests of this process share."""
    return client.Workers(2)


@pytest.fixture
def place(tmp_path: Path, workers: Workers) -> Place:
    """Return an empty workspace with an empty store."""
    return Place(root=tmp_path / "ws", store=Store(str(tmp_path / "store")), workers=workers)


@pytest.fixture(scope="module")
def module_place(tmp_path_factory: pytest.TempPathFactory, workers: Workers) -> Place:
    """Return a workspace and a store that all tests of a module share."""
    base = tmp_path_factory.mktemp("realize")
    return Place(root=base / "ws", store=Store(str(base / "store")), workers=workers)


@pytest.fixture(scope="session")
def define() -> Callable[..., PartDefinition]:
    """Return the function `part`."""
    return part


@pytest.fixture(scope="session")
def define_file() -> Callable[[str], PartDefinition]:
    """Return the function `file_part`."""
    return file_part

"""Several processes with one store. If two processes need the same part, it is built once, and processes do not wait for a process that
has ended."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from thingc.base.diagnostics import Report
from thingc.documents.workspace import Workspace
from thingc.geometry.client import ABSENT, NoWorkers
from thingc.geometry.record import PartDefinition, PartFailure
from thingc.geometry.service import GeometryService
from thingc.geometry.store import build_locks
from thingc.geometry.store.build_locks import BuildLocks
from thingc.geometry.store.local import Store

PARTS = """
    import time
    from build123d import Box
    from thingc import Length, Thing

    class Block(Thing):
        def __init__(self, width: Length = 30):
            super().__init__()
            time.sleep(0.3)
            self.body = Box(width, 10, 5)

        def result(self):
            return self.body

    class Endless(Block):
        def __init__(self, width: Length = 30):
            time.sleep(600)
"""

CLIENT = """
import json, sys
from thingc.geometry.client import Workers
from thingc.geometry.record import PartDefinition, PartRecord
from thingc.geometry.service import GeometryService
from thingc.geometry.store.local import Store
from thingc.documents.workspace import DEFAULT_MESH, DEFAULT_SIMULATION, Workspace

root, part = sys.argv[1:]
workspace = Workspace(
    root=root, parts=(root + "/parts",), packages=("thingc_stock",), build=root + "/build", part_timeout=60.0,
    mesh=DEFAULT_MESH, simulation=DEFAULT_SIMULATION,
)
workers = Workers(1)
workers.warm()
def block(width):
    text = f"blocks:{part}(width={width})"
    return PartDefinition(reference=f"blocks:{part}", kind="code", parameters=(("width", width),), text=text, label=text)
for line in sys.stdin:
    store, first, last = json.loads(line)
    with GeometryService(workspace, Store(store), 1, 60.0, workers=workers) as service:
        found = service.realize([block(k / 1000) for k in range(first, last, 1 if first <= last else -1)])
    print(json.dumps({
        "modelled": [text for text, one in service.decisions.items() if not one.reused],
        "reused": [text for text, one in service.decisions.items() if one.reused],
        "records": {text: repr(record) for text, record in found.items()},
        "sound": all(isinstance(record, PartRecord) for record in found.values()),
    }), flush=True)
workers.close()
"""


class Client:
    """A process with its own CAD kernel. After each line that it reads, it builds blocks with sizes from `first` to `last` mm."""

    def __init__(self, folder: Path, part: str) -> None:
        arguments = [sys.executable, "-c", CLIENT, str(folder), part]
        self.process = subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def go(self, store: Path, first: int, last: int) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps([str(store), first, last]) + "\n")
        self.process.stdin.flush()

    def answer(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        found: dict[str, Any] = json.loads(self.process.stdout.readline())
        assert found["sound"]
        return found


def workspace(folder: Path) -> Path:
    """Create a workspace whose parts take long to build."""
    folder.joinpath("parts").mkdir()
    folder.joinpath("parts/blocks.py").write_text(textwrap.dedent(PARTS))
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return workspace(tmp_path)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Client, Client]]:
    """Two processes, which load the kernel once for all tests."""
    folder = workspace(tmp_path_factory.mktemp("both"))
    clients = Client(folder, "Block"), Client(folder, "Block")
    yield clients
    for client in clients:
        client.process.communicate(timeout=60)


def test_each_part_is_built_by_one_process(both: tuple[Client, Client], tmp_path: Path) -> None:
    """One process starts with the smallest block, and the other one with the largest block. In the middle, each process needs parts that
    the other process has begun."""
    for client, first, last in zip(both, (10, 19), (20, 9), strict=True):
        client.go(tmp_path / "store", first, last)
    one, other = (client.answer() for client in both)
    assert len(one["modelled"]) + len(other["modelled"]) == 10
    assert set(one["modelled"]).isdisjoint(other["modelled"])
    assert one["modelled"] and other["modelled"], "they share the work"
    assert len(one["reused"]) == 10 - len(one["modelled"])
    assert one["records"] == other["records"]


def test_no_process_waits_for_a_killed_process(folder: Path) -> None:
    store = Store(str(folder / "store"))
    store.check()
    first = Client(folder, "Endless")
    first.go(folder / "store", 10, 11)
    own = BuildLocks(store)
    key = _key_under_way(folder)
    assert not own.take(key), "somebody is at it"
    os.kill(first.process.pid, signal.SIGKILL)
    first.process.wait()
    start = time.monotonic()
    assert own.wait(key, 20.0)
    assert time.monotonic() - start < 5.0
    own.close()


def _key_under_way(folder: Path) -> str:
    """Return the build key of the endless part, computed as in a geometry service."""
    from thingc.documents.workspace import DEFAULT_MESH, DEFAULT_SIMULATION, Workspace
    from thingc.geometry.record import PartDefinition, PartFailure
    from thingc.geometry.service import GeometryService

    workspace = Workspace(
        root=str(folder), parts=(str(folder / "parts"),), packages=("thingc_stock",), build=str(folder / "build"), part_timeout=60.0,
        mesh=DEFAULT_MESH, simulation=DEFAULT_SIMULATION,
    )
    definition = PartDefinition(
        reference="blocks:Endless", kind="code", parameters=(("width", 0.01),), text="blocks:Endless(width=0.01)", label="blocks:Endless",
    )
    with GeometryService(workspace, Store(str(folder / "store")), 1, 60.0) as service:
        prepared = service._requests.prepare(definition)
    assert not isinstance(prepared, PartFailure)
    key = prepared.build_key.key
    deadline = time.monotonic() + 30.0
    probe = BuildLocks(service.store)
    while probe.take(key):
        probe.give_back(key)
        assert time.monotonic() < deadline, "it was never claimed"
        time.sleep(0.02)
    probe.close()
    return key


def test_without_locks_both_processes_build_equal_parts(both: tuple[Client, Client], tmp_path: Path) -> None:
    """A lock file that cannot be opened (here, a folder has its name) does not prevent builds."""
    (tmp_path / "store" / build_locks.FILE).mkdir(parents=True)
    for client in both:
        client.go(tmp_path / "store", 10, 12)
    one, other = (client.answer() for client in both)
    assert one["records"] == other["records"]
    assert len(one["modelled"]) + len(other["modelled"]) >= 2


def test_only_one_process_can_claim_a_part(tmp_path: Path) -> None:
    """Another process cannot claim the part before it is released. It can claim other keys."""
    store = Store(str(tmp_path / "store"))
    own = BuildLocks(store)
    program = (
        "import sys; from thingc.geometry.store.build_locks import BuildLocks; from thingc.geometry.store.local import Store\n"
        "print(BuildLocks(Store(sys.argv[1])).take(sys.argv[2]))"
    )

    def other_takes(key: str) -> str:
        return subprocess.run(
            [sys.executable, "-c", program, store.root, key], capture_output=True, text=True, check=True,
        ).stdout.strip()

    one, two = "0f" * 32, "f0" * 32
    assert own.take(one)
    assert (other_takes(one), other_takes(two)) == ("False", "True")
    own.give_back(one)
    assert other_takes(one) == "True"
    assert own.wait(one, 0.0)
    own.close()
    assert other_takes(one) == "True"


def test_a_service_without_workers_does_not_wait(folder: Path) -> None:
    """Without workers, the failure is immediate if a part is not in the store, even if another process builds the part."""
    (folder / "store").mkdir(exist_ok=True)
    program = "import fcntl, sys; f = open(sys.argv[1], 'w'); fcntl.lockf(f, fcntl.LOCK_EX); print('ready', flush=True); input()"
    holding = subprocess.Popen(
        [sys.executable, "-c", program, str(folder / "store" / build_locks.FILE)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )
    assert holding.stdout is not None and holding.stdout.readline() == "ready\n"
    block = PartDefinition(reference="blocks:Block", kind="code", parameters=(("width", 0.02),), text="b", label="b")
    (folder / "robot.yaml").write_text("")
    workspace = Workspace.find(str(folder / "robot.yaml"), Report())
    assert workspace is not None
    began = time.monotonic()
    with GeometryService(workspace, Store(str(folder / "store")), 1, 60.0, workers=NoWorkers()) as service:
        answer = service.realize([block])["b"]
    assert isinstance(answer, PartFailure) and answer.kind == ABSENT
    assert time.monotonic() - began < 20.0
    holding.communicate("\n")

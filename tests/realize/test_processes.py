"""Processes: the client imports nothing heavy, no process survives it, several clients share a store, and damaged blobs are repaired."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import psutil
import pytest

from realize.conftest import modelled_parts
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import read
from thingc.geometry.client import Workers
from thingc.geometry.record import PartRecord
from thingc.geometry.service import GeometryService

PARTS = """
    from build123d import *
    from thingc import Length, Thing

    class Block(Thing):
        def __init__(self, width: Length = 30):
            super().__init__()
            self.body = Box(width, 10, 5)

        def result(self):
            return self.body

    class Slow(Thing):
        def result(self):
            import subprocess, sys
            import os
            subprocess.run([sys.executable, "-c", "import time; time.sleep(600)  # " + os.getcwd()])
"""

CLIENT = """
import json, sys
from thingc.base.pose import Pose
from thingc.geometry.record import PartDefinition, PartRecord, Placed
from thingc.geometry.service import GeometryService
from thingc.geometry.store.local import Store
from thingc.documents.workspace import DEFAULT_MESH, DEFAULT_SIMULATION, Workspace

root, store, command = sys.argv[1:4]
workspace = Workspace(
    root=root, parts=(root + "/parts",), packages=("thingc_stock", "bd_warehouse"), build=root + "/build", part_timeout=60.0,
    mesh=DEFAULT_MESH, simulation=DEFAULT_SIMULATION,
)
def block(width):
    text = f"parts_:Block(width={width})"
    return PartDefinition(reference="parts_:Block", kind="code", parameters=(("width", width),), text=text, label=text)
with GeometryService(workspace, Store(store), 2, 60.0) as service:
    if command == "hang":
        service.warm()
        print("started", flush=True)
        slow = PartDefinition(reference="parts_:Slow", kind="code", parameters=(), text="parts_:Slow", label="parts_:Slow")
        service.realize([slow, slow])
    schemas = service.describe(["parts_:Block"])
    found = service.realize([block(0.01 + k / 1000) for k in range(6)])
    assert all(isinstance(record, PartRecord) for record in found.values()), found
    placed = [
        Placed(path=text, definition=text, brep=record.brep, pose=Pose(), color="#ff0000") for text, record in found.items()
    ]
    step = service.assemble("robot", placed)()
heavy = ("OCP", "build123d", "numpy", "networkx", "trimesh", "mujoco", "pydantic", "rich", "typer", "asyncio")
print(json.dumps({
    "modelled": [text for text, one in service.decisions.items() if not one.reused],
    "reused": [text for text, one in service.decisions.items() if one.reused],
    "step": step.sha256,
    "heavy": [name for name in heavy if name in sys.modules], "processes": "subprocess" in sys.modules,
    "records": {text: repr(record) for text, record in found.items()},
}))
"""


@pytest.fixture
def client(place: Any) -> Callable[..., subprocess.Popen[str]]:
    """Return a function that starts a process that uses the service on this workspace and store."""
    place.write("parts/parts_.py", PARTS)

    def start(command: str = "all") -> subprocess.Popen[str]:
        arguments = [sys.executable, "-c", CLIENT, str(place.root), place.store.root, command]
        return subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)

    return start


def answer(process: subprocess.Popen[str]) -> dict[str, Any]:
    out, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    found: dict[str, Any] = json.loads(out)
    return found


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
def test_forked_child_uses_its_own_workers(tmp_path: Path, workers: Workers) -> None:
    """A child that sends requests starts its own worker and stops no other: two processes that read one pipe would wait for each other."""
    request = {"op": "decompose", "mesh": "0" * 64, "most": 0, "store": str(tmp_path), "timeout": 60.0}
    ((_, said),) = workers.run([request])
    (worker,) = workers._processes
    child = os.fork()
    if child == 0:
        status = 1
        try:
            ((_, again),) = workers.run([request])
            (own,) = workers._processes
            workers.close()
            status = 0 if again["failed"] == said["failed"] and own.process.pid != worker.process.pid else 2
        finally:
            os._exit(status)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    ((_, again),) = workers.run([request])
    assert again["failed"] == said["failed"] == "crashed" and workers._processes == [worker]


def descendants(process: psutil.Process) -> list[psutil.Process]:
    try:
        return process.children(recursive=True)
    except psutil.Error:
        return []


def gone(processes: list[psutil.Process], within: float) -> list[psutil.Process]:
    return [process for process in psutil.wait_procs(processes, timeout=within)[1] if process.status() != psutil.STATUS_ZOMBIE]


def test_two_clients_share_a_store_and_leave_no_process(client: Callable[..., Any]) -> None:
    both = [client(), client()]
    seen: dict[int, psutil.Process] = {}
    while running := [process for process in both if process.poll() is None]:
        for child in (child for process in running for child in descendants(psutil.Process(process.pid))):
            seen.setdefault(child.pid, child)
        time.sleep(0.01)
    one, other = map(answer, both)
    assert len(seen) >= 4  # of each, the server and at least one of its children
    assert [child for child in seen.values() if child.is_running() and child.status() != psutil.STATUS_ZOMBIE] == []
    assert one["heavy"] == other["heavy"] == [] and len({*one["modelled"], *other["modelled"]}) == 6
    assert (one["records"], one["step"]) == (other["records"], other["step"])

    third = answer(client())
    assert third["heavy"] == third["modelled"] == [] and not third["processes"], "another run starts nothing"
    assert sorted(third["reused"]) == sorted(third["records"]) and len(third["reused"]) == 6
    assert (third["records"], third["step"]) == (one["records"], one["step"])


@pytest.mark.parametrize("moment", ["loading", "modelling"])
def test_no_process_survives_a_killed_client(client: Callable[..., Any], moment: str) -> None:
    process = client("hang")
    assert process.stdout is not None
    process.stdout.readline()
    wanted = 1 if moment == "loading" else 3  # the server; its child; the process that part code has started
    deadline = time.monotonic() + 60
    children: list[psutil.Process] = []
    while len(children) < wanted and time.monotonic() < deadline:
        children = descendants(psutil.Process(process.pid))
        time.sleep(0.01)
    assert len(children) >= wanted
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    assert gone(children, 60) == []


def test_processes_of_a_part_end_with_it(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/parts_.py", PARTS)
    with place.service(timeout=1.5) as service:
        failure = service.realize([define("parts_:Slow")])["parts_:Slow"]
    assert failure.kind == "hung"
    lines = [" ".join(process.info["cmdline"] or []) for process in psutil.process_iter(["cmdline"])]
    assert [line for line in lines if f"time.sleep(600)  # {place.root}" in line] == []


def test_dead_server_is_restarted(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/parts_.py", PARTS)
    workers = Workers(1)
    try:
        workers.warm()
        (server,) = workers._processes
        server.process.kill()
        with place.service(workers=workers) as service:
            found = service.realize([define("parts_:Block", width=0.03)])
        assert all(isinstance(record, PartRecord) for record in found.values())
    finally:
        workers.close()


def test_closed_workers_are_not_restarted(place: Any, define: Callable[..., Any]) -> None:
    """A thread that waits for them gets an error, as in `thingc watch` after a file has changed."""
    place.write("parts/parts_.py", PARTS)
    workers = Workers(1)
    with place.service(workers=workers, timeout=30.0) as service, ThreadPoolExecutor() as threads:
        waiting = threads.submit(service.realize, [define("parts_:Slow")])
        deadline = time.monotonic() + 60.0
        while not any(process.unanswered and process.ready for process in workers._processes) and time.monotonic() < deadline:
            time.sleep(0.05)
        workers.close()
        failure = waiting.result()["parts_:Slow"]
    assert (failure.kind, failure.message) == ("crashed", "the workers have been shut down") and not workers.running


def test_next_run_repairs_damaged_entries(place: Any, define: Callable[..., Any]) -> None:
    """A missing, a truncated and an overwritten mesh and a truncated record are repaired; the last part is not modelled again."""
    place.write("parts/parts_.py", PARTS)
    definitions = [define("parts_:Block", width=width) for width in (0.03, 0.04, 0.05, 0.06, 0.07)]
    with place.service() as service:
        before = service.realize(definitions)
    damaged = [definition.text for definition in definitions[:4]]
    meshes = [before[text].meshes["print"] for text in damaged]
    gone, truncated, overwritten, _ = (Path(place.store.path(mesh.sha256)) for mesh in meshes)
    gone.unlink()
    truncated.write_bytes(truncated.read_bytes()[:100])
    overwritten.write_bytes(b"x" * overwritten.stat().st_size)
    (document,) = (path for path in (Path(place.store.root) / "record").glob("*/*") if b"width=0.06" in path.read_bytes())
    document.write_bytes(document.read_bytes()[:200])
    with place.service() as service:
        after = service.realize(definitions)
        assert sorted(modelled_parts(service)) == damaged
        assert {service.decisions[text].reason for text in damaged} == {"its files were missing from the cache"}
    assert after == before
    assert all(place.store.has(mesh.sha256, mesh.size) for mesh in meshes)


def test_swapped_records_are_modelled_again(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/parts_.py", PARTS)
    definitions = [define("parts_:Block", width=width) for width in (0.03, 0.04)]
    with place.service() as service:
        before = service.realize(definitions)
    one, other = (Path(place.store.root) / "record").glob("*/*")
    held = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(held)
    with place.service() as service:
        assert service.realize(definitions) == before
        assert sorted(modelled_parts(service)) == sorted(before)


def test_unwritable_store_is_an_error(place: Any, define: Callable[..., Any]) -> None:
    from thingc.geometry.store.local import Store, StoreUnusable

    place.write("parts/parts_.py", PARTS)
    blocked = place.root / "blocked"
    blocked.write_text("")
    place.store = Store(str(blocked / "store"))
    with place.service() as service, pytest.raises(StoreUnusable):
        service.realize([define("parts_:Block", width=0.03)])


def test_worker_starts_early_only_for_new_work(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/parts_.py", PARTS)
    first, second, third = Workers(1), Workers(1), Workers(1)
    try:
        with place.service(workers=first) as service:
            assert service.anticipate() and first.running
            service.realize([define("parts_:Block", width=0.03)])
        with place.service(workers=second) as service:
            assert not service.anticipate() and not second.running
        place.write("parts/parts_.py", PARTS.replace("10, 5", "10, 6"))
        with place.service(workers=third) as service:
            assert service.anticipate() and third.running
    finally:
        for workers in (first, second, third):
            workers.close()


def test_worker_starts_before_heavy_imports(place: Any) -> None:
    place.write("thingc.toml", 'thingc = "workspace/1"\nparts = ["parts"]\n')
    document = place.write("robot.yaml", "thingc: assembly/1\nname: robot\ncomponents: {block: {part: parts_:Block}}\n")
    program = (
        "import sys; sys.path[:0] = sys.argv[3:]\n"
        "from thingc.driver.environment import Environment, Options\n"
        "from thingc.driver.pipeline import compile\n"
        "from thingc.geometry.service import GeometryService\n"
        "heavy = {'pydantic', 'yaml', 'thingc.documents.spec', 'thingc.model.resolve'}\n"
        "GeometryService.anticipate = lambda self: sys.exit(str(sorted(heavy & set(sys.modules))))\n"
        "compile(Environment(sys.argv[1], Options(store=sys.argv[2])))\n"
    )
    done = subprocess.run([sys.executable, "-c", program, str(document), place.store.root, *sys.path], capture_output=True, text=True)
    assert done.stderr.splitlines()[-1:] == ["[]"]


@pytest.mark.parametrize(("foot", "needed"), [("frame: true", False), ("part: 'parts_:Block'", True)])
def test_worker_starts_early_for_parts_of_nested_documents(
    place: Any, monkeypatch: pytest.MonkeyPatch, foot: str, needed: bool,
) -> None:
    place.write("thingc.toml", 'thingc = "workspace/1"\nparts = ["parts"]\n')
    place.write("parts/parts_.py", PARTS)
    for name, component in (("robot", "assembly: sub/leg.yaml"), ("sub/leg", "assembly: '../foot.yaml'"), ("foot", foot)):
        place.write(f"{name}.yaml", f"thingc: assembly/1\nname: robot\ncomponents: {{one: {{{component}}}}}\n")

    def anticipated(service: GeometryService) -> bool:
        raise InterruptedError

    monkeypatch.setattr(GeometryService, "anticipate", anticipated)
    with Environment(str(place.root / "robot.yaml"), Options(store=place.store.root)) as environment:
        if needed:
            with pytest.raises(InterruptedError):
                read(environment, modelling=True)
        else:
            assert read(environment, modelling=True) is not None


def test_progress_is_reported(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/parts_.py", PARTS)
    heard: list[tuple[str, int, int]] = []
    with place.service(on_progress=lambda *said: heard.append(said[:3])) as service:
        service.realize([define("parts_:Block", width=width) for width in (0.03, 0.04, 0.05)])
    assert heard == [("modelling parts", done, 3) for done in range(4)]


def test_deferred_imports_happen_when_needed(tmp_path: Path) -> None:
    script = f"""
        import sys
        from thingc.geometry.worker.lazy_build123d import import_cheaply
        from thingc.geometry.key.modules import SELDOM_USED
        import_cheaply("build123d")
        assert not SELDOM_USED & set(sys.modules), SELDOM_USED & set(sys.modules)
        from build123d import *
        folder = {str(tmp_path)!r}
        mesher = Mesher()
        mesher.add_shape(Box(1, 2, 3))
        mesher.write(folder + "/box.3mf")
        assert abs(Mesher().read(folder + "/box.3mf")[0].volume - 6) < 1e-6
        assert "scipy" not in sys.modules
        drawing = ExportDXF()
        drawing.add_shape(Rectangle(1, 2))
        drawing.write(folder + "/box.dxf")
        assert len(import_dxf(folder + "/box.dxf")) == 4
        drawing = ExportSVG(fill_color=Color("red"))
        drawing.add_shape(Rectangle(1, 2))
        drawing.write(folder + "/box.svg")
        assert len(import_svg(folder + "/box.svg")) == 1
        assert abs(make_hull([Edge.make_line((0, 0), (1, 0)), Edge.make_line((0, 1), (1, 1))]).area - 1) < 1e-9
        assert Text("a", 10).area > 1
        assert abs(Triangle(a=3, b=4, c=5).area - 6) < 1e-9
        assert full_round(Rectangle(2, 4).edges().sort_by(Axis.X)[0])
        import ezdxf, scipy.optimize
        from thingc.geometry.worker.lazy_build123d import LazyObject, _LazyModule
        left = [
            (name, key) for name, module in sys.modules.items() if name.startswith("build123d")
            for key, value in vars(module).items()
            if type(value) is _LazyModule and value.__name__ in ("ezdxf", "lib3mf", "svgpathtools")
        ]
        assert not left, left
        from build123d import mesher as module
        assert type(next(iter(Mesher._map_b3d_mesh_type_3mf.values()))) is not LazyObject
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(script)], check=True)


def test_failed_deferred_import_falls_back_to_eager_import(tmp_path: Path) -> None:
    (tmp_path / "slow_library.py").write_text("VALUE = 3\n")
    (tmp_path / "user.py").write_text("import slow_library\nTABLE = [0] * slow_library.VALUE\n")  # uses it while it loads
    script = """
        import sys
        sys.path.insert(0, sys.argv[1])
        from thingc.geometry.worker.lazy_build123d import import_cheaply
        assert import_cheaply("user", frozenset({"slow_library"})).TABLE == [0, 0, 0]
        assert sys.modules["slow_library"].VALUE == 3
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(script), str(tmp_path)], check=True)



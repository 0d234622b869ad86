"""Batches on workers that share no folder with the driver: a real scheduler of dask, and worker processes in a separate mount namespace,
in which the folders of the driver are an empty file system. An audit hook of Python (`AUDIT`), which does not depend on thingc,
records every file that a worker or its runners open: accesses to folders of the driver, the number of unpacked workspaces, and the
number of fetched shared files."""

from __future__ import annotations

import base64
import concurrent.futures
import contextlib
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from msgspec.structs import replace

from realize.test_shared_store import SERVER
from thingc.base.diagnostics import Code
from thingc.batch import BatchFault, run
from thingc.batch.cluster import remote_workers
from thingc.batch.cluster.dask_executor import DaskCluster
from thingc.batch.cluster.protocol import WorkerLost
from thingc.batch.cluster.remote_workers import RemoteExecutor
from thingc.driver.environment import Options
from variants.robots import InThisProcess, batch_here, environment, tree, with_emitter, workspace
from variants.test_batch import rows, without_run
from variants.test_cluster import Dask, dask
from variants.test_faults import assert_gone, assert_whole, descendants, journal, listed, started, wait_for_lines
from variants.test_transfer import packed

AUDIT = '''
import os, sys

def install(path, descriptor):
    def hook(event, arguments):
        if event in ("open", "os.listdir", "os.scandir", "os.rename") and isinstance(arguments[0], (str, os.PathLike)):
            how = arguments[1] if event == "open" and isinstance(arguments[1], str) else ""
            name = os.path.abspath(arguments[0])
            if name.startswith(path) or "/thingc-" in name:
                os.write(descriptor, f"{os.getpid()}\\t{event}\\t{how}\\t{name}\\n".encode())
    sys.addaudithook(hook)

if "AUDIT_LOG" in os.environ:
    install(os.environ["AUDIT_OF"], os.open(os.environ["AUDIT_LOG"], os.O_WRONLY | os.O_CREAT | os.O_APPEND))
'''

COVERED = 'mount -t tmpfs -o size="$0" tmpfs "$1" && shift && exec "$@"'
"""A shell script that covers a folder with a file system of the given size, and then runs the command."""

STANDS = """
    thingc: variants/1
    assembly: stand.yaml
    name: faults
    parameters: {side: {from: 30 mm, to: 65 mm, count: 8}}
    keep: ["side < 63 mm", "mass < 29 g"]
    emit: [mjcf, bom]
"""

BROKEN = """
    from build123d import Box

    from thingc import Length, Thing, asset


    class Cup(Thing):
        def __init__(self, side: Length = 20):
            super().__init__(material="light")
            if side > 40:
                raise ValueError("a cup of that side is none")
            self.body = Box(side, side, float(asset("heights/cup.txt").read_text()))

        def result(self):
            return self.body
"""

CUPS = """
    thingc: assembly/1
    name: cups
    parameters: {side: {value: 20 mm, min: 10 mm, max: 100 mm}, tall: 15 mm}
    materials: {light: {density: 500 kg/m^3}}
    components:
      cup: {part: broken:Cup, params: {side: =side}}
      top: {frame: true, mass: "=100 g * (tall / 10 mm - 1)", inertia: {ixx: 1 g*m^2, iyy: 1 g*m^2, izz: 1 g*m^2}}
    joints: {lid: {type: fixed, parent: cup.origin, child: top.origin}}
"""

CUP_SWEEP = """
    thingc: variants/1
    assembly: robots/cups.yaml
    name: faults
    parameters: {side: [20 mm, 50 mm], tall: [20 mm, 5 mm]}
    emit: [mjcf]
"""


@dataclass(frozen=True)
class Apart:
    """Workers that share no folder with the driver. `driver` is hidden from them, `log` contains the opened files, and `path` is their
    PYTHONPATH."""

    dask: Dask
    driver: Path
    log: Path

    def events(self) -> list[list[str]]:
        """Return the events since the last call: process, event, mode, path."""
        found = self.log.read_text().splitlines() if self.log.exists() else []
        self.log.write_text("")
        return [line.split("\t") for line in found]

    def places(self) -> list[Path]:
        """Return the folders with shipments of running workers."""
        alive = [place for place, worker in zip(self.dask.places, self.dask.workers, strict=True) if worker.poll() is None]
        walks = [one for place in alive for one in os.walk(place)]  # `rglob` fails if a folder is removed meanwhile
        return [Path(top) / name for top, names, _ in walks for name in names if name.startswith("thingc-")]


def namespace(folder: Path, size: str = "100m") -> list[str]:
    """Return the words before a command that make `folder` empty for it, with the given free space. Skip the test without permission to
    do so."""
    words = ["unshare", *([] if os.geteuid() == 0 else ["--user", "--map-root-user"]), "--mount", "--propagation", "private"]
    words += ["sh", "-c", COVERED, size, str(folder)]
    try:
        subprocess.run([*words, "true"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as fault:
        pytest.skip(f"this machine lets nobody make a mount namespace of his own: {fault}")
    return words


@pytest.fixture(scope="module")
def apart(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Apart]:
    """Two workers in mount namespaces, with a separate store."""
    folder, driver = tmp_path_factory.mktemp("apart"), tmp_path_factory.mktemp("driver")
    with dask(folder / "dask", audited(folder, driver), 2, namespace(driver)) as two:
        yield Apart(dask=two, driver=driver, log=folder / "log")


def audited(folder: Path, driver: Path) -> dict[str, str]:
    """Return the environment of workers whose files are recorded, with the emitter that can be slow."""
    (folder / "audit").mkdir()
    (folder / "audit" / "sitecustomize.py").write_text(AUDIT)
    path = os.pathsep.join([str(folder / "audit"), with_emitter(folder)])
    return {**environment(str(folder / "store"), path), "AUDIT_LOG": str(folder / "log"), "AUDIT_OF": str(driver)}


def plain_journal(folder: Path) -> list[dict[str, object]]:
    """Return the journal lines in plan order without values that depend on the run."""
    found = [{key: value for key, value in line.items() if key not in ("pid", "seconds", "modelled", "reused")} for line in journal(folder)]
    return sorted(found, key=lambda line: int(str(line["index"])))


def kept(folder: Path) -> tuple[Any, ...]:
    """Return all files of a batch that must not depend on the place of the build."""
    out = folder / "build" / "faults"
    return (
        tree(out / "variants"), tree(out / "assets"), (out / "index.html").read_bytes(), (out / "batch.json").read_bytes(),
        without_run(rows(out)), plain_journal(folder),
    )


def built_here(folder: Path, env: dict[str, str], document: str = "faults.yaml", cwd: Path | None = None) -> tuple[Any, ...]:
    """Return the files of the local executor. Afterwards, the folder is as before the build."""
    done = batch_here(document, "--jobs", "1", "--pictures", "none", cwd=cwd or folder, env=env)
    assert done.returncode in (0, 1), done.stderr
    found = (*kept(folder), done.returncode, re.sub(r"\d+ parts modelled", "", done.stderr))
    shutil.rmtree(folder / "build")
    return found


def built_in_this_process(folder: Path, store: str) -> tuple[Any, ...]:
    """Return the same files without the output, built in this process."""
    with contextlib.chdir(folder):
        run("faults.yaml", executor=InThisProcess(), options=Options(store=store), pictures=0)
    found = kept(folder)
    shutil.rmtree(folder / "build")
    return found


def shipped(
    folder: Path, env: dict[str, str], address: str, *more: str, document: str = "faults.yaml", cwd: Path | None = None,
) -> tuple[Any, ...]:
    done = batch_here(document, "--pictures", "none", "--cluster", address, "--ship", *more, cwd=cwd or folder, env=env)
    assert done.returncode in (0, 1), done.stderr
    return (*kept(folder), done.returncode, re.sub(r"\d+ parts modelled", "", done.stderr))


def fetched(events: list[list[str]]) -> Counter[str]:
    """Return how often each shared file was read at the place where it was built."""
    found = (re.search(r"/out/assets/([0-9a-f]{64})$", path) for _, event, mode, path in events if event == "open" and "r" in mode)
    return Counter(match[1] for match in found if match is not None)


def unpacked(events: list[list[str]]) -> Counter[str]:
    """Return how often each process unpacked a workspace."""
    return Counter(process for process, event, _, path in events if event == "os.rename" and path.endswith(".new"))


@pytest.mark.slow
def test_isolated_workers_build_the_same_files(apart: Apart, tmp_path: Path, shared_store: str) -> None:
    here = workspace(apart.driver / "stands", faults=STANDS)
    local = built_in_this_process(here, shared_store)
    assert Counter(line["status"] for line in local[5]) == {"built": 5, "kept_out": 3} and len(local[1]) > 5

    refused = batch_here("faults.yaml", "--cluster", apart.dask.address, cwd=here, env=environment(shared_store))
    assert refused.returncode == 1 and f"error[{Code.CLUSTER.code}]" in refused.stderr and "cannot find" in refused.stderr
    assert "store the documents and the batch folder on a shared file system, or use --ship\n" in refused.stderr, refused.stderr
    shutil.rmtree(here / "build")

    apart.events()
    own = environment(str(tmp_path / "store"))  # in which no part has been modelled
    assert shipped(here, own, apart.dask.address)[:6] == local
    events = apart.events()
    assert not [path for *_, path in events if path.startswith(str(apart.driver))]
    assert len(unpacked(events)) == 2 and set(unpacked(events).values()) == {1}
    assert fetched(events) == dict.fromkeys(local[1], 1)
    assert not apart.places()

    shutil.rmtree(here / "build")
    assert shipped(here, environment(shared_store), apart.dask.address)[:6] == local  # with a store that has all
    assert not fetched(apart.events())


@pytest.mark.slow
def test_isolated_workers_pack_the_same_files(apart: Apart, tmp_path: Path, shared_store: str) -> None:
    here = workspace(apart.driver / "packed", faults=STANDS + "    layout: packed\n")

    def written() -> dict[str, bytes]:
        found = {path: data for path, data in tree(here / "build").items() if re.match("faults/(assets/|chunks/[0-9]+.parquet)", path)}
        shutil.rmtree(here / "build")
        return found

    run(str(here / "faults.yaml"), executor=InThisProcess(), options=Options(store=shared_store), pictures=0)
    local = written()
    words = ("--pictures", "none", "--cluster", apart.dask.address, "--ship")
    done = batch_here("faults.yaml", *words, cwd=here, env=environment(str(tmp_path / "store")))
    assert done.returncode == 0, done.stderr
    assert len(local) > 5 and written() == local and not apart.places()


@pytest.mark.slow
def test_errors_equal_those_of_a_local_build(apart: Apart, shared_store: str) -> None:
    folder = apart.driver / "cups"
    here = workspace(folder, faults=CUP_SWEEP)
    (here / "robots").mkdir()
    (here / "robots" / "cups.yaml").write_text(re.sub("^    ", "", CUPS, flags=re.MULTILINE))
    (here / "parts" / "broken.py").write_text(re.sub("^    ", "", BROKEN, flags=re.MULTILINE))
    (here / "parts" / "heights").mkdir()
    (here / "parts" / "heights" / "cup.txt").write_text("30")
    cwd, document = apart.driver, f"{folder.name}/faults.yaml"
    env = environment(shared_store)
    local = built_here(here, env, document, cwd)
    assert [line["status"] for line in local[5]] == ["built", "refused", "refused", "refused"]
    assert "a cup of that side is none" in str(local[5][2]) and local[6] == 1
    assert {str(said["file"]) for line in local[5][1:] for said in line["diagnostics"]} == {
        f"{folder.name}/robots/cups.yaml"
    }
    assert shipped(here, env, apart.dask.address, document=document, cwd=cwd) == local


@pytest.mark.slow
def test_killed_worker_loses_no_variants(apart: Apart, tmp_path: Path, shared_store: str) -> None:
    here = workspace(apart.driver / "killed", faults=listed(dict.fromkeys(range(14), "slow"), 14))
    env = environment(shared_store, with_emitter(tmp_path))
    local = built_here(here, env)
    process = started(here, env, "--cluster", apart.dask.address, "--ship", "--pictures", "none")
    wait_for_lines(here, 3, process)
    runners = descendants(apart.dask.workers[0].pid)
    apart.dask.workers[0].kill()
    apart.dask.workers[0].wait()
    assert runners
    assert_gone(runners)
    apart.dask.add(apart.dask.places[0])  # in the same folder, where dask removes what the dead one has left
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0 and out == "" and "14 variants: 14 built" in err, err
    assert_whole(here, 14)
    assert (*kept(here), 0, re.sub(r"\d+ parts modelled", "", err)) == local
    assert not apart.places()


@pytest.mark.slow
def test_stopped_batch_resumes_and_removes_shipments(apart: Apart, tmp_path: Path, shared_store: str) -> None:
    """The batch is interrupted, resumed, killed, and resumed again."""
    here = workspace(apart.driver / "stopped", faults=listed(dict.fromkeys(range(20), "slow"), 20))
    env, how = environment(shared_store, with_emitter(tmp_path)), ["--cluster", apart.dask.address, "--ship", "--pictures", "none"]
    done = 0
    for number in (signal.SIGINT, signal.SIGKILL):
        process = started(here, env, *how, *(["--resume"] if done else []))
        wait_for_lines(here, done + 3, process)
        assert apart.places()
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
        if number is signal.SIGINT:
            assert process.returncode == 130 and f"--cluster {apart.dask.address} --pictures none --ship --resume" in err, err
            assert not apart.places()
        assert done + 3 <= len(journal(here)) < 20
        done = len(journal(here))
    summary = shipped(here, env, apart.dask.address, "--resume")[-1]
    assert f"20 variants ({done} of them in earlier runs): 20 built" in summary
    assert_whole(here, 20)
    assert not apart.places()  # neither of this driver, nor of one that was killed


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Apart]:
    """Two workers that could access the folder of the driver, with a separate cache. They need no privileges."""
    folder, driver = tmp_path_factory.mktemp("beside"), tmp_path_factory.mktemp("driver")
    env = {**audited(folder, driver), "XDG_CACHE_HOME": str(folder / "cache")}
    del env["THINGC_STORE"]
    with dask(folder / "dask", env, 2) as two:
        yield Apart(dask=two, driver=driver, log=folder / "log")


@pytest.mark.slow
def test_workers_open_nothing_of_the_drivers_folder(
    beside: Apart, tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The driver runs in this process. At most one piece of a file is fetched at a time, each file separately. Chunks have several
    variants with a common mesh that is not fetched yet."""
    text = STANDS.replace("29 g", "90 g") + "    choices: {components.plate.material: [light, heavy]}\n"
    here = workspace(beside.driver / "stands", faults=text)
    local = built_in_this_process(here, shared_store)
    pulls: list[int] = []
    ask = DaskCluster.ask

    def counting(self: DaskCluster, worker: str, fn: Any, *arguments: Any) -> Any:
        found = ask(self, worker, fn, *arguments)
        assert sum(map(len, found)) <= 5000 or len(found) == 1
        pulls.append(len(found))
        return found

    monkeypatch.setattr(DaskCluster, "ask", counting)
    monkeypatch.setattr(remote_workers, "PULL_BYTES", 5000)
    monkeypatch.chdir(here)
    with DaskCluster(beside.dask.address, jobs=1) as cluster:
        summary = run("faults.yaml", executor=cluster, ship=True, options=Options(store=str(tmp_path / "store")), pictures=0)
    assert summary.statuses == {"built": 9, "kept_out": 7} and max(pulls) > 1
    assert kept(here) == local
    events = beside.events()
    assert fetched(events) == dict.fromkeys(local[1], 1)
    assert events and not [path for *_, path in events if path.startswith(str(beside.driver))]
    assert set(unpacked(events).values()) == {1} and len(unpacked(events)) == 2 and not beside.places()


@pytest.mark.slow
@pytest.mark.parametrize("damaged", [False, True])
def test_files_of_a_variant_are_compared_with_its_manifest(tmp_path: Path, damaged: bool) -> None:
    model = b"<mujoco/>"
    manifest = json.dumps({"files": {"model.xml": hashlib.sha256(model).hexdigest()}}).encode()
    sent = {"manifest.json": manifest, "model.xml": model + b" " if damaged else model}
    row = {"id": "0123456789ab", "shared": {}, "files": {path: base64.b64encode(data).decode() for path, data in sent.items()}}
    (tmp_path / "variants").mkdir()
    executor: Any = SimpleNamespace(folder=str(tmp_path))
    with pytest.raises(WorkerLost, match="damaged") if damaged else contextlib.nullcontext():
        RemoteExecutor._keep(executor, row, None)  # type: ignore[arg-type]
    written = {path.name: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert written == ({} if damaged else sent)


def test_workspace_that_a_worker_cannot_unpack(beside: Apart, tmp_path: Path) -> None:
    whole = packed(workspace(tmp_path))
    with DaskCluster(beside.dask.address) as cluster, pytest.raises(BatchFault, match="cannot receive the workspace: .*damaged during"):
        cluster.ship("thingc-damaged", replace(whole, sha256="0" * 64))
    assert not beside.places()
    with DaskCluster(beside.dask.address) as cluster:
        cluster.ship("thingc-whole", whole)
        assert len(beside.places()) == 2
        cluster.unship("thingc-whole")
    assert not beside.places()


@pytest.mark.slow
def test_store_with_a_url(beside: Apart, tmp_path: Path, shared_store: str) -> None:
    """Workers send built parts there, and the driver reads them from there. Without `--ship`, they write to the folder of the batch."""
    here = workspace(beside.driver / "ftp", faults=STANDS)
    (tmp_path / "outside.txt").write_text("10")
    (here / "parts" / "data").mkdir()
    code = f"import os; os.listdir(os.path.join(os.path.dirname(__file__), 'data')); open({str(tmp_path / 'outside.txt')!r}).read()\n"
    (here / "parts" / "plates.py").write_text(code + (here / "parts" / "plates.py").read_text())  # a plan has these among its inputs
    local = built_in_this_process(here, shared_store)
    served = tmp_path / "served"
    served.mkdir()
    server = subprocess.Popen(
        [sys.executable, "-c", SERVER, str(served)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )
    try:
        assert server.stdout is not None
        address = beside.dask.with_workers(1).address  # each starts the kernel
        port = int(server.stdout.readline())
        for ship in (["--ship"], []):
            store = f"parts{len(ship)}"
            env = environment(f"ftp://robot:secret@127.0.0.1:{port}/{store}")
            env["XDG_CACHE_HOME"] = str(tmp_path / f"cache{len(ship)}")
            beside.events()
            done = batch_here("faults.yaml", "--pictures", "none", "--cluster", address, *ship, cwd=here, env=env)
            assert done.returncode == 0 and "5 built, 3 excluded; 8 parts modelled" in done.stderr, done.stderr
            assert kept(here) == local
            there = {path.parent.name + path.name for path in (served / store / "blobs").rglob("*") if path.is_file()}
            assert set(local[1]) <= there
            assert not fetched(beside.events())
            shutil.rmtree(here / "build")
    finally:
        server.kill()
        server.wait()


@pytest.mark.slow
def test_new_worker_without_free_space_ends_the_batch(beside: Apart, tmp_path: Path, shared_store: str) -> None:
    """Otherwise, this worker would fail for one chunk after another without a visible reason."""
    here = workspace(tmp_path / "here", faults=listed(dict.fromkeys(range(20), "slow"), 20))  # not done before the worker comes
    (here / "large.stl").write_bytes(bytes(1_000_000))
    env, one = environment(shared_store, with_emitter(tmp_path)), beside.dask.with_workers(1)
    small = tmp_path / "small"
    small.mkdir()
    one.before = namespace(small, "500k")
    process = started(here, env, "--cluster", one.address, "--ship", "--pictures", "none")
    wait_for_lines(here, 1, process)
    one.add(small)
    one.before = ()
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1 and f"error[{Code.RUNNERS.code}]: a worker cannot unpack the workspace: " in err, err
    assert "No space left on device" in err and "--resume" in err and "Traceback" not in err
    assert {line["status"] for line in journal(here)} == {"built"} and len(journal(here)) < 20
    one.workers[-1].kill()
    one.workers[-1].wait()
    assert "20 built" in shipped(here, env, one.address, "--resume")[-1]
    assert_whole(here, 20)


@pytest.mark.slow
def test_driver_does_not_wait_for_an_ended_worker(beside: Apart) -> None:
    """This is the last test that uses these workers."""
    victim = beside.dask.living()[0]
    with DaskCluster(beside.dask.address) as cluster:
        worker = next(one for one in cluster._client.nthreads() if cluster.ask(one, os.getpid) == victim.pid)
        with pytest.raises(remote_workers.WorkerLost, match="no workspace"):
            cluster.ask(worker, remote_workers.read_shared_files, "nothing", [], 0)
        victim.kill()
        victim.wait()
        begun = time.monotonic()
        with pytest.raises(remote_workers.WorkerLost):
            for _ in range(50):
                cluster.ask(worker, os.getpid)
        assert time.monotonic() - begun < 10.0


# --- the command line -----------------------------------------------------------------------------------------------


def test_ship_needs_a_cluster(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    done = batch_here("sweep.yaml", "--ship", cwd=here, env=environment(shared_store))
    assert done.returncode == 2 and f"error[{Code.COMMAND_LINE.code}]: --ship requires --cluster" in done.stderr
    assert "--cluster tcp://HOST:8786" in done.stderr and not (here / "build").exists()


def test_slurm_and_executors_without_file_transfer(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    done = batch_here("sweep.yaml", "--ship", "--cluster", "slurm:cluster=local", cwd=here, env=environment(shared_store))
    assert done.returncode == 2 and f"error[{Code.COMMAND_LINE.code}]: --ship can only be used with Dask " in done.stderr
    assert "\n  help: remove --ship\n" in done.stderr and not (here / "build").exists()
    with concurrent.futures.ThreadPoolExecutor(1) as executor, pytest.raises(BatchFault, match="--ship can only be used with Dask workers"):
        run(str(here / "sweep.yaml"), executor=executor, ship=True, options=Options(store=shared_store))

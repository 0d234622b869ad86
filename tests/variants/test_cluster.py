"""Batches with other executors: a real dask scheduler with worker processes, and submitit jobs as processes of this machine. Each batch
is compared with one of the local executor. Workers, jobs and the scheduler are killed while batches run."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

from thingc.base.diagnostics import Code
from thingc.batch import BatchFault
from thingc.batch.cluster import connection as cluster, dask_executor
from thingc.batch.cluster.slurm import SlurmSettings, settings_of
from variants.robots import batch_here, environment, tree, with_emitter, workspace
from variants.test_batch import rows, without_run
from variants.test_faults import assert_gone, assert_whole, descendants, journal, listed, started, wait_for_lines

COUNT = 24

QUIET = {
    "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "10s",
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "500ms",
    "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "10s",
}
"""Settings of dask. A lost worker is detected soon, and a waiting worker takes a fifth of the processor time that it takes by default."""


class Dask:
    """A scheduler of dask and its workers. Each worker is a process with one thread. `before` contains words before the command of a
    worker."""

    def __init__(self, folder: Path, env: dict[str, str], workers: int, before: Sequence[str] = ()) -> None:
        self.folder = folder
        self.before = before
        self.env = {**env, **QUIET}
        self.file = folder / "scheduler.json"
        folder.mkdir(parents=True, exist_ok=True)
        self.workers: list[subprocess.Popen[bytes]] = []
        self.places: list[Path] = []
        self.begin()
        for _ in range(workers):
            self.add()
        if workers:
            self.wait_for(workers)

    def begin(self) -> None:
        """Start the scheduler."""
        self.file.unlink(missing_ok=True)
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(self.file))
        deadline = time.monotonic() + 60.0
        while not self.file.exists() or not self.file.read_text().strip():
            assert time.monotonic() < deadline and self.scheduler.poll() is None
            time.sleep(0.05)
        self.address = str(json.loads(self.file.read_text())["address"])

    def add(self, place: Path | None = None) -> None:
        """Start one more worker, in a new folder unless a folder is given."""
        place = place or self.folder / f"worker{len(self.workers)}"
        self.places.append(place)
        self.workers.append(self._start("worker", self.address, "--nthreads", "1", "--no-nanny", "--local-directory", str(place)))

    def wait_for(self, workers: int) -> None:
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            if workers:
                client.wait_for_workers(workers, timeout=90)
            while len(client.nthreads()) > workers:
                time.sleep(0.05)

    def living(self) -> list[subprocess.Popen[bytes]]:
        """Return the workers that have not ended."""
        return [worker for worker in self.workers if worker.poll() is None]

    def with_workers(self, count: int) -> Dask:
        """Start or stop workers until the given number is running and known to the scheduler. If a test has killed the scheduler, start
        another one."""
        lost = self.scheduler.poll() is not None
        for worker in self.living()[0 if lost else count:]:
            worker.kill()
            worker.wait()
        if lost:
            self.begin()
        for _ in range(count - len(self.living())):
            self.add()
        self.wait_for(count)
        return self

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def _start(self, what: str, *words: str) -> subprocess.Popen[bytes]:
        command = [
            *(self.before if what == "worker" else ()), sys.executable, "-m", "distributed.cli.dask_" + what, *words, "--no-dashboard",
        ]
        with (self.folder / f"{what}.log").open("ab") as log:
            return subprocess.Popen(command, env=self.env, cwd=self.folder, stdout=log, stderr=log)


@contextlib.contextmanager
def dask(folder: Path, env: dict[str, str], workers: int, before: Sequence[str] = ()) -> Iterator[Dask]:
    found = Dask(folder, env, workers, before)
    try:
        yield found
    finally:
        found.close()


@pytest.fixture(scope="module")
def mortal(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Iterator[Dask]:
    """Workers that tests kill. Each test requests as many as it needs."""
    folder = tmp_path_factory.mktemp("mortal")
    with dask(folder / "dask", environment(shared_store, with_emitter(folder)), 0) as found:
        yield found


@dataclass(frozen=True)
class Local:
    """The result of the local executor for `CHEAP`: the folder of the workspace, and the output."""

    folder: Path
    said: str


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Local:
    here = workspace(tmp_path_factory.mktemp("local"), faults=CHEAP)
    done = batch_here("faults.yaml", "--pictures", "none", "--jobs", "1", cwd=here, env=environment(shared_store))
    assert done.returncode == 0, done.stderr
    return Local(here, done.stderr)


CHEAP = f"""
    thingc: variants/1
    assembly: pendulum.yaml
    name: faults
    parameters: {{length: {{from: 200 mm, to: 660 mm, count: {COUNT}}}}}
    keep: ["length < 550 mm", "mass > 1 kg"]
    emit: [mjcf, bom]
"""


@pytest.mark.slow
def test_scheduler_without_workers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, mortal: Dask) -> None:
    monkeypatch.setattr(dask_executor, "TIMEOUT", 3.0)
    with pytest.raises(BatchFault, match="has no worker"):
        cluster.connect(mortal.with_workers(0).address, folder=str(tmp_path / "jobs"))


@pytest.mark.slow
def test_dask_writes_the_same_files(tmp_path: Path, shared_store: str, mortal: Dask, local: Local) -> None:
    here, there = local.folder, workspace(tmp_path, faults=CHEAP)
    address = mortal.with_workers(2).address
    remote = batch_here("faults.yaml", "--pictures", "none", "--cluster", address, cwd=there, env=environment(shared_store))
    assert remote.returncode == 0, remote.stderr
    assert local.said == remote.stderr and "24 variants: 18 built, 6 excluded" in remote.stderr
    mine, theirs = here / "build/faults", there / "build/faults"
    assert tree(mine / "variants") == tree(theirs / "variants")
    assert (mine / "index.html").read_bytes() == (theirs / "index.html").read_bytes()
    assert without_run(rows(mine)) == without_run(rows(theirs))
    runners = {line["pid"] for line in journal(there) if "pid" in line}
    assert len(runners) == 2 and not runners & {line["pid"] for line in journal(here) if "pid" in line}


@pytest.mark.slow
def test_workers_with_other_files_are_named(tmp_path: Path, mortal: Dask) -> None:
    document = tmp_path / "robot.yaml"
    document.write_text("one")
    with dask_executor.DaskCluster(mortal.with_workers(2).address) as found:
        found.check({str(document): hashlib.sha256(b"one").hexdigest()})
        with pytest.raises(BatchFault, match="has different content for .*robot.yaml"):
            found.check({str(document): hashlib.sha256(b"two").hexdigest()})
        with pytest.raises(BatchFault, match="cannot find .*nothing.yaml"):
            found.check({str(tmp_path / "nothing.yaml"): "0" * 64})


@pytest.mark.slow
def test_workers_with_other_versions_are_named(tmp_path: Path, mortal: Dask, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_executor, "versions", lambda: {"thingc": "0.0.1"})
    other = r"different versions: .*thingc \S+ instead of 0.0.1"
    with dask_executor.DaskCluster(mortal.with_workers(2).address) as found, pytest.raises(BatchFault, match=other):
        found.check({})


@pytest.mark.slow
def test_worker_that_ends_during_the_check_is_ignored(mortal: Dask) -> None:
    """A stopped worker does not answer, and is killed while the driver waits for it. Another worker is available."""
    victim = mortal.with_workers(2).living()[0]
    engine = dask_executor.DaskCluster(mortal.address)
    victim.send_signal(signal.SIGSTOP)
    killing = threading.Timer(1.0, victim.kill)
    killing.start()
    started = time.monotonic()
    engine.check({str(mortal.file): hashlib.sha256(mortal.file.read_bytes()).hexdigest()})
    assert time.monotonic() - started > 0.9, "it was alive when the check began"
    killing.join()
    with pytest.raises(BatchFault, match="has different content for"):
        engine.check({str(mortal.file): "0" * 64})
    engine.shutdown()
    victim.wait()


@pytest.mark.slow
def test_loss_of_the_last_worker_is_reported_after_a_wait(monkeypatch: pytest.MonkeyPatch, mortal: Dask) -> None:
    monkeypatch.setattr(dask_executor, "PATIENCE", 1.5)
    monkeypatch.setattr(dask_executor, "LOOK", 0.1)
    with dask_executor.DaskCluster(mortal.with_workers(1).address) as found:
        assert found.fault() is None and found.ahead == 2
        mortal.with_workers(0)
        killed = time.monotonic()
        fault = None
        while fault is None and time.monotonic() - killed < 30.0:
            time.sleep(0.1)
            fault = found.fault()
        assert fault is not None and "no worker for 1.5 s" in str(fault) and time.monotonic() - killed > 1.4


@pytest.mark.slow
def test_batch_resumes_locally_after_the_scheduler_ends(tmp_path: Path, shared_store: str, mortal: Dask) -> None:
    here = workspace(tmp_path, faults=listed(dict.fromkeys(range(16), "slow"), 16))
    env = environment(shared_store, with_emitter(tmp_path))
    process = started(here, env, "--cluster", mortal.with_workers(1).address)
    wait_for_lines(here, 4, process)
    mortal.scheduler.kill()
    out, err = process.communicate(timeout=60)
    assert process.returncode == 1 and out == ""
    assert f"error[{Code.CLUSTER.code}]" in err and mortal.address in err and "--resume" in err and "Traceback" not in err
    done = len(journal(here))
    assert 4 <= done < 16
    again = batch_here("faults.yaml", "--pictures", "none", "--jobs", "1", "--resume", cwd=here, env=env)
    assert again.returncode == 0 and f"16 variants ({done} of them in earlier runs): 16 built" in again.stderr, again.stderr
    assert_whole(here, 16)


def test_unreachable_address(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(dask_executor, "TIMEOUT", 1.0)
    started = time.monotonic()
    with pytest.raises(BatchFault) as caught:
        cluster.connect("tcp://127.0.0.1:9", folder=str(tmp_path / "jobs"))
    assert time.monotonic() - started < 20.0
    assert caught.value.diagnostic.code is Code.CLUSTER and "tcp://127.0.0.1:9" in str(caught.value)


@pytest.mark.parametrize("address", ["nonsense", "host", "http://host:80", "tcp://", "slurmy", "10.0.0.1:port"])
def test_invalid_addresses(address: str, tmp_path: Path) -> None:
    with pytest.raises(BatchFault, match="is not an address of a cluster") as caught:
        cluster.connect(address, folder=str(tmp_path / "jobs"))
    assert caught.value.diagnostic.code is Code.COMMAND_LINE


@pytest.mark.parametrize(("package", "address"), [("distributed", "tcp://127.0.0.1:9"), ("submitit", "slurm:cluster=local")])
def test_missing_package_is_named(package: str, address: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, package, None)  # makes its import fail
    with pytest.raises(BatchFault) as caught:
        cluster.connect(address, folder=str(tmp_path / "jobs"))
    assert package in str(caught.value) and caught.value.diagnostic.help == "run `pip install 'thingc[cluster]'`"


def test_slurm_settings() -> None:
    assert settings_of("") == SlurmSettings()
    assert settings_of("partition=cpu, cpus=8,time=90 s,memory=16") == SlurmSettings(
        cpus=8, minutes=2, more=(("mem_gb", "16"), ("slurm_partition", "cpu")),
    )
    for wrong, words in (
        ("partitoin=cpu", "valid NAME"), ("cpus=some", "whole number"), ("time=2", "time"), ("time=2 kg", "time"),
        ("cluster=big", "cluster=local"), ("cpus", "NAME=VALUE"),
    ):
        with pytest.raises(BatchFault, match=words):
            settings_of(wrong)


@pytest.mark.skipif(sys.platform == "win32", reason="sbatch of SLURM is a program of Linux")
def test_missing_slurm(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BatchFault, match="the SLURM command `sbatch` is not installed"):
        cluster.connect("slurm:partition=cpu", folder=str(tmp_path / "jobs"))
    assert not (tmp_path / "jobs").exists()


@pytest.mark.slow
def test_submitit_writes_the_same_files(tmp_path: Path, shared_store: str, local: Local) -> None:
    here, there = local.folder, workspace(tmp_path, faults=CHEAP)
    cluster = ("--cluster", "slurm:cluster=local,cpus=2", "--jobs", "2")
    done = batch_here("faults.yaml", "--pictures", "none", *cluster, cwd=there, env=environment(shared_store))
    assert done.returncode == 0 and "24 variants: 18 built, 6 excluded" in done.stderr, done.stderr
    assert tree(here / "build/faults/variants") == tree(there / "build/faults/variants")
    assert without_run(rows(here / "build/faults")) == without_run(rows(there / "build/faults"))
    assert not [path for path in there.iterdir() if path.name.startswith(".thingc-jobs")]


def running_job(process: subprocess.Popen[str]) -> psutil.Process:
    """Return a job of submitit of this batch with running runners. Between two jobs, there is none for a moment."""
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        for one in descendants(process.pid):
            with contextlib.suppress(psutil.NoSuchProcess):
                if "submitit.core._submit" in " ".join(one.cmdline()) and "thingc.batch.runner" in str(
                    [child.cmdline() for child in one.children()]
                ):
                    return one
        time.sleep(0.1)
    raise AssertionError("no job was seen at work")


@pytest.mark.slow
def test_killed_job_is_repeated(tmp_path: Path, shared_store: str) -> None:
    """Of two jobs with one variant each, the killed one is submitted again."""
    here = workspace(tmp_path, faults=listed(dict.fromkeys(range(2), "slow"), 2))
    env = environment(shared_store, with_emitter(tmp_path))
    process = started(here, env, "--cluster", "slurm:cluster=local", "--jobs", "2")
    victim = running_job(process)
    victim.send_signal(signal.SIGKILL)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0 and "2 variants: 2 built" in err, err
    assert_whole(here, 2)


@pytest.mark.slow
def test_interrupt_cancels_jobs(tmp_path: Path, shared_store: str) -> None:
    """A terminal sends SIGINT to the jobs, too."""
    here = workspace(tmp_path, faults=listed(dict.fromkeys(range(12), "slow"), 12))
    env = environment(shared_store, with_emitter(tmp_path))
    process = started(here, env, "--cluster", "slurm:cluster=local", "--jobs", "1")
    wait_for_lines(here, 1, process)
    running_job(process)
    running = descendants(process.pid)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    done = len(journal(here))
    again = "thingc batch faults.yaml --cluster slurm:cluster=local --pictures none --jobs 1 --resume"
    assert err == f"interrupted ({done} of 12 variants are done); to continue, run: {again}\n"
    assert process.returncode == 130 and running
    assert_gone(running)

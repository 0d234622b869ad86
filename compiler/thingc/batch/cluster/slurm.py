"""Build the variants of a batch as SLURM jobs, which are submitted with submitit. Each chunk of variants is built by one SLURM job.

Chunks are large, so that building a chunk takes long compared with the time of the job in the queue. An example of an address with settings
is `slurm:partition=cpu,cpus=8,time=2 h`. With `cluster=local`, jobs are processes on this machine, and SLURM is not required.
"""

from __future__ import annotations

import contextlib
import math
import os
import shutil
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from typing import Any, TypeVar

from thingc.base.diagnostics import Code
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import did_you_mean
from thingc.base.units import TIME, UnitError, parse_quantity
from thingc.batch.cluster.protocol import Cluster, missing
from thingc.batch.engine import LocalExecutor, RunnersBroken, evaluate
from thingc.batch.folder import BatchFault
from thingc.batch.job import Row
from thingc.batch.variant import Variant

T = TypeVar("T")

JOB_SECONDS = 300.0
"""Target duration [s] of a SLURM job. This duration is long compared with the time of a job in the queue."""
JOBS = 16
"""Default number of SLURM jobs that run at the same time."""
POLL = 0.5
"""Interval [s] at which results are polled. The library submitit itself asks SLURM once a minute."""


class SlurmSettings(FrozenStruct):
    """The settings of SLURM jobs, parsed from an address such as `slurm:partition=cpu,cpus=8`.

    `cpus` is the number of cores of a job. A job builds this many variants at the same time. `minutes` is the time limit of a job.
    `cluster` is the name of an executor of submitit (`slurm` or `local`), and `more` contains further parameters for submitit.
    """

    cpus: int = 1
    minutes: int = 120
    cluster: str = "slurm"
    more: tuple[tuple[str, str], ...] = ()


_MORE = {
    "partition": "slurm_partition", "account": "slurm_account", "qos": "slurm_qos", "constraint": "slurm_constraint", "memory": "mem_gb",
}
"""For settings that are passed on unchanged, the names that submitit uses."""


def settings_of(text: str) -> SlurmSettings:
    """Parse settings such as `partition=cpu,cpus=8,time=2 h`. Raises `BatchFault` for invalid settings."""
    settings: dict[str, Any] = {}
    more: dict[str, str] = {}
    known = ("partition", "cpus", "time", "account", "qos", "constraint", "memory", "cluster")
    for piece in filter(None, (piece.strip() for piece in text.split(","))):
        name, equals, value = (text_part.strip() for text_part in piece.partition("="))
        if name not in known or not equals or not value:
            help = did_you_mean(name, known, what="settings")
            raise BatchFault(Code.COMMAND_LINE, f"slurm: expected NAME=VALUE with a valid NAME, found `{piece}`", help)
        if name in ("cpus", "memory") and (not value.isdigit() or int(value) < 1):
            message = f"slurm: expected a whole number of at least 1 for `{name}`, found `{value}`"
            raise BatchFault(Code.COMMAND_LINE, message, f"write `{name}=8`")
        if name == "cpus":
            settings["cpus"] = int(value)
        elif name == "time":
            settings["minutes"] = _minutes(value)
        elif name == "cluster":
            if value not in ("slurm", "local"):
                raise BatchFault(Code.COMMAND_LINE, f"slurm: expected `cluster=slurm` or `cluster=local`, found `{value}`")
            settings["cluster"] = value
        else:
            more[_MORE[name]] = value
    return SlurmSettings(**settings, more=tuple(sorted(more.items())))


def _minutes(text: str) -> int:
    try:
        quantity = parse_quantity(text)
    except UnitError as fault:
        raise BatchFault(Code.COMMAND_LINE, f"slurm: `time`: {fault}", "write, for example, `time=2 h`") from fault
    if quantity.dimension != TIME or quantity.value <= 0.0:
        raise BatchFault(Code.COMMAND_LINE, f"slurm: expected a time above 0 for `time`, found `{text}`", "write, for example, `time=2 h`")
    return max(1, math.ceil(quantity.value / 60.0))


def run_chunk(width: int, job: str, tasks: Sequence[Variant], timeout: float) -> list[Row] | RunnersBroken:
    """Build the variants of a chunk in `width` runner processes. This function runs in the SLURM job.

    The function returns the rows of results, or an exception if runner processes cannot be started. The library submitit would replace a
    raised exception by another exception.
    """
    size = max(1, len(tasks) // (4 * width))
    with LocalExecutor(width) as executor:
        futures = [executor.submit(evaluate, job, tasks[k : k + size], timeout) for k in range(0, len(tasks), size)]
        try:
            return [row for future in futures for row in future.result()]
        except RunnersBroken as fault:
            return fault


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Discard the standard error of processes that are started while the context is active.

    For local jobs, submitit starts such processes. When these processes are cancelled or interrupted, they print a traceback.
    """
    sys.stderr.flush()
    saved = os.dup(2)
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)


class SlurmCluster(Cluster):
    """An executor that submits SLURM jobs.

    At most `jobs` jobs are in the queue. If `jobs` is 0, the limit is `JOBS`. The library submitit writes files to `folder`, which must be
    on a shared file system. Raises `BatchFault` if SLURM is not installed.
    """

    def __init__(self, settings: SlurmSettings, *, jobs: int = 0, folder: str) -> None:
        try:
            import submitit
        except ImportError:
            raise missing("submitit") from None
        self.settings = settings
        self.folder = folder
        self.ahead = jobs or (JOBS if settings.cluster == "slurm" else max(1, (os.cpu_count() or 1) // settings.cpus))
        self.first = 8 * settings.cpus
        self.chunk_seconds = JOB_SECONDS * settings.cpus
        self.chunk_most = 100_000
        self._fault: BatchFault | None = None
        self._lock = threading.Lock()
        self._jobs: dict[Future[Any], Any] = {}
        self._stop = threading.Event()
        if settings.cluster == "slurm" and shutil.which("sbatch") is None:
            raise BatchFault(
                Code.CLUSTER, "the SLURM command `sbatch` is not installed",
                "run the command on a machine that can submit jobs, or use `slurm:cluster=local` for a test",
            )
        os.makedirs(folder, exist_ok=True)
        self._executor = submitit.AutoExecutor(folder=folder, cluster=settings.cluster)
        named: dict[str, Any] = {"slurm_job_name": "thingc", "timeout_min": settings.minutes, **dict(settings.more)}
        if settings.cluster == "slurm":
            named["cpus_per_task"] = settings.cpus
        if "mem_gb" in named:
            named["mem_gb"] = int(named["mem_gb"])
        self._executor.update_parameters(**named)
        threading.Thread(target=self._watch, daemon=True, name="thingc-slurm").start()

    def submit(self, fn: Callable[..., T], /, *arguments: Any, **named: Any) -> Future[T]:
        """Submit a SLURM job that calls `evaluate`, and return a future of its result.

        Raises `TypeError` if the function is not `evaluate`.
        """
        if fn is not evaluate or named:
            raise TypeError("SLURM jobs can only evaluate chunks")
        future: Future[T] = Future()
        try:
            with _silent() if self.settings.cluster == "local" else contextlib.nullcontext():
                job = self._executor.submit(run_chunk, self.settings.cpus, *arguments)
        except Exception as fault:  # for example, an unknown partition or too many jobs
            message = " ".join(str(fault).split())
            self._fault = BatchFault(Code.CLUSTER, f"SLURM rejected the job: {message}", "fix the problem, and continue with --resume")
            future.set_exception(fault)
            return future
        with self._lock:
            self._jobs[future] = job
        future.add_done_callback(self._forget)
        return future

    def fault(self) -> BatchFault | None:
        """Return the error that occurred when the last job was submitted, or None."""
        return self._fault

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Cancel queued and running jobs, and remove the files that submitit has written."""
        with self._lock:
            futures = list(self._jobs)
        for future in futures:
            future.cancel()
        self._stop.set()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _forget(self, future: Future[Any]) -> None:
        with self._lock:
            job = self._jobs.pop(future, None)
        if job is not None and future.cancelled():
            with contextlib.suppress(Exception):  # the job may have ended
                job.cancel(check=False)

    def _watch(self) -> None:
        while not self._stop.wait(POLL):
            with self._lock:
                running = list(self._jobs.items())
            for future, job in running:
                try:
                    if not job.done():
                        continue
                    answer = job.result()
                except Exception as fault:
                    answer = fault
                if not future.set_running_or_notify_cancel():
                    continue
                if isinstance(answer, Exception):
                    future.set_exception(answer)
                else:
                    future.set_result(answer)

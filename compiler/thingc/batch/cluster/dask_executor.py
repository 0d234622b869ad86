"""Build the variants of a batch on the workers of a dask scheduler.

Workers are processes that run on any number of machines. Workers can connect and disconnect at any time. If a worker dies, dask assigns its
chunks to another worker. If dask reports that a chunk is lost, the batch submits the chunk again.
"""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from importlib import import_module
from typing import Any, TypeVar

from thingc.base.diagnostics import Code
from thingc.batch.cluster.protocol import PATIENCE, Cluster, WorkerLost, missing
from thingc.batch.cluster.workspace_archive import WorkspaceArchive
from thingc.batch.folder import BatchFault
from thingc.driver.up_to_date import state_of
from thingc.targets.manifest import versions

T = TypeVar("T")

TIMEOUT = 15.0
"""Time limit [s] for the answer of the scheduler, and for the connection of the first worker."""
LOOK = 5.0
"""Interval [s] at which the number of workers is polled."""


def inspect_worker(paths: list[str]) -> tuple[dict[str, str], dict[str, str | None]]:
    """Return the versions of the packages that are installed on a worker, and the digests of files and folders (see `up_to_date.state_of`).

    The digest of a missing file is None. This function runs on the worker.
    """
    return dict(versions()), {path: state_of(path) for path in paths}


class DaskCluster(Cluster):
    """An executor that runs calls on the workers of the dask scheduler at `address`.

    It can also copy files to and from its workers, so that a shared file system is not required.

    Raises `BatchFault` if the scheduler does not respond or does not have any workers.
    """

    def __init__(self, address: str, *, jobs: int = 0) -> None:
        try:
            distributed: Any = import_module("distributed")
        except ImportError:
            raise missing("distributed") from None
        self.address = address
        self._jobs = jobs
        for name in logging.root.manager.loggerDict:
            if name.partition(".")[0] in ("distributed", "tornado"):  # errors are reported by thingc
                logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        try:
            self._client = distributed.Client(address, timeout=TIMEOUT, set_as_default=False)
        except Exception as fault:  # OSError, or other exceptions if the program is not a scheduler
            raise BatchFault(
                Code.CLUSTER, f"no Dask scheduler responds at `{address}`: {_first_line(fault)}",
                "start a scheduler with `dask scheduler`, or check the firewall",
            ) from None
        try:
            self._client.wait_for_workers(1, timeout=TIMEOUT)
        except Exception:
            self._client.close(1.0)
            raise BatchFault(
                Code.CLUSTER, f"the scheduler at `{address}` has no worker", f"start workers with `dask worker {address} --nthreads 1`",
            ) from None
        self._executor = self._client.get_executor(pure=False)
        self._last_poll = 0.0
        self._without_workers_since: float | None = None
        self.fault()

    def submit(self, fn: Callable[..., T], /, *arguments: Any, **named: Any) -> Future[T]:
        """Run the call `fn(*arguments, **named)` on a worker, and return a future of the result."""
        future: Future[T] = self._executor.submit(fn, *arguments, **named)
        return future

    def check(self, files: Mapping[str, str]) -> None:
        """Check that every connected worker can read the given files and has the same packages installed.

        Raises `BatchFault` if the check fails. Workers that die during the check are ignored.
        """
        mine = dict(versions())
        try:
            answers: dict[str, Any] = self._client.run(inspect_worker, list(files), on_error="return")
        except Exception as fault:
            raise self._lost(_first_line(fault)) from None
        died = (import_module("distributed.comm").CommClosedError, ConnectionError, TimeoutError)
        answering = {worker: answer for worker, answer in sorted(answers.items()) if not isinstance(answer, died)}
        if answers and not answering:
            raise self._lost("no worker responds")
        for worker, answer in answering.items():
            if isinstance(answer, BaseException):
                raise BatchFault(
                    Code.CLUSTER, f"the worker {worker} cannot run thingc: {_first_line(answer)}",
                    "install the same versions of thingc and Python on the workers",
                )
            theirs, hashes = answer
            other = sorted(name for name in {*mine, *theirs} if mine.get(name) != theirs.get(name))
            if other:
                found = ", ".join(f"{name} {theirs.get(name, 'none')} instead of {mine.get(name, 'none')}" for name in other)
                raise BatchFault(
                    Code.CLUSTER, f"the worker {worker} has different versions: {found}", "install the same versions on all machines",
                )
            for path, sha256 in files.items():
                if hashes[path] != sha256:
                    problem = "cannot find" if hashes[path] is None else "has different content for"
                    raise BatchFault(
                        Code.CLUSTER, f"the worker {worker} {problem} `{path}`",
                        "store the documents and the batch folder on a shared file system, or use --ship",
                    )

    def fault(self) -> BatchFault | None:
        """Return an error if the scheduler has ended, or if the cluster has not had any workers for `PATIENCE` seconds.

        Return None if the cluster can still return results. This method also updates the number of workers.
        """
        if self._client.status != "running":
            return self._lost("the connection was closed")
        now = time.monotonic()
        if now - self._last_poll < LOOK:
            return None
        try:
            threads = sum(self._client.nthreads().values())
        except Exception as fault:
            return self._lost(_first_line(fault))
        self._last_poll = now
        self.ahead = self._jobs or 2 * max(1, threads)
        if threads:
            self._without_workers_since = None
        elif self._without_workers_since is None:
            self._without_workers_since = now
        elif now - self._without_workers_since > PATIENCE:
            return BatchFault(
                Code.CLUSTER, f"the scheduler at `{self.address}` has had no worker for {PATIENCE:g} s",
                "start workers, and continue with --resume",
            )
        return None

    def ship(self, name: str, transfer: WorkspaceArchive) -> None:
        """Send a workspace to all workers, including workers that connect later.

        Before sending the workspace, remove the workspaces of batches that have ended. Raises `BatchFault` if a worker cannot unpack the
        workspace.
        """
        from thingc.batch.cluster.dask_plugin import UnpackedWorkspace

        for plugin in self._abandoned_workspaces():
            self._unregister(plugin)
        try:
            self._client.register_plugin(UnpackedWorkspace(name, transfer), name=self._plugin(name))
        except Exception as fault:
            self.unship(name)
            raise BatchFault(
                Code.CLUSTER, f"a worker cannot receive the workspace: {_first_line(fault)}",
                "free disk space in the folder `--local-directory` of each worker",
            ) from None

    def unship(self, name: str) -> None:
        """Remove a workspace from the workers to which it was sent.

        A worker that cannot be reached removes the workspace when the worker ends.
        """
        self._unregister(self._plugin(name))

    def ask(self, worker: str, fn: Callable[..., T], *arguments: Any) -> T:
        """Run the call `fn(*arguments)` on one worker immediately, even if all threads of the worker are busy.

        Raises `WorkerLost` if the worker has ended.
        """
        try:
            if worker in self._client.nthreads([worker]):  # otherwise, the call fails only after half a minute
                answer: T = self._client.run(fn, *arguments, workers=[worker])[worker]
                return answer
        except WorkerLost:
            raise
        except Exception as fault:
            raise WorkerLost(f"the worker {worker} does not respond: {_first_line(fault)}") from None
        raise WorkerLost(f"the connection to the worker {worker} was lost")

    def _plugin(self, name: str) -> str:
        return f"{name}@{self._client.id}"

    def _unregister(self, plugin: str) -> None:
        with contextlib.suppress(Exception):  # the scheduler or a worker is gone
            self._client.unregister_worker_plugin(plugin)

    def _abandoned_workspaces(self) -> list[str]:
        """Return the names of workspaces that were sent by processes that are no longer connected to the scheduler."""

        def names(dask_scheduler: Any) -> list[str]:  # sent as code: thingc need not be installed on the scheduler
            return [
                name for name in dask_scheduler.worker_plugins
                if name.startswith("thingc-") and name.partition("@")[2] not in dask_scheduler.clients
            ]

        with contextlib.suppress(Exception):  # a scheduler may refuse to run code
            return list(self._client.run_on_scheduler(names))
        return []

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Disconnect from the scheduler. The scheduler and its workers continue to run."""
        with contextlib.suppress(Exception):  # the scheduler may be gone
            self._client.close(5.0)

    def _lost(self, reason: str) -> BatchFault:
        return BatchFault(
            Code.CLUSTER, f"the connection to the scheduler at `{self.address}` was lost: {reason}",
            "continue with --resume, with or without --cluster",
        )


def _first_line(fault: BaseException) -> str:
    return next((line.strip() for line in str(fault).splitlines() if line.strip()), type(fault).__name__)

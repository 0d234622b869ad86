"""Build variants on workers without a shared folder.

The driver sends the workspace to each worker once. The class `RemoteExecutor` wraps a cluster, so that a batch can use the cluster like an
executor that writes variants to the batch folder. On a worker, `evaluate_on_worker` builds variants from the unpacked workspace as for a
packed batch: the rows of results contain all files except shared files. The driver fetches shared files in groups of a few megabytes, and
writes the variants. A shared file is fetched only once. A file that the store of the driver contains is not fetched.

    <place>/work/                the unpacked workspace
    <place>/out/assets/<sha256>  shared files
    <place>/aside/a/b/c          working folder of runners if the working folder of the driver is outside the workspace
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import os
import queue
import shutil
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

from msgspec.structs import replace

from thingc.base.diagnostics import Code, shown_path
from thingc.base.frozen_struct import FrozenStruct
from thingc.batch import folder_layout
from thingc.batch.cluster.protocol import Cluster, WorkerLost
from thingc.batch.cluster.workspace_archive import WorkspaceArchive
from thingc.batch.engine import RUNNERS, Cancelled, RunnersBroken, evaluate
from thingc.batch.folder import BatchFault
from thingc.batch.folder_layout import SharedAssets, asset_path, keep_asset, write_variant
from thingc.batch.job import STOPPED, Job, Row, refusal, store_here
from thingc.batch.packed_layout import FILES, SHARED, is_packed
from thingc.batch.variant import Variant
from thingc.geometry.store.local import BlobMissing, Store, StoreUnusable
from thingc.targets.artifact import MANIFEST, Content, StoredArtifact

if TYPE_CHECKING:
    from thingc.batch.cluster.dask_executor import DaskCluster

T = TypeVar("T")

WORK, OUT, ASIDE = "work", "out", os.path.join("aside", "a", "b", "c")
"""Names of the subfolders of the folder into which a workspace is unpacked.

The subfolder `ASIDE` is deeply nested, so that thingc displays paths to the other subfolders as absolute paths.
"""
PULL_BYTES = 8_000_000
"""Maximum total size [bytes] of a group of files that are fetched together. A file that is larger than this size is fetched alone."""
CHUNK_SECONDS = 2.0
"""Target duration [s] for building a chunk of variants.

This duration is longer than for a shared file system, because each chunk needs an additional request.
"""
STOP_TIMEOUT = 30.0
"""Time limit [s] for file transfers that are running when a batch ends."""


# --- on the worker ----------------------------------------------------------------------------------------------------


class WorkerFolder(FrozenStruct):
    """A folder on a worker that contains a workspace, as an absolute path without symbolic links. `worker` is the address of the worker."""

    folder: str
    worker: str


_PLACES: dict[str, WorkerFolder] = {}
"""The folders of this process into which workspaces are unpacked, by the name of the workspace."""
_REFUSED: dict[str, str] = {}
"""The reasons why this process could not unpack workspaces, by the name of the workspace."""


def unpack_workspace(name: str, transfer: WorkspaceArchive, folder: str, worker: str) -> None:
    """Unpack a workspace atomically into the folder of a worker.

    Raises `OSError` if writing fails, and `ValueError` for a damaged archive.
    """
    place = os.path.join(os.path.realpath(folder), name)
    fresh = f"{place}.new"
    try:
        transfer.unpack(os.path.join(fresh, WORK))
        for inner in (os.path.join(OUT, folder_layout.ASSETS), ASIDE):
            os.makedirs(os.path.join(fresh, inner))
        os.rename(fresh, place)
    except BaseException as fault:
        shutil.rmtree(fresh, ignore_errors=True)
        _REFUSED[name] = refusal(fault) if isinstance(fault, OSError) else str(fault)
        raise
    _PLACES[name] = WorkerFolder(folder=place, worker=worker)


def remove_workspace(name: str) -> None:
    """Remove the workspace of a batch from a worker. Builds in progress fail, because the batch no longer needs their results."""
    place = _PLACES.pop(name, None)
    _REFUSED.pop(name, None)
    if place is None:
        return
    old = f"{place.folder}.old"
    with contextlib.suppress(OSError):
        os.rename(place.folder, old)
        shutil.rmtree(old, ignore_errors=True)
    RUNNERS.close()  # these runners worked in the folder


def _worker_folder(name: str) -> WorkerFolder:
    place = _PLACES.get(name)
    if place is None:
        raise WorkerLost("the worker has no workspace")
    return place


class Answer(FrozenStruct):
    """The data that a worker returns for a chunk: a row of results for each variant, as for a packed batch."""

    place: WorkerFolder
    rows: list[Row]


def evaluate_on_worker(name: str, job: str, tasks: Sequence[Variant], timeout: float) -> Answer:
    """Build the variants of a chunk on a worker, as `engine.evaluate` does on this machine.

    `job` is a string that `RemoteExecutor` has encoded, in which paths are relative to the workspace. Raises `WorkerLost` if the workspace
    is missing, and `RunnersBroken` if runner processes cannot be started.
    """
    if name in _REFUSED:  # otherwise, a worker that connects later would fail for every chunk
        raise RunnersBroken(f"a worker cannot unpack the workspace: {_REFUSED[name]}", "")
    place = _worker_folder(name)

    def check_workspace(row: Row) -> None:
        _worker_folder(name)  # this raises an exception if the batch has ended

    return Answer(place=place, rows=evaluate(_localize(job, place), tasks, timeout, check_workspace))


def _localize(job: str, place: WorkerFolder) -> str:
    """Replace the relative paths in a job by paths on the worker. If the job does not specify a store, the store of the worker is used."""
    decoded = Job.decode(job)
    work = os.path.join(place.folder, WORK)
    cwd = os.path.join(work, decoded.cwd) if decoded.cwd is not None else ""
    return replace(
        decoded, assembly=os.path.join(work, decoded.assembly), folder=os.path.join(place.folder, OUT),
        cwd=cwd if os.path.isdir(cwd) else os.path.join(place.folder, ASIDE),
        store=store_here(decoded.store),
    ).encode()


def read_shared_files(name: str, shared: Sequence[str], max_bytes: int) -> list[bytes]:
    """Return the contents of the first shared files on a worker, at most `max_bytes` bytes, but at least one file.

    `shared` contains the SHA-256 of the files. Raises `WorkerLost` if the worker no longer has the files.
    """
    assets = SharedAssets(os.path.join(_worker_folder(name).folder, OUT))
    contents: list[bytes] = []
    try:
        for sha256 in shared:
            if contents and sum(map(len, contents)) + os.path.getsize(asset_path(assets.folder, sha256)) > max_bytes:
                break
            contents.append(assets.read(sha256))
    except OSError as fault:
        raise WorkerLost(str(fault)) from None
    return contents


# --- on the driver ----------------------------------------------------------------------------------------------------


class RemoteExecutor(Cluster):
    """An executor for a cluster whose workers do not share a file system with this machine.

    `folder` is the folder of the batch, and `store` is the store of the driver. The workspace has the name `name` on the workers. The
    method `submit` accepts only the function `evaluate`. The returned future is done when the variants have been written. On entry, the
    context manager raises `BatchFault` if a worker cannot unpack the workspace. On exit, the context manager does not close the cluster.
    """

    chunk_seconds = CHUNK_SECONDS

    def __init__(self, cluster: DaskCluster, transfer: WorkspaceArchive, folder: str, store: Store) -> None:
        self.cluster = cluster
        self.transfer = transfer
        self.folder = folder
        self.store = store
        self.name = f"thingc-{transfer.sha256[:12]}-{os.urandom(6).hex()}"
        self._arrived: queue.SimpleQueue[tuple[Future[Any], Future[Answer]] | None] = queue.SimpleQueue()
        self._stopping = False
        self._thread = threading.Thread(target=self._receive, name="thingc-shipping", daemon=True)

    def __enter__(self) -> RemoteExecutor:
        self.cluster.ship(self.name, self.transfer)
        self._thread.start()
        return self

    @property
    def ahead(self) -> int:  # type: ignore[override]
        """The maximum number of chunks that the cluster runs at the same time."""
        return self.cluster.ahead

    def fault(self) -> BatchFault | None:
        """Return the error of the cluster or None, as described for `Cluster.fault`."""
        return self.cluster.fault()

    def submit(self, fn: Callable[..., T], /, *arguments: Any, **named: Any) -> Future[T]:
        """Build the variants of a chunk on a worker, and then write these variants to the folder of the batch on this machine."""
        if fn is not evaluate or named:
            raise TypeError("shipped workspaces can only evaluate chunks")
        job, tasks, timeout = arguments
        outer: Future[T] = Future()
        inner = self.cluster.submit(evaluate_on_worker, self.name, self._sent_job(job), tasks, timeout)
        outer.add_done_callback(lambda inner_future: inner.cancel() if inner_future.cancelled() else None)
        inner.add_done_callback(lambda inner_future: self._arrived.put((outer, inner_future)))
        return outer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Stop writing variants on this machine, and remove the workspace from the workers."""
        self._stopping = True
        self._arrived.put(None)
        if self._thread.is_alive():
            self._thread.join(STOP_TIMEOUT)
        self.cluster.unship(self.name)

    def _sent_job(self, text: str) -> str:
        """Convert a job so that a worker can use it.

        Paths in the converted job are relative to the workspace, and a store on this machine is omitted. Rows contain files.
        """
        job = Job.decode(text)
        root, cwd = os.path.realpath(self.transfer.root), os.path.realpath(os.getcwd())
        inside = os.path.join(cwd, "").startswith(os.path.join(root, ""))
        return replace(
            job, assembly=os.path.relpath(job.assembly, self.transfer.root), folder=None,
            packed=True, cwd=os.path.relpath(cwd, root) if inside else None,
            store=job.store if job.store is not None and "://" in job.store else None,
        ).encode()

    # --- results, all in one thread ---------------------------------------------------------------------------------

    def _receive(self) -> None:
        while (arrived := self._arrived.get()) is not None:
            outer, inner = arrived
            if self._stopping or not outer.set_running_or_notify_cancel():
                continue
            try:
                if inner.cancelled():
                    raise Cancelled
                outer.set_result(self._store_answer(inner.result()))
            except BaseException as fault:
                outer.set_exception(fault)

    def _store_answer(self, answer: Answer) -> list[Row]:
        """Write the variants that a worker has built, and return their rows in the same form as a runner process on this machine.

        Raises `WorkerLost` if the worker has ended.
        """
        assets = _AnsweredAssets(self, answer)
        rows: list[Row] = []
        for row_on_worker in answer.rows:
            if self._stopping:
                raise Cancelled
            row: Row = self._replace_paths(row_on_worker, os.path.join(answer.place.folder, WORK))
            rows.append(row)
            if row["status"] == STOPPED:
                row["message"] = f"on the worker {answer.place.worker}: {row['message']}"
            elif row["status"] == "built":
                try:
                    self._keep(row, assets)
                except OSError as fault:
                    rows[-1] = _failed_row(row, refusal(fault))
                except StoreUnusable as fault:
                    rows[-1] = _failed_row(row, f"the cache `{fault.root}` cannot be used: {fault.reason}")
            if rows[-1]["status"] == STOPPED:
                break
        return rows

    def _keep(self, row: Row, assets: _AnsweredAssets) -> None:
        """Write the shared files of a built variant to the folder of the batch. Unless the batch is packed, also write all other files.

        Raises the same errors as `write_variant`.
        """
        for sha256 in row[SHARED].values():
            keep_asset(self.folder, sha256, assets)
        if not is_packed(self.folder):
            sent = {path: base64.b64decode(data) for path, data in row.pop(FILES).items()}
            listed = json.loads(sent[MANIFEST])["files"]
            if any(hashlib.sha256(data).hexdigest() != listed.get(path) for path, data in sent.items() if path != MANIFEST):
                raise WorkerLost(f"the files of the variant `{row['id']}` were damaged during the transfer")
            files: dict[str, Content] = dict(sent)
            files |= {path: StoredArtifact(sha256=sha256, size=0) for path, sha256 in row.pop(SHARED).items()}
            write_variant(self.folder, row["id"], files, SharedAssets(self.folder))

    def _replace_paths(self, value: Any, work: str, key: str = "") -> Any:
        """In a row of results, replace all paths on the worker by paths on this machine. `key` is the key of the value in its mapping."""
        if isinstance(value, dict):
            return {name: inner if name == FILES else self._replace_paths(inner, work, name) for name, inner in value.items()}
        if isinstance(value, list):
            return [self._replace_paths(inner, work) for inner in value]
        if not isinstance(value, str) or work not in value:
            return value
        text = value.replace(work, self.transfer.root)
        return shown_path(text) if key == "file" else text


def _failed_row(row: Row, message: str) -> Row:
    return {"index": row["index"], "id": row["id"], "status": STOPPED, "code": Code.OUTPUT.code, "message": message}


class _AnsweredAssets:
    """Reads the shared files of the variants that a worker has built.

    Each file is read from the store of the driver, or fetched from the worker together with other files.
    """

    def __init__(self, shipping: RemoteExecutor, answer: Answer) -> None:
        self.shipping = shipping
        self.answer = answer
        self._fetched: dict[str, bytes] = {}

    @cached_property
    def _missing(self) -> list[str]:
        """The SHA-256 of all files that this machine does not have, and that have not been fetched yet."""
        used = dict.fromkeys(sha256 for row in self.answer.rows for sha256 in row.get(SHARED, {}).values())
        folder, store = self.shipping.folder, self.shipping.store
        return [sha256 for sha256 in used if not os.path.exists(asset_path(folder, sha256)) and not store.has(sha256)]

    def read(self, sha256: str) -> bytes:
        """Return the content of a shared file with this SHA-256.

        Raises `WorkerLost` if the worker has ended, and `StoreUnusable` if the store cannot be read.
        """
        if sha256 not in self._fetched and sha256 not in self._missing:
            with contextlib.suppress(BlobMissing):
                return self.shipping.store.read(sha256)
        if sha256 not in self._fetched:
            self._fetch([sha256, *(other for other in self._missing if other != sha256)])
        return self._fetched.pop(sha256)

    def _fetch(self, group: Sequence[str]) -> None:
        """Fetch the first files of a group from the worker."""
        contents = self.shipping.cluster.ask(self.answer.place.worker, read_shared_files, self.shipping.name, group, PULL_BYTES)
        for sha256, data in zip(group, contents):
            if hashlib.sha256(data).hexdigest() != sha256:
                raise WorkerLost(f"the shared file `{sha256}` was damaged during the transfer")
            self._fetched[sha256] = data
        self._missing[:] = [digest for digest in self._missing if digest not in self._fetched]

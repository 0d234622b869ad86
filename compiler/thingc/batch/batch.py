"""Run a batch: submit the variants in chunks to an executor, and record the result of each variant in the journal of the batch."""

from __future__ import annotations

import contextlib
import os
import queue
import shlex
import signal
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, shown_path
from thingc.batch import folder as folders, folder_layout
from thingc.batch.build_records import lengths_in, losses, outcomes
from thingc.batch.cluster.dask_executor import DaskCluster
from thingc.batch.cluster.protocol import Cluster
from thingc.batch.cluster.remote_workers import RemoteExecutor
from thingc.batch.cluster.workspace_archive import WorkspaceArchive, pack
from thingc.batch.engine import RUNNERS, Cancelled, LocalExecutor, RunnersBroken, evaluate
from thingc.batch.folder_layout import Journal, Line
from thingc.batch.job import STOPPED, Row, describe, digest_files, job_of, row
from thingc.batch.packed_layout import PackedWriter, sealed_path
from thingc.batch.page import parameter_columns, show, write_page
from thingc.batch.pictures import OnPicture, usual
from thingc.batch.planning import Plan
from thingc.batch.progress import Interrupted, OnProgress, Progress, Summary
from thingc.batch.run_options import check, check_engine, read_plan
from thingc.batch.tables import Column, columns, write_tables
from thingc.batch.variant import Variant
from thingc.driver.environment import Options, store_of
from thingc.targets.artifact import HOW

TIMEOUT = 600.0
"""Default time limit [s] for one variant."""
SHARE = 64
"""Default of `verify`: MuJoCo compiles one out of this many models that differ only in numbers."""
ANEW = "run the command without --resume"
"""Help text of the error for a missing batch, which suggests a run without `--resume`."""
ATTEMPTS = 3
"""Number of attempts to build a variant whose result an executor has lost."""
PIECES = 8
"""Number of smaller chunks into which a lost chunk is split.

If a single variant causes the loss of its chunk, fewer other variants are lost with the smaller chunks.
"""
CHANCE = frozenset((Code.PART_CRASHED.code, Code.PART_HUNG.code))
"""Codes of part errors that can be caused by the machine instead of the part."""
REFRESH = 30.0
"""Minimum interval [s] between updates of the tables during a run. The interval is longer for long tables."""


def run(
    document: str, *, output: str | None = None, executor: Executor | None = None, jobs: int = 0, emit: Sequence[str] | str = (),
    limit: int | None = None, resume: bool = False, timeout: float = TIMEOUT, verify: int = SHARE, options: Options | None = None,
    on_progress: OnProgress | None = None, pictures: int | None = 0, on_picture: OnPicture | None = None, ship: bool = False,
    retry: bool = False, layout: str | None = None,
) -> Summary:
    """Build the variants of a `variants/1` document into `<output>/<name>/`. By default, `output` is the build folder of the workspace.

    Args:
        executor: An executor that calls `thingc.batch.engine.evaluate`, such as the result of `thingc.batch.cluster.connection.connect`.
            The workers of the executor must find the documents and the folder at the same paths, unless `ship` is set. If `executor` is
            None, use runner processes on this machine.
        jobs: Number of runner processes (0: one per core). With an `executor`, this is the number of chunks that run at the same time.
        emit: Targets that replace the targets of the document.
        limit: Build only this many variants, in order.
        resume: Continue an interrupted batch.
        timeout: Time limit [s] for one variant.
        verify: If models differ only in numbers, MuJoCo compiles one in `verify` models (1: each, 0: none).
        options: Options of the compiler, such as the store.
        on_progress: Callback for the progress of the batch.
        pictures: Maximum number of pictures on the page (`pictures.ALL`: all; None: 48, or none for more than 200 variants).
        on_picture: Callback for each rendered picture.
        ship: Copy the workspace to the workers, and copy built variants back. The cluster must support such transfers, as dask does.
        retry: With `resume`, also retry variants that failed, and variants that were refused because a part crashed or hung.
        layout: `folders` or `packed`, which replaces the layout of the document (default: `packed` for more than 2000 variants).

    Raises `PlanError` for a document with errors, `BatchFault` if the batch cannot start or continue, and `Interrupted` after SIGINT or
    SIGTERM. Use `resume` to continue an interrupted batch.
    """
    check(jobs, limit, timeout, verify, pictures, layout)
    if retry and not resume:
        raise folders.BatchFault(Code.COMMAND_LINE, "--retry requires --resume", "add --resume")
    options = options or Options()
    plan = read_plan(document, options, emit, layout)
    check_engine(executor, ship)
    folder = plan.folder_in(output)
    if resume:
        folders.read_description(plan.relative, folder, ANEW)
    transfer = pack(plan, folder) if ship else None
    try:
        with folders.lock_folder(folder):
            count = plan.count if limit is None else min(limit, plan.count)
            batch = _Batch(
                plan=plan, folder=folder, options=options, count=count, jobs=jobs or os.cpu_count() or 1, timeout=timeout, verify=verify,
                transfer=transfer, on_progress=on_progress,
            )
            batch.prepare(resume=resume, retry=retry)
            with folders.clear_in_background(folder):
                with batch.journal() as journal:
                    summary = batch.run(executor, journal)
                warning = batch.show(pictures, on_picture)
            return summary if warning is None else replace(summary, notes=(*summary.notes, warning))
    except OSError as fault:
        raise folders.explain_os_error(folder, fault) from fault


@dataclass(slots=True)
class _Chunk:
    """A group of variants that is submitted to an executor in a single call."""

    variants: list[Variant]
    attempts: int = 0


class _Stopped(Exception):
    """Raised after SIGINT or SIGTERM, so that no further variants are submitted."""


@dataclass(kw_only=True, eq=False)
class _Batch:
    """A single run of a batch, which submits variants and records their results in the thread that calls `run`.

    `count` is the number of variants to build, and `jobs` the number of runner processes or chunks that run in parallel. The function `run`
    documents the other options. `done` has a flag for each variant that needs no further attempt. `earlier` and `counts` count the variants
    by status, in earlier runs and in this run. `spent` [s] and `measured` are the total build time and the number of built variants.
    `previous` is the content of `batch.json` in a resumed batch.
    """

    plan: Plan
    folder: str
    options: Options
    count: int
    jobs: int
    timeout: float
    verify: int
    transfer: WorkspaceArchive | None
    on_progress: OnProgress | None
    earlier: Counter[str] = field(default_factory=Counter)
    counts: Counter[str] = field(default_factory=Counter)
    modelled: set[str] = field(default_factory=set)
    stopping: bool = False
    started: float = field(default_factory=time.monotonic)
    last_report: float = 0.0
    first_result: tuple[float, int] | None = None
    spent: float = 0.0
    measured: int = 0
    events: queue.SimpleQueue[tuple[str, Any]] = field(default_factory=queue.SimpleQueue)
    submitted: dict[int, Variant] = field(default_factory=dict)
    chunks: dict[Future[Any], _Chunk] = field(default_factory=dict)
    previous: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.done = bytearray(self.count)
        self.parameters = parameter_columns(self.plan)
        self.layout = self.plan.layout or (folders.PACKED if self.plan.count > folders.MANY else folders.FOLDERS)

    # --- the folder -----------------------------------------------------------------------------------------------

    def prepare(self, *, resume: bool, retry: bool) -> None:
        """Create the folder of a new batch, or continue the batch in an existing folder. Raises `BatchFault` if the batch cannot start."""
        if not resume:
            folders.prepare_folder(self.folder, self.plan.relative, self.plan.assembly_relative)
        else:
            self.previous = folders.read_description(self.plan.relative, self.folder, ANEW)
            if self.plan.layout is None:
                self.layout = self.previous["layout"]
            changes = folders.differences(self.previous, self._description(finished=False))
            if changes:
                raise folders.BatchFault(
                    Code.BATCH_CHANGED, f"the batch in `{shown_path(self.folder)}` was started with different input: {'; '.join(changes)}",
                    "undo the change, delete the folder to start again, or use another folder with -o",
                )
            folder_layout.sweep(self.folder)
            self._read_earlier_results(retry=retry)
        folders.write_batch(self.folder, self._description(finished=False))
        folders.create_subfolders(self.folder, self.layout)

    def _description(self, *, finished: bool, table_columns: Sequence[Column] = ()) -> dict[str, Any]:
        return describe(self.plan, layout=self.layout, requested=self.count, finished=finished, table_columns=table_columns)

    def journal(self) -> Journal | PackedWriter:
        """Open the journal of the batch, in which a line is recorded for each finished variant."""
        if self.layout == folders.PACKED:
            return PackedWriter(self.folder, self.done)
        return Journal(os.path.join(self.folder, folder_layout.JOURNAL))

    def _read_earlier_results(self, *, retry: bool) -> None:
        """Read the results of an earlier run of this batch, so that finished variants are not built again.

        If the files of a built variant are missing, the variant is built again. With `retry`, a failed variant is also built again, unless
        its documents caused the failure.
        """
        for index, status, is_final in outcomes(self.folder, chance=_can_succeed_later if retry else None):
            if index < self.count:
                self.done[index] = is_final
                self.earlier.update([status] if is_final else [])

    # --- the run --------------------------------------------------------------------------------------------------

    def run(self, executor: Executor | None, journal: Journal | PackedWriter) -> Summary:
        """Build all variants that are not finished yet.

        Raises `BatchFault` if the batch cannot continue, and `Interrupted` after a signal.
        """
        engine: Executor = executor if executor is not None else LocalExecutor(min(self.jobs, max(1, self.count)))
        cluster = executor if isinstance(executor, Cluster) else None
        if cluster is not None:
            cluster.check(digest_files(self.plan, self.folder) if self.transfer is None else {})
        job = job_of(self.plan, self.folder, self.options, layout=self.layout, verify=self.verify, elsewhere=cluster is not None).encode()
        completed = False
        with self._signals(), self._shipping(cluster) as shipping:
            engine = shipping or engine
            try:
                self._loop(engine, job, journal)
                completed = True
            except _Stopped:
                pass  # the signal is raised below, after the runners have ended: until then, runners finish variants
            finally:
                if executor is None:
                    engine.shutdown(wait=True, cancel_futures=not completed)
                else:
                    for future in list(self.chunks):
                        future.cancel()
                    RUNNERS.close()  # an executor with threads has used the runners of this process
                if not completed:
                    self._drain(journal)
                    with contextlib.suppress(OSError):  # a full disk was already reported
                        write_page(self.folder, self._description(finished=False), self._columns())
            if not completed:
                raise Interrupted(self.folder, self._total(), self.count)
            if executor is not None:
                folder_layout.sweep(self.folder)  # temporary files of workers that died
            journal.sync()
            folders.write_batch(self.folder, self._description(finished=True, table_columns=self._tables()))
        statuses = self.earlier + self.counts
        lossy, total = losses(self.folder)
        return Summary(
            folder=self.folder, name=self.plan.name, count=self.count, statuses=dict(sorted(statuses.items())),
            before=sum(self.earlier.values()), modelled=len(self.modelled), duplicates=self.plan.written - self.plan.count,
            seconds=time.monotonic() - self.started, lossy=lossy,
            losses={kind: total[kind] for kind in HOW if total[kind]}, notes=self.plan.notes, layout=self.layout,
        )

    def _tables(self) -> tuple[Column, ...]:
        """Write the tables of results, unless they are up to date. Return the columns of the tables."""
        names = folder_layout.TABLE_CSV, folder_layout.TABLE_PARQUET
        if not self.counts and self.previous.get("finished") and folders.are_unchanged(self.folder, *names):
            return tuple(Column(name=column["name"], kind=column["kind"], unit=column["unit"]) for column in self.previous["columns"])
        written_columns = write_tables(self.folder, self.parameters, self.plan.choice_paths)
        folders.record_states(self.folder, *names)
        return written_columns

    def _shipping(self, cluster: Cluster | None) -> contextlib.AbstractContextManager[RemoteExecutor | None]:
        """Return an executor that copies the workspace to a cluster, and copies built variants back.

        Return None if the option `ship` is not set.
        """
        if self.transfer is None or not isinstance(cluster, DaskCluster):
            return contextlib.nullcontext()
        return RemoteExecutor(cluster, self.transfer, self.folder, store_of(self.options))

    def show(self, pictures: int | None, on_picture: OnPicture | None) -> Diagnostic | None:
        """Render pictures of variants, and write the HTML page of the finished batch.

        Return a warning if this machine cannot render pictures.
        """
        return show(
            self.folder, self._description(finished=True), self._columns(),
            max_pictures=usual(self.count) if pictures is None else pictures, jobs=os.cpu_count() or 1, on_picture=on_picture,
        )

    def _columns(self) -> tuple[Column, ...]:
        return columns(self.parameters, self.plan.choice_paths, lengths_in(self.folder))

    def _loop(self, engine: Executor, job: str, journal: Journal | PackedWriter) -> None:
        waiting = self._remaining(journal)
        exhausted = False
        refreshed, pause = time.monotonic(), REFRESH
        while True:
            while not exhausted and len(self.chunks) < self._queue_size(engine):
                variants = list(islice(waiting, self._chunk_size(engine)))
                exhausted = not variants
                if variants:
                    self._submit(engine, job, _Chunk(variants))
            self._report_progress()
            if exhausted and not self.chunks:
                break
            with contextlib.suppress(queue.Empty):
                self._handle(*self.events.get(timeout=1.0), engine, job, journal)
            _check_cluster(engine)
            now = time.monotonic()
            if now - refreshed > pause:
                write_tables(self.folder, self.parameters, self.plan.choice_paths)
                refreshed = time.monotonic()
                pause = max(REFRESH, 20.0 * (refreshed - now))
        self._report_progress(last=True)

    def _remaining(self, journal: Journal | PackedWriter) -> Iterator[Variant]:
        """Yield the variants that must be built, in the order of the plan.

        Variants that violate a rule on parameters are recorded in the journal, but not yielded.
        """
        if all(self.done):
            return
        for variant in self.plan.unfinished_variants(self.done):
            if variant.index >= self.count:
                return
            if variant.failed is not None:
                self._write_line(journal, variant, {"status": "kept_out", "rule": variant.failed})
                if self.stopping:  # no events are handled while only rules are evaluated
                    raise _Stopped
                self._report_progress()
                continue
            yield variant

    def _queue_size(self, engine: Executor) -> int:
        """Return the maximum number of chunks that are submitted to the executor at the same time."""
        return engine.ahead if isinstance(engine, Cluster) else 2 * self.jobs

    def _chunk_size(self, engine: Executor) -> int:
        """Return the number of variants in the next chunk.

        The number is chosen so that building the chunk takes about the target duration, and that all runners have work until the end of the
        batch.
        """
        sizes = engine if isinstance(engine, Cluster) else Cluster
        fair = max(1, (self.count - self._total() - len(self.submitted)) // self._queue_size(engine))
        if not self.measured:
            return min(sizes.first, fair)
        return max(1, min(sizes.chunk_most, fair, int(sizes.chunk_seconds * self.measured / max(self.spent, 1e-6))))

    def _submit(self, engine: Executor, job: str, chunk: _Chunk) -> None:
        chunk.attempts += 1
        self.submitted.update((variant.index, variant) for variant in chunk.variants)
        on_row = (lambda result: self.events.put(("row", result)),) if isinstance(engine, LocalExecutor) else ()
        future = engine.submit(evaluate, job, chunk.variants, self.timeout, *on_row)
        self.chunks[future] = chunk
        future.add_done_callback(lambda completed: self.events.put(("done", completed)))

    def _handle(self, event: str, content: Any, engine: Executor, job: str, journal: Journal | PackedWriter) -> None:
        if event == "signal":
            raise _Stopped
        if event == "row":
            self._record_result(journal, content)
            return
        chunk = self.chunks.pop(content, None)
        if chunk is None:
            return
        fault = content.exception() if not content.cancelled() else Cancelled()
        if fault is None:
            for result in content.result():
                self._record_result(journal, result)
            return
        if isinstance(fault, RunnersBroken):
            raise folders.BatchFault(Code.RUNNERS, str(fault), "fix the reported problem, and continue with --resume", fault.detail)
        _check_cluster(engine)
        unfinished = [variant for variant in chunk.variants if variant.index in self.submitted]
        if chunk.attempts < ATTEMPTS:
            size = max(1, -(-len(unfinished) // PIECES))
            for k in range(0, len(unfinished), size):
                self._submit(engine, job, _Chunk(unfinished[k : k + size], chunk.attempts))
            return
        for variant in unfinished:
            message = f"the executor lost the variant {ATTEMPTS} times: {type(fault).__name__}: {' '.join(str(fault).split())}"
            self._record_result(journal, row(variant, "failed", code=Code.VARIANT_DIED.code, message=message))

    def _record_result(self, journal: Journal | PackedWriter, row: Row) -> None:
        """Record the result of a variant in the journal. Ignore the new result if the variant already has a result."""
        variant = self.submitted.get(row["index"])
        if variant is None:
            return
        if row["status"] == STOPPED:
            raise folders.BatchFault(
                Code.OUTPUT, f"the batch cannot continue: {row['message']}",
                "fix the problem, and continue with --resume",
            )
        self.spent += row.get("seconds", 0.0)
        self.measured += 1
        self.modelled.update(row.get("modelled", ()))
        self._write_line(journal, variant, row)
        if self.first_result is None:
            self.first_result = (time.monotonic(), sum(self.counts.values()))
        del self.submitted[row["index"]]

    def _write_line(self, journal: Journal | PackedWriter, variant: Variant, row: Row) -> None:
        path = sealed_path(variant.index) if self.layout == folders.PACKED else f"{folder_layout.VARIANTS}/{variant.id}"
        line = {
            "index": variant.index, "id": variant.id, "name": variant.name, "status": row["status"],
            "parameters": dict(variant.values), "choices": self.plan.choices_of(variant),
            **{key: value for key, value in row.items() if key not in ("index", "id", "status")},
            "path": path if row["status"] == "built" else None,
            "command": shlex.join(self.plan.command(variant)),
        }
        journal.append(line)
        self.done[variant.index] = True
        self.counts[row["status"]] += 1

    def _drain(self, journal: Journal | PackedWriter) -> None:
        """Record the results of all variants that were finished before the runner processes were ended."""
        with contextlib.suppress(queue.Empty, folders.BatchFault, OSError):
            while True:
                event, row = self.events.get_nowait()
                if event == "row" and row["status"] != STOPPED:
                    self._record_result(journal, row)

    # --- progress and signals -----------------------------------------------------------------------------------------

    def _report_progress(self, *, last: bool = False) -> None:
        """Report the progress of the batch to the caller, at most five times per second unless `last` is true."""
        now = time.monotonic()
        if self.on_progress is not None and (last or now - self.last_report > 0.2):
            self.last_report = now
            rate = 0.0
            if self.first_result is not None and now > self.first_result[0]:  # this excludes the time to start the runners
                rate = (sum(self.counts.values()) - self.first_result[1]) / (now - self.first_result[0])
            self.on_progress(Progress(count=self.count, before=sum(self.earlier.values()), counts=dict(self.counts), rate=rate))

    @contextlib.contextmanager
    def _signals(self) -> Iterator[None]:
        """Handle the signals SIGINT and SIGTERM while the context is active. Signals never interrupt the writing of a journal line."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def stop(number: int, frame: object) -> None:
            self.stopping = True
            self.events.put(("signal", number))

        previous_handlers = {signal_number: signal.signal(signal_number, stop) for signal_number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for signal_number, handler in previous_handlers.items():
                signal.signal(signal_number, handler)

    def _total(self) -> int:
        return sum(self.earlier.values()) + sum(self.counts.values())


def _can_succeed_later(line: Line) -> bool:
    """Return whether another attempt to build a variant can succeed: it failed, or a part crashed or hung."""
    return bool(line["status"] == "failed" or line["status"] == "refused" and line["code"] in CHANCE)


def _check_cluster(engine: Executor) -> None:
    """Raise `BatchFault` if the executor is a cluster that no longer responds."""
    fault = engine.fault() if isinstance(engine, Cluster) else None
    if fault is not None:
        raise fault

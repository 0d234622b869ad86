"""What a document is compiled in: its workspace, the store, whoever answers for parts, and what is said of the documents."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

from msgspec.structs import replace

from thingc.base.diagnostics import Report, Severity
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace
    from thingc.geometry.client import Workers
    from thingc.geometry.lock.lock import Lock
    from thingc.geometry.part_source import PartSource
    from thingc.geometry.service import GeometryService
    from thingc.geometry.store.local import Store

Progress = Callable[[str, int, int], None]
"""`progress(what, done, total)`: called while parts are modelled."""

Printed = Callable[[str, Sequence[str]], None]
"""`printed(part, lines)`: called with what a part prints, when it has been modelled. The lines are as the part has written them."""

Lend = Callable[["Workspace", "Store"], "PartSource"]
"""`lend(workspace, store)`: who answers for the parts of a workspace, and is ended by somebody else."""

Answer = TypeVar("Answer")


class Options(FrozenStruct):
    """How to compile. `parameters` are texts as on the command line (`{"reach": "120 mm"}`), `choices` texts by dotted path in
    the document (`{"components.foot.part": "feet:Wide"}`); `store` a folder or a URL (None: the user's cache); `jobs` how many parts are
    modelled at once; `part_timeout` [s] (None: the workspace's); `compat` the programs besides MuJoCo that read its models (None: those of
    the workspace).

    `lock`: what the store does not hold may come from `parts.lock.json`, for callers who need no meshes. Without `code` it comes
    from there alone: nothing of the workspace is run, and the store is not touched.

    `texts`: what documents and workspace files hold instead of what is on disk, by absolute path. `ahead`: modules that what follows the
    compilation will need, which are imported while the kernel loads, where it does."""

    parameters: Mapping[str, str] = {}
    choices: Mapping[str, str] = {}
    store: str | None = None
    jobs: int = 0
    part_timeout: float | None = None
    compat: Sequence[str] | None = None
    progress: Progress | None = None
    printed: Printed | None = None
    lock: bool = False
    code: bool = True
    texts: Mapping[str, bytes] = {}
    ahead: Sequence[str] = ()


class Environment:
    """What compilations of one document share, whatever they set. A context manager: leaving it ends who answers for parts, unless that
    was lent.

    `workspace` is None where none was found; `report` has what is said of the documents themselves, `memo` what passes need not work
    out again.
    """

    def __init__(self, document: str, options: Options, lend: Lend | None = None, memo: Memo | None = None) -> None:
        from thingc.documents.workspace import Workspace

        self.started = time.time_ns()
        self.document = os.path.abspath(document)
        self.options = options
        self.report = Report()
        self.memo = memo if memo is not None else Memo()
        self.workspace: Workspace | None = Workspace.find(self.document, self.report, options.texts)
        self._lent = lend
        self._lock_report = Report()

    def __enter__(self) -> Environment:
        return self

    def __exit__(self, *exception: object) -> None:
        if "parts" in self.__dict__ and self._lent is None:
            self.parts.close()

    @cached_property
    def compat(self) -> tuple[str, ...]:
        """The programs besides MuJoCo that read its models: those of the options, else the workspace's."""
        own = self.workspace.compat if self.workspace is not None else ()
        return own if self.options.compat is None else tuple(self.options.compat)

    @cached_property
    def store(self) -> Store:
        """The content-addressed store."""
        return store_of(self.options)

    @cached_property
    def parts(self) -> PartSource:
        """Who answers for parts: the geometry service, or, where no code may run, the lock. Only where there is a workspace."""
        assert self.workspace is not None, "parts belong to a workspace, and none was found"
        if self._lent is not None:
            return self._lent(self.workspace, self.store)
        if self.options.code:
            return geometry_of(self.workspace, self.options, self.store, self._lock if self.options.lock else None)
        from thingc.geometry.lock.reader import LockOnlyGeometry

        return LockOnlyGeometry(self.workspace, self._lock())

    @property
    def geometry(self) -> GeometryService:
        """The door to the CAD kernel; only where code of the workspace may run."""
        from thingc.geometry.service import GeometryService

        assert isinstance(self.parts, GeometryService), "no code of the workspace may run"
        return self.parts

    def _lock(self) -> Lock | None:
        """The workspace's lock; None where there is none or it is broken, which is said where nothing else may answer."""
        from thingc.geometry.lock.lock import read_lock, report_missing

        assert self.workspace is not None
        report = self._lock_report if self.options.code else self.report
        lock = read_lock(self.workspace, report)
        if lock is None and not self.options.code:
            report_missing(self.workspace, report)
        return lock

    def say_gaps(self, report: Report) -> None:
        """What the lock could not tell of the parts realized last, and what is wrong with it: a warning where code may run, for
        then it is not needed."""
        from thingc.geometry.part_source import report_gaps

        severity = Severity.WARNING if self.options.code else Severity.ERROR
        report.diagnostics.extend(replace(fault, severity=severity) for fault in self._lock_report.diagnostics)
        report_gaps(self.parts, report, severity=severity)


def attempted(document: str, options: Options, work: Callable[[Environment], Answer]) -> Answer:
    """What `work` answers in an environment; in a second one where a blob of the store turned out to be damaged, for then it is made
    anew."""
    from thingc.geometry.store.local import BlobMissing

    try:
        with Environment(document, options) as environment:
            return work(environment)
    except BlobMissing:
        with Environment(document, options) as environment:
            return work(environment)


def store_of(options: Options) -> Store:
    """The store that the options name, else the user's."""
    from thingc.geometry.store.shared_store import opened

    return opened(options.store)


def geometry_of(
    workspace: Workspace, options: Options, store: Store | None = None, lock: Callable[[], Lock | None] | None = None, *, seed: int = 0,
    workers: Workers | None = None,
) -> GeometryService:
    """The geometry service of a workspace; close it. `lock` reads the lock that may answer beside the store; `seed` is that of the
    workers' hashes; `workers` are somebody else's, who also ends them."""
    from thingc.geometry.service import GeometryService

    return GeometryService(
        workspace, store or store_of(options), jobs=options.jobs or os.cpu_count() or 1,
        timeout=options.part_timeout or workspace.part_timeout, on_progress=options.progress, on_printed=options.printed, workers=workers,
        lock=lock, seed=seed,
    )

"""The environment of a compilation: the workspace, the cache of parts, the geometry service, and the report for diagnostics."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

from msgspec.structs import replace

from thingc.base.diagnostics import Report, Severity
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.progress import Progress

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace
    from thingc.geometry.client import Workers
    from thingc.geometry.lock.lock import Lock
    from thingc.geometry.lock.reader import LockOnlyGeometry
    from thingc.geometry.part_source import PartSource
    from thingc.geometry.service import GeometryService
    from thingc.geometry.store.local import Store

Printed = Callable[[str, Sequence[str]], None]
"""Callback `printed(part, lines)`, which is called after a part has been built, with the lines that the part class printed. The lines can
contain control characters.
"""

PartsProvider = Callable[["Workspace", "Store"], "PartSource"]
"""Function `provider(workspace, store)`, which returns a source of parts that several environments share. The owner of the function must
close the source.
"""

Answer = TypeVar("Answer")


class Options(FrozenStruct):
    """The options of a compilation, with the same meaning as on the command line.

    `parameters` maps names of parameters to strings (`{"reach": "120 mm"}`). `choices` maps paths in the document to strings
    (`{"components.foot.part": "feet:Wide"}`). `store` is the folder or URL of the cache of parts (default: the user's cache). `jobs` is the
    number of parts to build in parallel. `part_timeout` is the time limit [s] for building one part (default: from the workspace). `compat`
    contains the programs besides MuJoCo that must be able to read the MuJoCo models (default: from the workspace).

    With `lock`, parts that are not in the store can be read from `parts.lock.json`, which does not contain meshes. Without `code`, parts
    are read only from `parts.lock.json`: no code of the workspace runs, and the store is not used. `texts` maps absolute paths to contents
    that replace the contents of documents and workspace files on disk. `ahead` contains names of modules that the caller needs after the
    compilation. These modules are imported while the CAD kernel loads.
    """

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


class Environment(AbstractContextManager["Environment"]):
    """The workspace, the parts, the diagnostics and the cache of a compilation. All compilations of a document can share an environment.

    At the end of a `with` statement, the source of parts is closed, unless it comes from `parts_provider`. `workspace` is None if the
    workspace file is invalid. `report` contains the diagnostics of the documents. `memo` caches the results of compiler passes.
    """

    def __init__(self, document: str, options: Options, parts_provider: PartsProvider | None = None, memo: Memo | None = None) -> None:
        from thingc.documents.workspace import Workspace

        self.started = time.time_ns()
        self.document = os.path.abspath(document)
        self.options = options
        self.report = Report()
        self.memo = memo if memo is not None else Memo()
        self.workspace: Workspace | None = Workspace.find(self.document, self.report, options.texts)
        self._parts_provider = parts_provider
        self._lock_report = Report()

    def __exit__(self, *exception: object) -> None:
        if "parts" in self.__dict__ and self._parts_provider is None:
            self.parts.close()

    @cached_property
    def compat(self) -> tuple[str, ...]:
        """The names of the programs besides MuJoCo that must be able to read the MuJoCo models, from the options or the workspace."""
        consumers = self.workspace.compat if self.workspace is not None else ()
        return consumers if self.options.compat is None else tuple(self.options.compat)

    @cached_property
    def store(self) -> Store:
        """The content-addressed store, in which parts and meshes are cached."""
        return store_of(self.options)

    @cached_property
    def parts(self) -> PartSource:
        """The source of part records: the geometry service, or a reader of the lock file if no code may run.

        `workspace` must not be None.
        """
        assert self.workspace is not None, "parts need a workspace, but none was found"
        if self._parts_provider is not None:
            return self._parts_provider(self.workspace, self.store)
        if self.options.code:
            return geometry_of(self.workspace, self.options, self.store, self._lock if self.options.lock else None)
        return self.locked

    @cached_property
    def locked(self) -> LockOnlyGeometry:
        """The reader of the lock file, for lumps, or for all parts if no code may run. `workspace` must not be None."""
        from thingc.geometry.lock.reader import LockOnlyGeometry

        assert self.workspace is not None
        return LockOnlyGeometry(self.workspace, self._lock())

    @property
    def geometry(self) -> GeometryService:
        """The geometry service, which builds parts with the CAD kernel. It is only available if the workspace is allowed to run code."""
        from thingc.geometry.service import GeometryService

        assert isinstance(self.parts, GeometryService), "the geometry service requires permission to run code of the workspace"
        return self.parts

    def _lock(self) -> Lock | None:
        """Read the lock file of the workspace. Return None if the file is missing or invalid.

        If no code may run, the lock file is required, and a missing or invalid file is reported as an error.
        """
        from thingc.geometry.lock.lock import read_lock, report_missing

        assert self.workspace is not None
        report = self._lock_report if self.options.code else self.report
        lock = read_lock(self.workspace, report)
        if lock is None and not self.options.code:
            report_missing(self.workspace, report)
        return lock

    def report_lock_gaps(self, report: Report) -> None:
        """Report the parts of the last compilation that the lock file does not contain, and all errors in the lock file.

        If code of the workspace may run, the lock file is optional, and the diagnostics are warnings.
        """
        from thingc.geometry.part_source import report_gaps

        severity = Severity.WARNING if self.options.code else Severity.ERROR
        report.diagnostics.extend(replace(fault, severity=severity) for fault in self._lock_report.diagnostics)
        report_gaps(self.parts, report, severity=severity)


def with_environment(document: str, options: Options, work: Callable[[Environment], Answer]) -> Answer:
    """Call the function `work` with a new environment for the document, and return its result.

    If the store turns out to be damaged, `work` is called a second time with another new environment, and missing parts are built again.
    """
    from thingc.geometry.store.local import BlobMissing

    try:
        with Environment(document, options) as environment:
            return work(environment)
    except BlobMissing:
        with Environment(document, options) as environment:
            return work(environment)


def store_of(options: Options) -> Store:
    """Open the store that the options specify. The default is the store of the current user."""
    from thingc.geometry.store.shared_store import open_store

    return open_store(options.store)


def geometry_of(
    workspace: Workspace, options: Options, store: Store | None = None, lock: Callable[[], Lock | None] | None = None, *, seed: int = 0,
    workers: Workers | None = None,
) -> GeometryService:
    """Create the geometry service of a workspace. The caller must close the service.

    `lock` is a function that reads the lock file. Parts in the lock file are used if the store does not contain them. `seed` is the hash
    seed of the worker processes. If `workers` is given, several geometry services share these worker processes, and the owner of `workers`
    must close them.
    """
    from thingc.geometry.service import GeometryService

    return GeometryService(
        workspace, store or store_of(options), jobs=options.jobs or os.cpu_count() or 1,
        timeout=options.part_timeout or workspace.part_timeout, on_progress=options.progress, on_printed=options.printed, workers=workers,
        lock=lock, seed=seed,
    )

"""Return schemas and records of parts from the cache and the lock file without waiting for workers.

Background workers compute missing results. This module also provides the names that documents of a workspace can use: available parts,
other documents, and their schemas.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from msgspec.structs import replace

from thingc.base.source import Path
from thingc.documents.workspace import Workspace
from thingc.driver.environment import Options, geometry_of
from thingc.geometry.build_reasons import BuildReason
from thingc.geometry.client import ABSENT, Workers
from thingc.geometry.key.modules import Module
from thingc.geometry.lock.json_format import BadLock
from thingc.geometry.print_slices import Slicing
from thingc.geometry.record import NO_PIECES, FailureKind, Mesh, PartDefinition, PartFailure, PartRecord, PartSchema, WantedPieces
from thingc.geometry.service import GeometryService
from thingc.geometry.store.local import Store, StoreUnusable
from thingc.tools.schemas.refresh_schemas import Schemas

if TYPE_CHECKING:
    from thingc.tools.lsp.analysis import Analysis

_T = TypeVar("_T")

PENDING: FailureKind = "unlocked"
"""The kind of failure of a part whose result is still missing. If part code may run, no other failure has this kind."""


@dataclass(slots=True)
class PendingRequests:
    """Requests to background workers to describe, build and slice parts.

    `references` lists the parts to describe. `definitions` maps the text of each part definition to the definition and to
    the convex decompositions that are needed (see `WantedPieces`). `slices` contains the records to slice.
    """

    references: dict[str, None] = field(default_factory=dict)
    definitions: dict[str, tuple[PartDefinition, tuple[int, ...]]] = field(default_factory=dict)
    slices: dict[str, tuple[PartDefinition, PartRecord, Collection[Slicing]]] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.references or self.definitions or self.slices)

    def within(self, other: PendingRequests) -> bool:
        """Return whether `other` includes all requests of this object."""
        return (
            self.references.keys() <= other.references.keys() and self.definitions.keys() <= other.definitions.keys()
            and self.slices.keys() <= other.slices.keys()
        )

    def add(self, other: PendingRequests) -> None:
        """Add all requests of `other` to this object."""
        self.references.update(other.references)
        self.definitions.update(other.definitions)
        self.slices.update(other.slices)


class CachedParts:
    """Provides part schemas and part records that are already cached. This source of parts does not wait for workers.

    For a part without a cached result, the source returns a failure of kind `PENDING`, and the compiler omits diagnostics that depend on
    the part. `failed` and `undescribed` are failures that the store does not cache, such as crashes and timeouts. `pending` contains the
    requests for missing results.
    """

    def __init__(self, service: GeometryService) -> None:
        self.service = service
        self.workspace: Workspace = service.workspace
        self.unknown: list[str] = []
        self.broken: list[BadLock] = service.broken
        self.failed: dict[str, PartFailure] = {}
        self.undescribed: dict[str, PartFailure] = {}
        self.pending = PendingRequests()

    @property
    def decisions(self) -> Mapping[str, BuildReason]:
        """The reason why each part record was built or taken from the cache, keyed by the text of the part definition."""
        return self.service.decisions

    @property
    def inputs(self) -> frozenset[str]:
        """The absolute paths of all files on which the results depend, including files that do not exist."""
        return self.service.inputs

    def anticipate(self) -> bool:
        """Do nothing, because this source of parts does not build parts."""
        return False

    def close(self) -> None:
        """Do nothing, because this source of parts does not start workers."""

    def describe(self, references: Sequence[str]) -> dict[str, PartSchema | PartFailure]:
        """Return the schema of each part class, keyed by its reference `module:Class`."""
        answers = _answers(self.service.describe(references), self.undescribed)
        self.pending.references.update((one, None) for one in references if _is_pending(answers.get(one)))
        return answers

    def hiding(self, reference: str) -> tuple[Module, ...]:
        """Return the modules on which the part `module:Class` depends, and which shadow other modules of the same name."""
        return self.service.hiding(reference)

    def realize(
        self, definitions: Sequence[PartDefinition], convex: WantedPieces = NO_PIECES, likely: object = None,
    ) -> dict[str, PartRecord | PartFailure]:
        """Return the part record for each part definition, keyed by the text of the definition."""
        answers = _answers(self.service.realize(definitions, convex), self.failed)
        waited_for = [one for one in definitions if _is_pending(answers.get(one.text))]
        self.pending.definitions.update((one.text, (one, convex.get(one.text, ()))) for one in waited_for)
        return answers

    def decompose(self, meshes: Collection[tuple[str, int]]) -> Mapping[tuple[str, int], tuple[Mesh, ...] | PartFailure]:
        """Return the convex pieces that are already cached. Other meshes are omitted."""
        return {mesh: pieces for mesh, pieces in self.service.decompose(meshes).items() if not isinstance(pieces, PartFailure)}

    def slice(
        self, definitions: Sequence[PartDefinition], records: Mapping[str, PartRecord | PartFailure],
        wanted: Mapping[str, Collection[Slicing]],
    ) -> dict[str, PartRecord | PartFailure]:
        """Return the part `records` with the results of the requested slicings, keyed by definition text."""
        answers = _answers(self.service.slice(definitions, records, wanted), self.failed)
        for one in definitions:
            record = records.get(one.text)
            if isinstance(record, PartRecord) and _is_pending(answers.get(one.text)):
                self.pending.slices[one.text] = (one, record, wanted[one.text])
        return answers


def _answers(answers: Mapping[str, _T | PartFailure], failed: Mapping[str, PartFailure]) -> dict[str, _T | PartFailure]:
    return {
        name: failed.get(name, replace(answer, kind=PENDING)) if isinstance(answer, PartFailure) and answer.kind == ABSENT else answer
        for name, answer in answers.items()
    }


def _is_pending(answer: object) -> bool:
    return isinstance(answer, PartFailure) and answer.kind == PENDING


class AvailableNames:
    """The names of parts and of other documents that the documents of one workspace can use.

    `cached_parts` is the source of parts, or None if part code must not run. Without a source of parts, only parts that a document uses are
    known. The function `wake` is called when there are new requests for workers. The methods for parts have the form that `AvailableParts`
    specifies. Workers compute missing schemas, but no records.
    """

    def __init__(self, workspace: Workspace, cached_parts: CachedParts | None, wake: Callable[[], None]) -> None:
        self.workspace = workspace
        self.cached_parts = cached_parts
        self._wake = wake
        self._schemas = Schemas(workspace, self)

    def schema_of(self, analysis: Analysis, scalars: Mapping[Path, str]) -> dict[str, Any] | None:
        """Return the JSON Schema of a document, or None if the file is not a document.

        For a document that has never been well-formed, return the general schema for the kind of document in `scalars`.
        """
        tree = analysis.tree
        if tree is None:
            return self._schemas.general(scalars.get(("thingc",), "").partition("/")[0] or "assembly")
        return analysis.compute_once(
            "schema", lambda: self._schemas.schema_of(analysis.path, tree, analysis.model, analysis.records, analysis.schemas),
        )

    def catalogue(self) -> list[str]:
        """Return the references of all part classes that documents can use."""
        return [] if self.cached_parts is None else self.cached_parts.service.catalogue()

    def describe(self, references: Sequence[str]) -> dict[str, PartSchema | PartFailure]:
        """Return the cached schemas of parts. Parts without a cached schema are omitted."""
        answers = {} if self.cached_parts is None else self.cached_parts.describe(references)
        known = {name: one for name, one in answers.items() if not _is_pending(one)}
        if len(known) < len(answers):
            self._wake()
        return known

    def realize(self, definitions: Sequence[PartDefinition]) -> Mapping[str, PartRecord | PartFailure]:
        """Return the cached records of part definitions."""
        return {} if self.cached_parts is None else self.cached_parts.service.realize(definitions)


QUIET = 0.3
"""Time [s] without new requests after which workers build parts. For example, a user who types `120 mm` does not need a part of 1 mm."""
IMPATIENT = 1.0
"""Time [s] after which workers are ended if their requests have become obsolete."""

Answered = Callable[["Workspace", Mapping[str, PartFailure], Mapping[str, PartFailure]], None]
"""Callback `answered(workspace, undescribed, failed)` after all results were stored.

Failures that the store does not cache are passed by reference and by definition text.
"""


class BackgroundWorkers:
    """Sends the most recent requests to worker processes in a thread, and calls `answered` when the results are cached."""

    def __init__(self, workspace: Workspace, store: Store, options: Options, answered: Answered) -> None:
        self.workspace = workspace
        self._store, self._options, self._answered = store, options, answered
        self._workers = Workers(options.jobs or 1)
        self._changed = threading.Condition()
        self._requested = PendingRequests()
        self._running: PendingRequests | None = None
        self._sent = PendingRequests()
        self._ended = False
        self._thread: threading.Thread | None = None

    def request(self, wanted: PendingRequests) -> None:
        """Replace the pending requests by new requests, unless all new requests were already sent to workers."""
        with self._changed:
            if self._ended or wanted == self._requested or wanted.within(self._sent):
                return
            self._requested = wanted
            self._changed.notify_all()
            if self._thread is None and wanted:
                self._thread = threading.Thread(target=self._run, name="workers", daemon=True)
                self._thread.start()
            self._end_obsolete_soon()

    def renew(self) -> None:
        """Discard the record of the requests that were sent to workers, so that the same requests can be sent again.

        Call this method when a Python file that defines parts has been saved.
        """
        with self._changed:
            self._sent, self._requested = PendingRequests(), PendingRequests()
            self._end_obsolete_soon()

    def end(self) -> None:
        """Stop the thread and end the worker processes."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        self._workers.end()

    def _end_obsolete_soon(self) -> None:
        if self._running is not None and not self._running.within(self._requested):
            timer = threading.Timer(IMPATIENT, self._end_obsolete, [self._running])
            timer.daemon = True
            timer.start()

    def _end_obsolete(self, work: PendingRequests) -> None:
        """End the worker processes if they are still processing the obsolete requests `work`."""
        with self._changed:
            if self._running is not work or self._requested is work or self._ended:
                return
            ended, self._workers, self._running = self._workers, Workers(self._options.jobs or 1), None
        ended.end()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._requested or self._ended)
                build_at = time.monotonic() + QUIET
                while not self._ended and self._requested.definitions and self._changed.wait(max(0.0, build_at - time.monotonic())):
                    build_at = time.monotonic() + QUIET
                if self._ended:
                    return
                work = self._running = self._requested
                workers = self._workers
            undescribed, failed = self._compute_results(work, workers)
            with self._changed:
                if self._running is not work:  # `_end_obsolete` has ended the workers
                    continue
                self._running = None
                if self._requested is not work:  # the requests were replaced, or a file of parts was saved
                    undescribed, failed = {}, {}
                else:
                    self._requested = PendingRequests()
                    self._sent.add(work)
            self._answered(self.workspace, undescribed, failed)

    def _compute_results(self, work: PendingRequests, workers: Workers) -> tuple[dict[str, PartFailure], dict[str, PartFailure]]:
        """Compute the results of all requests in workers, and cache the results.

        Return the failures, keyed by part reference and by definition text.
        """
        service = geometry_of(self.workspace, self._options, self._store, workers=workers)
        definitions = [definition for definition, _ in work.definitions.values()]
        try:
            described = service.describe(list(work.references))
            known = service.realize(definitions, {text: pieces for text, (_, pieces) in work.definitions.items() if pieces})
            records = {text: record for text, (_, record, _) in work.slices.items()}
            slices = {text: slicings for text, (_, _, slicings) in work.slices.items()}
            sliced = service.slice([definition for definition, _, _ in work.slices.values()], records, slices)
        except StoreUnusable as fault:
            failure = PartFailure(subject="", kind="invalid", message=f"the cache `{fault.root}` cannot be used: {fault.reason}")
            undescribed = {text: replace(failure, subject=text) for text in work.references}
            return undescribed, {text: replace(failure, subject=text) for text in (*work.definitions, *work.slices)}
        return (
            {name: answer for name, answer in described.items() if isinstance(answer, PartFailure)},
            {name: answer for name, answer in {**known, **sliced}.items() if isinstance(answer, PartFailure)},
        )

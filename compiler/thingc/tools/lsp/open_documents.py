"""Manage the open documents of an editor. Each document is analysed again when a file on which it depends changes."""

from __future__ import annotations

import gc
import os
import threading
import time
from collections.abc import Callable, Hashable, Mapping
from typing import Any

from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic, Report
from thingc.base.memo import Memo
from thingc.documents.load.discovery import has_header
from thingc.documents.workspace import OWN_FILE, Workspace
from thingc.driver.environment import Options, geometry_of
from thingc.geometry.client import NoWorkers
from thingc.geometry.lock.lock import read_lock
from thingc.geometry.part_source import PartSource
from thingc.geometry.record import PartFailure
from thingc.geometry.store.local import Store
from thingc.tools.live.file_watcher import FileWatcher, looks
from thingc.tools.lsp.analysis import Analysis, OpenText, analyse, is_document_path
from thingc.tools.lsp.cached_parts import AvailableNames, BackgroundWorkers, CachedParts, PendingRequests
from thingc.tools.lsp.code_actions import by_file

Publish = Callable[[str, "int | None", "list[dict[str, Any]]"], None]
"""Callback `publish(uri, version, diagnostics)` with the diagnostics of a file. The version is None for a file that is not open."""

PAUSE = 0.1
"""Interval [s] at which files on disk are checked for changes."""
HEAD = 70_000
"""Number of characters at the beginning of a file in which the key `thingc` is searched."""
IMPATIENT = 0.2
"""Time [s] after the start of an analysis of the active document during which changes do not interrupt the analysis.

Analyses of other documents are interrupted immediately.
"""


class Superseded(Exception):
    """Raised to stop the analysis of a document because a text in the editor has changed."""


class OpenDocuments:
    """The texts of the documents that are open in an editor, and their analyses.

    One thread changes the texts with the methods `put`, `close_text` and `mark_saved`. Another thread analyses the texts: the method `next`
    analyses one document and publishes the diagnostics, and the method `analysis` returns an analysis for a request. `options` specify the
    store and whether part code may run. The function `refused` converts an exception to a diagnostic. The function `wake` is called when
    analyses become outdated because workers have finished or because another program saved a file.
    """

    def __init__(self, options: Options, publish: Publish, refused: Callable[[Exception], Diagnostic], wake: Callable[[], None]) -> None:
        self.options = options
        self._publish, self._refused, self._wake = publish, refused, wake
        self._lock = threading.RLock()
        self.texts: Mapping[str, OpenText] = {}
        """All open texts, by absolute path."""
        self.recent = ""
        """The path of the file that the user opened or changed last."""
        self._changes = 0
        self._analyses: dict[str, Analysis] = {}
        self._memos: dict[str, _SupersededMemo] = {}
        self._outdated: dict[str, None] = {}
        self._published: dict[str, list[dict[str, Any]]] = {}
        self._cached_parts: dict[str, CachedParts] = {}
        self._available: dict[str, AvailableNames] = {}
        self._pending: dict[str, tuple[str, PendingRequests]] = {}
        self._workers: dict[str, BackgroundWorkers] = {}
        self._ended = threading.Event()
        self._watched = FileWatcher()
        threading.Thread(target=self._watch_files, name="looking", daemon=True).start()

    # --- texts ---------------------------------------------------------------------------------------------------

    def put(self, path: str, text: OpenText) -> None:
        """Store the text of a file that the user opened or changed in the editor."""
        with self._lock:
            self.texts, self.recent = {**self.texts, path: text}, path
            self._mark_outdated(path)

    def close_text(self, path: str) -> None:
        """Remove the text of a file that the user closed. Later analyses read the file from disk."""
        with self._lock:
            self.texts = {other: text for other, text in self.texts.items() if other != path}
            self._mark_outdated(path)

    def mark_saved(self, path: str) -> None:
        """Mark all analyses that depend on a file as outdated, because the file on disk has changed.

        The text of a document that is open in the editor does not change.
        """
        with self._lock:
            if path not in self.texts or not is_document_path(path):
                for root in [root for root, parts in self._cached_parts.items() if path in parts.inputs]:
                    del self._cached_parts[root]  # the results of the workers are outdated
                    self._workers[root].renew()
                self._mark_outdated(path)

    def _mark_outdated(self, path: str) -> None:
        """Mark the analysis of a file, and all analyses that depend on this file, as outdated."""
        self._changes += 1
        self._outdated[path] = None
        for dependent, analysis in self._analyses.items():
            if path in analysis.dependencies or analysis.kind == "variants":
                self._outdated[dependent] = None

    # --- analyses ------------------------------------------------------------------------------------------------

    def next(self) -> bool:
        """Analyse one document whose analysis is outdated, and publish its diagnostics. Return False if no analysis is outdated.

        The document that the user is editing is analysed first.
        """
        with self._lock:
            path = self.recent if self.recent in self._outdated else next(iter(self._outdated), None)
            if path is not None and path not in self.texts:
                del self._outdated[path]
                self._forget(path)
        if path is None:
            self._send_requests()
            return False
        try:
            if path in self.texts:
                self.analysis(path)
            self._publish_changes(path)
        except Superseded:
            pass
        return True

    def analysis(self, path: str) -> Analysis:
        """Return the analysis of the current text of a file. Raises `Superseded` if a text changes during a long analysis."""
        with self._lock:
            known = self._analyses.get(path)
            if known is not None and path not in self._outdated:
                return known
            texts, changes = self.texts, self._changes
            self._outdated.pop(path, None)
        memo = self._memos.setdefault(path, _SupersededMemo())
        earliest = time.monotonic() + (IMPATIENT if path == self.recent else 0.0)
        memo.until(lambda: self._changes != changes and time.monotonic() > earliest)
        try:
            analysis = self._analyse(path, texts, memo, known)
        except Superseded:
            with self._lock:
                self._outdated[path] = None
            raise
        with self._lock:
            self._analyses[path] = analysis
            self._watched.note(analysis.dependencies)
        if known is None:
            gc.freeze()  # most objects live as long as the document is open, and a garbage collection takes longer than several keystrokes
        return analysis

    def _analyse(self, path: str, texts: Mapping[str, OpenText], memo: Memo, known: Analysis | None) -> Analysis:
        if not self._is_document(path, texts, known):
            return Analysis(path=path, open=texts)
        try:
            analysis = analyse(path, texts, self.options, self._parts_provider(path) if self.options.code else None, memo, known)
            return analysis if analysis.workspace is None else replace(analysis, available_names=self._names_of(analysis.workspace))
        except Superseded:
            raise
        except Exception as fault:  # the next change may fix the error
            self._memos.pop(path, None)
            return Analysis(path=path, open=texts, findings=(self._refused(fault),), well_formed=False, last=known and known.known)

    def _is_document(self, path: str, texts: Mapping[str, OpenText], known: Analysis | None) -> bool:
        """Return whether a file is a document of thingc and not any other YAML file. A file to which a document refers is a document, too.

        A document remains a document while the user edits its first line.
        """
        opened = texts.get(path)
        return (
            opened is None or os.path.basename(path) == OWN_FILE or known is not None and known.known.documents is not None
            or has_header(opened.text[:HEAD].encode(errors="replace"), path)
            or any(path in one.dependencies for one in self._analyses.values() if one.path != path)
        )

    def _forget(self, path: str) -> None:
        self._analyses.pop(path, None)
        self._memos.pop(path, None)
        self._pending.pop(path, None)

    # --- findings ------------------------------------------------------------------------------------------------

    def _publish_changes(self, path: str) -> None:
        """Send the diagnostics of a file, and changed diagnostics of all other files, to the editor."""
        with self._lock:
            analyses = [one for one in self._analyses.values() if one.path in self.texts]
        diagnostics_of: dict[str, list[dict[str, Any]]] = {}
        for analysis in analyses:
            for file, diagnostics in by_file(analysis).items():
                merged = diagnostics_of.setdefault(file, [])
                if analysis.open.get(file) is self.texts.get(file):  # otherwise the diagnostics refer to an older text
                    merged.extend(one for one in diagnostics if one not in merged)
        for file in dict.fromkeys((path, *diagnostics_of, *self._published)):
            diagnostics = diagnostics_of.get(file, [])
            if file == path or diagnostics != self._published.get(file, []):
                text = self._analyses[file].open.get(file) if file in self._analyses else self.texts.get(file)
                uri = text.uri if text is not None else Analysis(path=file).uri(file)
                self._publish(uri, None if text is None else text.version, diagnostics)
        self._published = {file: diagnostics for file, diagnostics in diagnostics_of.items() if diagnostics}

    # --- parts ---------------------------------------------------------------------------------------------------

    def _parts_provider(self, path: str) -> Callable[[Workspace, Store], PartSource]:
        """Return a function that returns the source of parts for a document, which provides part schemas and part records.

        The source of parts does not wait for workers.
        """
        def provide(workspace: Workspace, store: Store) -> PartSource:
            cached_parts = self._cached_parts.get(workspace.root)
            if cached_parts is None or cached_parts.workspace != workspace:
                service = geometry_of(workspace, self.options, store, lambda: read_lock(workspace, Report()), workers=NoWorkers())
                cached_parts = self._cached_parts[workspace.root] = CachedParts(service)
            cached_parts.pending = PendingRequests()
            self._pending[path] = (workspace.root, cached_parts.pending)
            if workspace.root not in self._workers:
                self._workers[workspace.root] = BackgroundWorkers(workspace, store, self.options, self._store_failures)
            return cached_parts

        return provide

    def _names_of(self, workspace: Workspace) -> AvailableNames:
        """Return the names of parts and of other documents that the documents of a workspace can use."""
        cached_parts = self._cached_parts.get(workspace.root)
        known = self._available.get(workspace.root)
        if known is None or known.workspace != workspace or known.cached_parts is not cached_parts:
            known = self._available[workspace.root] = AvailableNames(workspace, cached_parts, self._wake)
        return known

    def _send_requests(self) -> None:
        """Send the requests for missing part schemas and part records to the background workers."""
        with self._lock:
            for root, workers in self._workers.items():
                pending = PendingRequests()
                for of_root, one in self._pending.values():
                    if of_root == root:
                        pending.add(one)
                workers.request(pending)

    def _store_failures(self, workspace: Workspace, undescribed: Mapping[str, PartFailure], failed: Mapping[str, PartFailure]) -> None:
        """Store the failures from background workers, and mark the analyses that lack results of these workers as outdated."""
        with self._lock:
            cached_parts = self._cached_parts.get(workspace.root)
            if cached_parts is not None:
                cached_parts.undescribed.update(undescribed)
                cached_parts.failed.update(failed)
            for path, (root, pending) in self._pending.items():
                if root == workspace.root and pending:
                    self._outdated[path] = None
        self._wake()

    # --- the disk ------------------------------------------------------------------------------------------------

    def _watch_files(self) -> None:
        """Mark analyses as outdated when another program changes a file on which they depend."""
        for changed in looks(self._take_changed_files, self._ended, PAUSE):
            for path in changed:
                self.mark_saved(path)
            if changed:
                self._wake()

    def _take_changed_files(self) -> tuple[str, ...]:
        with self._lock:
            needed: frozenset[str] = frozenset().union(*(one.dependencies for one in self._analyses.values()))
            if needed != self._watched.paths:
                self._watched.only(needed)
            return self._watched.take_changes()

    def close(self) -> None:
        """Stop the thread that watches files, and end the worker processes."""
        self._ended.set()
        for one in self._workers.values():
            one.end()


class _SupersededMemo(Memo):
    """A cache of recent results of functions, which interrupts an analysis if a text has changed."""

    __slots__ = ("_superseded",)

    def __call__(self, place: Hashable, function: Callable[..., Any], *inputs: Any) -> Any:
        """Call a function or return its cached result, as `Memo` does. Raises `Superseded` to interrupt the analysis."""
        if self._superseded():
            raise Superseded
        return super().__call__(place, function, *inputs)

    def until(self, superseded: Callable[[], bool]) -> None:
        """Set the function that decides whether a running analysis must be interrupted."""
        self._superseded = superseded

    def last(self, place: Hashable, inputs: tuple[Any, ...]) -> Any | None:
        """Return the last result of a function, as `Memo.last` does. Raises `Superseded` to interrupt the analysis."""
        if self._superseded():
            raise Superseded
        return super().last(place, inputs)

    def make_empty(self) -> Memo:
        """Return an empty memo for the same analysis, as `Memo.make_empty` does. This memo also interrupts the analysis."""
        memo = _SupersededMemo()
        memo.until(self._superseded)
        return memo

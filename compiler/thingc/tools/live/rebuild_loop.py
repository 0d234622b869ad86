"""Rebuild a document whenever a file on which it depends is saved. The worker processes keep the geometry kernel loaded between rebuilds.

Each rebuild is called a round. A round gives the same result as a single build, but reuses cached results of pure functions. Unless Python
files of parts have changed, a round also reuses the geometry service. If files change during a round, the loop discards the result and
starts the next round immediately.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module

from thingc.base.diagnostics import Diagnostic, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.documents.workspace import Workspace
from thingc.driver import build_document, pipeline, up_to_date
from thingc.driver.build_document import BuildRequest, BuildResult
from thingc.driver.environment import Environment, Options, geometry_of
from thingc.driver.output import Waiting
from thingc.geometry.client import Workers
from thingc.geometry.service import GeometryService
from thingc.geometry.store.local import BlobMissing, Store
from thingc.targets.artifact import MANIFEST, Content
from thingc.tools.live.file_watcher import FileWatcher, looks, stat_of

PAUSE = 0.01
"""Interval [s] at which files are checked for changes."""
QUIET = 0.03
"""Time [s] without changes of files before a round starts, because editors save in several steps and can save several files."""
IMPATIENT = 1.0
"""Time [s] after the start of a round during which a save does not interrupt the round. A later save ends the worker processes."""
ABSENT = 0.3
"""Time [s] to wait for a file that is suddenly missing or empty, because an editor is probably replacing the file."""
CLOCK = 0.02
"""Tolerance [s] for comparing file times, because their resolution is limited."""


class Rebuild(FrozenStruct):
    """The result of one rebuild after a save.

    Attributes:
        saved: The absolute paths of the saved files. In the first round, this tuple is empty.
        seconds: The duration [s] from the last save to the end of the round.
        good: Whether the robot was rebuilt without errors.
        folder: The build folder, or None after errors or if the loop does not write files.
        built: The result of the build, if any.
        changed: The paths of the outputs that were added, changed or removed since the last round without errors.
        recovered: Whether this round is without errors, but the previous round had errors.
        kept: Whether this round has errors, and the output of an earlier round remains, in the build folder or in the viewer.
        modelled: The labels of the parts that were built, also in interrupted attempts, keyed by definition text.
        kernel: The time [s] in `seconds` during which parts were built.
    """

    number: int
    saved: tuple[str, ...]
    seconds: float
    diagnostics: tuple[Diagnostic, ...]
    good: bool = False
    built: BuildResult | None = None
    folder: str | None = None
    changed: tuple[str, ...] = ()
    recovered: bool = False
    kept: bool = False
    modelled: Mapping[str, str] = {}
    kernel: float = 0.0


class RebuildLoop(contextlib.AbstractContextManager["RebuildLoop"]):
    """A context manager that rebuilds a document after every save. On exit, the worker processes are ended.

    In every round, the loop calls the function `wish`, which returns the build request or errors, because the settings of the workspace can
    change. The function `refused` converts an exception to a diagnostic. The loop calls the function `on_wait` while another process builds
    the same folder. The loop writes the build folder only if `writes` is true. Each round acquires the lock `turn`, so that the loops of
    several documents do not run at the same time.
    """

    def __init__(
        self, document: str, options: Options, wish: Callable[[], BuildRequest | Sequence[Diagnostic]],
        refused: Callable[[Exception], Diagnostic], on_wait: Waiting | None = None, *, writes: bool = True,
        turn: contextlib.AbstractContextManager[object] | None = None,
    ) -> None:
        self.document = os.path.abspath(document)
        self.options = options
        self.environment: Environment | None = None
        self._wish = wish
        self._refused = refused
        self._here = os.getcwd()
        self._on_wait = on_wait
        self._writes = writes
        self._turn = turn or contextlib.nullcontext()
        self._workers = self._fresh_workers()
        self._abandoned: tuple[str, ...] = ()
        self._saved: tuple[str, ...] = ()
        self._memo = Memo()
        self._geometry: GeometryService | None = None
        self._last_geometry: GeometryService | None = None
        self._watched = FileWatcher(self.document)
        self._last: Mapping[str, str] | None = None  # None until a round is without errors; empty in a viewer, which writes no files
        self._documents: frozenset[str] = frozenset()
        self._number = 0
        self._failed = False
        self._modelled: dict[str, str] = {}

    def _fresh_workers(self) -> Workers:
        return Workers(self.options.jobs or os.cpu_count() or 1)

    def __exit__(self, *exception: object) -> None:
        self._workers.end()

    def rounds(self, stop: threading.Event) -> Iterator[Rebuild]:
        """Yield the result of the first build, and then the result of a rebuild after every save, until `stop` is set."""
        saved: tuple[str, ...] = ()
        first = True
        for files in looks(self._watched.take_changes, stop, PAUSE):
            saved = tuple(dict.fromkeys((*saved, *files)))
            if not (saved or first):
                continue
            if not self._small(saved):
                saved = self._wait_for_saves(saved)
            with self._turn:
                made, more = self._round(saved)
            if more:  # files changed during the round, so the round may have read old and new files
                saved = tuple(dict.fromkeys((*saved, *more)))
                continue
            self._modelled = {}
            yield made
            if first:  # load modules and the geometry kernel before the next round
                if made.built is not None and made.built.compilation.decisions:
                    self._workers.warm()
                for module in self.options.ahead:
                    import_module(module)
            saved, first = (), False
            gc.collect()

    def _small(self, saved: tuple[str, ...]) -> bool:
        """Return whether exactly one file was saved, which is a nonempty document or Python file of parts.

        In this case, the next round starts without a delay.
        """
        one = saved[0] if len(saved) == 1 else ""
        of_parts = self._geometry is not None and one in self._geometry.inputs
        return (one in self._documents or of_parts) and (_time_and_size(one) or (0.0, 0))[1] > 0

    def _wait_for_saves(self, saved: tuple[str, ...]) -> tuple[str, ...]:
        """Wait until no file has been saved for the time `QUIET`. Return the paths of all saved files."""
        began = time.monotonic()
        while True:
            absent = any((_time_and_size(path) or (0.0, 0))[1] == 0 for path in saved) and time.monotonic() - began < ABSENT
            if not absent and (unquiet := _time_until_quiet(saved)) == 0.0:
                return saved
            time.sleep(0.01 if absent else unquiet)
            saved = tuple(dict.fromkeys((*saved, *self._watched.take_changes())))

    def _round(self, saved: tuple[str, ...]) -> tuple[Rebuild, tuple[str, ...]]:
        """Rebuild the document once. Return the result, and the paths of the files that were saved during the rebuild.

        If files were saved during the rebuild, the build folder was not written.
        """
        started, clock, begun = time.perf_counter(), time.time(), time.monotonic()
        self._abandoned, self._saved = (), saved
        with contextlib.suppress(OSError):  # the folder may have been replaced, for example by checking out a branch
            os.chdir(self._here)
        built: BuildResult | None = None
        folder: str | None = None
        good = False
        if self._failed or self._geometry is not None and not self._geometry.inputs.isdisjoint(saved):
            self._geometry = None
        self.environment = Environment(self.document, self.options, self._take_service, self._memo)
        diagnostics: Sequence[Diagnostic]
        more: tuple[str, ...] = ()
        try:
            wish = self._wish()
            if isinstance(wish, BuildRequest):
                built = self._build(wish)
                diagnostics = built.diagnostics
            else:
                diagnostics = wish
            time.sleep(_time_until_quiet(saved))
            more = self._look(clock, built) or self._abandoned
            if not more and built is not None and built.files is not None and isinstance(wish, BuildRequest):
                folder = build_document.write(self.environment, built, wish, self._on_wait) if self._writes else None
                good = True
        except Exception as fault:  # the next save may fix the error
            diagnostics = [self._refused(fault)]
            more = self._look(clock, built) or self._abandoned
        self._modelled |= _built_parts(built)
        if more:
            return Rebuild(number=self._number, saved=saved, seconds=0.0, diagnostics=()), more
        now = _digests(built.files) if good and built is not None and built.files is not None else self._last or {}
        previous = now if self._last is None else self._last
        changed = tuple(sorted(path for path in {*previous, *now} if previous.get(path) != now.get(path)))
        self._number += 1
        rebuild = Rebuild(
            number=self._number, saved=saved, seconds=time.perf_counter() - started, diagnostics=tuple(diagnostics), good=good, built=built,
            folder=folder, changed=changed, recovered=self._failed and good, kept=not good and self._last is not None,
            modelled=self._modelled, kernel=self._workers.busy(begun),
        )
        self._failed = not good
        self._last = now if good else self._last
        return rebuild, ()

    def _build(self, wish: BuildRequest) -> BuildResult:
        assert self.environment is not None
        with self._ending_late_workers():
            try:
                return build_document.build(self.environment, wish)
            except BlobMissing:  # the store is damaged: retry without caches
                self._geometry, self._memo = None, Memo()
                self.environment = Environment(self.document, self.options, self._take_service, self._memo)
                return build_document.build(self.environment, wish)
            finally:
                self._workers.forget()  # necessary if the build was interrupted
                if self._geometry is not None and self._geometry.wanted:
                    self._last_geometry = self._geometry

    @contextlib.contextmanager
    def _ending_late_workers(self) -> Iterator[None]:
        """A context manager that ends the worker processes if a watched file is saved after the time `IMPATIENT`.

        The paths of the saved files are stored in `_abandoned`. Without this method, a part that takes too long would block the next round.
        """
        stats = {path: stat_of(path) for path in self._watched.paths}
        finished = threading.Event()

        def look() -> None:
            pause = IMPATIENT
            while not finished.wait(pause):
                self._abandoned = tuple(path for path, stat in stats.items() if stat_of(path) != stat)
                if self._abandoned:
                    self._workers.end()
                    return
                pause = 0.1

        looking = threading.Thread(target=look, daemon=True)
        looking.start()
        try:
            yield
        finally:
            finished.set()
            looking.join()
            if self._abandoned:
                self._workers, self._geometry = self._fresh_workers(), None

    def _take_service(self, workspace: Workspace, store: Store) -> GeometryService:
        """Return the geometry service of the last round, or a new geometry service if the last service cannot be reused."""
        if self._geometry is None or self._geometry.workspace != workspace:
            self._geometry = geometry_of(workspace, self.options, store, workers=self._workers)
            if self._last_geometry is not None:
                self._geometry.expect(self._last_geometry, self._saved)
        return self._geometry

    def _look(self, clock: float, built: BuildResult | None) -> tuple[str, ...]:
        """Watch all files that this round has read.

        Return the paths of the files that were saved since the start of the round, the time `clock` [s].
        """
        assert self.environment is not None
        nothing = pipeline.Compilation(settings=pipeline.settings_of(self.options), report=Report())
        compilation = built.compilation if built is not None else nothing
        paths = up_to_date.dependencies_of(self.environment, compilation)
        new_paths = paths - self._watched.paths
        if compilation.documents is not None:
            self._documents = frozenset(document.path for document in compilation.documents.by_path.values())
        if built is not None and built.files is not None:
            self._watched.only(paths)
        else:
            self._watched.note(paths)
        saved_later = [path for path in new_paths if (state := _time_and_size(path)) is not None and state[0] > clock - CLOCK]
        return tuple(dict.fromkeys((*saved_later, *self._watched.take_changes())))


def _built_parts(built: BuildResult | None) -> dict[str, str]:
    """Return the labels of the newly built parts, keyed by the text of the part definition."""
    if built is None:
        return {}
    assembly, texts = built.compilation.assembly, built.compilation.modelled
    labels = {one.definition.text: one.definition.label for one in assembly.occurrences} if assembly is not None else {}
    return {text: labels.get(text, text) for text in texts}


def _time_until_quiet(saved: Sequence[str]) -> float:
    """Return the time [s] after which the saved files will have been unchanged for `QUIET`. File times in the future are ignored."""
    elapsed = time.time() - max((stat[0] for path in saved if (stat := _time_and_size(path)) is not None), default=0.0)
    return QUIET - elapsed if 0.0 <= elapsed < QUIET else 0.0


def _time_and_size(path: str) -> tuple[float, int] | None:
    """Return the modification time [s] and the size [bytes] of a file.

    Return None if the file does not exist. The size of a folder is 1.
    """
    stat = stat_of(path)
    return None if stat is None else (stat[0] / 1e9, 1 if os.path.isdir(path) else stat[1])


def _digests(files: Mapping[str, Content]) -> Mapping[str, str]:
    """Return the SHA-256 hashes of all files that the manifest of a build folder lists, keyed by path in the folder."""
    content = files[MANIFEST]
    assert isinstance(content, bytes)
    listed: dict[str, str] = json.loads(content)["files"]
    return listed

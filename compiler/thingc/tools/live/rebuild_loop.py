"""A document built again whenever something that it depends on was saved, by workers that have the kernel loaded.

Everything is what a single build does (`building`); a round only begins with what the last one has left: the answers of pure functions
(`memo`), and the geometry service as long as no file that parts depend on has changed. A round whose files change under it is not
written: the next one begins at once.
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
from thingc.base.file_watcher import FileWatcher, looks, stat_of
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.documents.workspace import Workspace
from thingc.driver import build_document, pipeline, up_to_date
from thingc.driver.build_document import BuildRequest, BuildResult
from thingc.driver.environment import Environment, Options, geometry_of
from thingc.driver.output import Waiting
from thingc.driver.up_to_date import state_of
from thingc.geometry.client import EndingWorkers
from thingc.geometry.service import GeometryService
from thingc.geometry.store.local import BlobMissing, Store
from thingc.targets.artifact import MANIFEST, Content

PAUSE = 0.01
"""Between two looks at the files [s]."""
QUIET = 0.03
"""How long [s] nothing may have been saved before a round begins: editors write in pieces, and many files at once."""
IMPATIENT = 1.0
"""How long [s] a round goes on whatever is saved: after that a save ends workers that still model what stood there before."""
ABSENT = 0.3
"""How long [s] to wait for a file that is gone or empty all of a sudden: who writes it anew will be done then."""
CLOCK = 0.02
"""By how much [s] the time of a save may lie before it: file systems count in ticks."""


class Rebuild(FrozenStruct):
    """What came of one save. `saved` are the absolute paths of the files that had changed (none in the first round), `seconds` how long it
    took from when they were quiet; `good`: it has no errors; `folder` is the build folder that was written (None with errors: it is as
    it was; and where nothing is written at all), `built` the rest of what came of it, where it came so far. `changed` are the artifacts,
    by path in the folder, that are others than in the last good round, or are gone; `mended`: the last round had errors, and this one
    has none; `kept`: it has errors, and what stands is of an earlier round. `modelled` are the definition texts of the parts that were
    modelled for it, also while it was given up and begun anew, with what they are called in the document's units; `kernel` is how long [s]
    of `seconds` parts were modelled, from when their classes were there."""

    number: int
    saved: tuple[str, ...]
    seconds: float
    diagnostics: tuple[Diagnostic, ...]
    good: bool = False
    built: BuildResult | None = None
    folder: str | None = None
    changed: tuple[str, ...] = ()
    mended: bool = False
    kept: bool = False
    modelled: Mapping[str, str] = {}
    kernel: float = 0.0


class RebuildLoop:
    """One document and its rounds. A context manager: leaving it ends the workers.

    `wish` is asked in every round (what the workspace says may have changed): it gives what to build, or what is wrong with that. `refused`
    puts an exception into words. `on_wait` hears that another build of the folder is waited for. Unless it `writes`, everything is done
    but that. `turn` is held in every round: of several documents that are followed by threads of one process one is compiled at a time.
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
        self._watched = FileWatcher([self.document], content=state_of)
        self._last: Mapping[str, str] | None = None
        self._documents: frozenset[str] = frozenset()
        self._number = 0
        self._failed = False
        self._modelled: dict[str, str] = {}

    def _fresh_workers(self) -> EndingWorkers:
        return EndingWorkers(self.options.jobs or os.cpu_count() or 1)

    def __enter__(self) -> RebuildLoop:
        return self

    def __exit__(self, *exception: object) -> None:
        self._workers.end()

    def rounds(self, stop: threading.Event) -> Iterator[Rebuild]:
        """The first round, then one after every save, until `stop` is set."""
        saved: tuple[str, ...] = ()
        first = True
        for files in looks(self._watched.changed, stop, PAUSE):
            saved = tuple(dict.fromkeys((*saved, *files)))
            if not (saved or first):
                continue
            if not self._small(saved):
                saved = self._settled(saved)
            with self._turn:
                made, more = self._round(saved)
            if more:  # saved again meanwhile: what was read may be of both
                saved = tuple(dict.fromkeys((*saved, *more)))
                continue
            self._modelled = {}
            yield made
            if first:  # what the next round will need is made ready while nobody waits
                if made.built is not None and made.built.compilation.decisions:
                    self._workers.warm()
                for module in self.options.ahead:
                    import_module(module)
            saved, first = (), False
            gc.collect()

    def _small(self, saved: tuple[str, ...]) -> bool:
        """Whether it is one document that was saved, or one file that parts depend on: what has been found out of it by the time that
        nothing more has come for a while is most often what is wanted."""
        one = saved[0] if len(saved) == 1 else ""
        of_parts = self._geometry is not None and one in self._geometry.inputs
        return (one in self._documents or of_parts) and (_time_and_size(one) or (0.0, 0))[1] > 0

    def _settled(self, saved: tuple[str, ...]) -> tuple[str, ...]:
        """What was saved, when nothing has been for a while."""
        began = time.monotonic()
        while True:
            absent = any((_time_and_size(path) or (0.0, 0))[1] == 0 for path in saved) and time.monotonic() - began < ABSENT
            if not absent and (unquiet := _unquiet(saved)) == 0.0:
                return saved
            time.sleep(0.01 if absent else unquiet)
            saved = tuple(dict.fromkeys((*saved, *self._watched.changed())))

    def _round(self, saved: tuple[str, ...]) -> tuple[Rebuild, tuple[str, ...]]:
        """What comes of the document now, and what was saved while it was looked at: then nothing has been written."""
        started, clock, begun = time.perf_counter(), time.time(), time.monotonic()
        self._abandoned, self._saved = (), saved
        with contextlib.suppress(OSError):  # it may be another folder of that name by now, as after a branch without it
            os.chdir(self._here)
        built: BuildResult | None = None
        folder: str | None = None
        good = False
        if self._failed or self._geometry is not None and not self._geometry.inputs.isdisjoint(saved):
            self._geometry = None
        self.environment = Environment(self.document, self.options, self._lent, self._memo)
        said: Sequence[Diagnostic]
        more: tuple[str, ...] = ()
        try:
            wish = self._wish()
            with self.environment.store.hurried():
                if isinstance(wish, BuildRequest):
                    built = self._built(wish)
                    said = built.diagnostics
                else:
                    said = wish
                time.sleep(_unquiet(saved))
                more = self._look(clock, built) or self._abandoned
                if not more and built is not None and built.files is not None and isinstance(wish, BuildRequest):
                    folder = build_document.write(self.environment, built, wish, self._on_wait) if self._writes else None
                    good = True
        except Exception as fault:  # whatever it is, the next save may mend it
            said = [self._refused(fault)]
            more = self._look(clock, built) or self._abandoned
        self._modelled |= _modelled(built)
        if more:
            return Rebuild(number=self._number, saved=saved, seconds=0.0, diagnostics=()), more
        now = _digests(built.files) if good and built is not None and built.files is not None else None
        before = self._last if self._last is not None and now is not None else now
        changed = () if now is None or before is None else tuple(sorted(
            path for path in {*before, *now} if before.get(path) != now.get(path)
        ))
        self._number += 1
        made = Rebuild(
            number=self._number, saved=saved, seconds=time.perf_counter() - started, diagnostics=tuple(said), good=good, built=built,
            folder=folder, changed=changed, mended=self._failed and good, kept=not good and self._last is not None,
            modelled=self._modelled, kernel=self._workers.busy(begun),
        )
        self._failed, self._last = not good, now if now is not None else self._last
        return made, ()

    def _built(self, wish: BuildRequest) -> BuildResult:
        assert self.environment is not None
        with self._abandoning():
            try:
                return build_document.build(self.environment, wish)
            except BlobMissing:  # the store is damaged: it is mended with other eyes
                self._geometry, self._memo = None, Memo()
                self.environment = Environment(self.document, self.options, self._lent, self._memo)
                return build_document.build(self.environment, wish)
            finally:
                self._workers.forget()  # where the build did not get as far as what it began with
                if self._geometry is not None and self._geometry.wanted:
                    self._last_geometry = self._geometry

    @contextlib.contextmanager
    def _abandoning(self) -> Iterator[None]:
        """Meanwhile a save of what is watched ends the workers, if the round has been going on for a while: a part that never ends would
        else be waited for, and what was saved to mend it with it. Which files those were is in `_abandoned`."""
        before = {path: stat_of(path) for path in self._watched.paths}
        done = threading.Event()

        def look() -> None:
            pause = IMPATIENT
            while not done.wait(pause):
                self._abandoned = tuple(path for path, stat in before.items() if stat_of(path) != stat)
                if self._abandoned:
                    self._workers.end()
                    return
                pause = 0.1

        looking = threading.Thread(target=look, daemon=True)
        looking.start()
        try:
            yield
        finally:
            done.set()
            looking.join()
            if self._abandoned:
                self._workers, self._geometry = self._fresh_workers(), None

    def _lent(self, workspace: Workspace, store: Store) -> GeometryService:
        """A service that has seen nothing yet, or the last one where that has seen nothing else."""
        if self._geometry is None or self._geometry.workspace != workspace:
            self._geometry = geometry_of(workspace, self.options, store, workers=self._workers)
            if self._last_geometry is not None:
                self._geometry.expect(self._last_geometry, self._saved)
        return self._geometry

    def _look(self, clock: float, built: BuildResult | None) -> tuple[str, ...]:
        """Watch what this round has looked at; what of that was saved since it began, at the time `clock` [s]."""
        assert self.environment is not None
        nothing = pipeline.Compilation(settings=pipeline.settings_of(self.options), report=Report())
        compilation = built.compilation if built is not None else nothing
        paths = up_to_date.looked_at(self.environment, compilation)
        fresh = paths - self._watched.paths
        if compilation.documents is not None:
            self._documents = frozenset(document.path for document in compilation.documents.by_path.values())
        if built is not None and built.files is not None:
            self._watched.only(paths)
        else:
            self._watched.note(paths)
        late = [path for path in fresh if (state := _time_and_size(path)) is not None and state[0] > clock - CLOCK]
        return tuple(dict.fromkeys((*late, *self._watched.changed())))


def _modelled(built: BuildResult | None) -> dict[str, str]:
    """The parts that were modelled for a build: definition texts, and what they are called."""
    if built is None:
        return {}
    assembly, texts = built.compilation.assembly, built.compilation.modelled
    labels = {one.definition.text: one.definition.label for one in assembly.occurrences} if assembly is not None else {}
    return {text: labels.get(text, text) for text in texts}


def _unquiet(saved: Sequence[str]) -> float:
    """How long [s] it will take until nothing has been saved for a while. A time of a save that cannot be is none."""
    since = time.time() - max((stat[0] for path in saved if (stat := _time_and_size(path)) is not None), default=0.0)
    return QUIET - since if 0.0 <= since < QUIET else 0.0


def _time_and_size(path: str) -> tuple[float, int] | None:
    """When a file was changed [s], and how long it is (a folder: 1); None where there is none."""
    stat = stat_of(path)
    return None if stat is None else (stat[0] / 1e9, 1 if os.path.isdir(path) else stat[1])


def _digests(files: Mapping[str, Content]) -> Mapping[str, str]:
    """The SHA-256 of every artifact, by path in the build folder, as the manifest lists them."""
    content = files[MANIFEST]
    assert isinstance(content, bytes)
    listed: dict[str, str] = json.loads(content)["files"]
    return listed

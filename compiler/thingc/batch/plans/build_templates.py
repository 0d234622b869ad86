"""Whole builds for many settings: files are written once, with slots for numbers, which are filled for other settings.

`TextTemplate` is a text with slots.
"""

from __future__ import annotations

import copy
import hashlib
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from json.encoder import encode_basestring
from typing import TYPE_CHECKING, Any, cast

from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.numeric import FORMATTERS
from thingc.base.safe_text import json_text
from thingc.base.zip_files import MODEL, entries, inflate, zipped
from thingc.batch.plans import numeric_plan
from thingc.batch.plans.numeric_plan import NumericPlan, PlanCache, PlanCaches, TracedResults
from thingc.batch.plans.part_exchange import Exchange
from thingc.batch.plans.tape import SLOT, Tape, Traced, slot
from thingc.batch.plans.trace_compilation import NotTraceable, TraceResult, trace_compilation
from thingc.driver import pipeline
from thingc.driver.pipeline import Compilation
from thingc.driver.session import Session
from thingc.driver.settings import ParsedSettings, SettingsReader
from thingc.geometry.record import Placed, StoredFile
from thingc.model.resolve.resolver import Settings
from thingc.targets.artifact import MANIFEST, Content, counts_of
from thingc.targets.registry import emitted

if TYPE_CHECKING:
    from thingc.geometry.service import GeometryService
    from thingc.targets.artifact import Artifacts
    from thingc.targets.request import EmitRequest

FOLLOWED = frozenset(("mjcf", "mjz", "stl", "step", "urdf", "ros", "sdf", "usd", "bom"))
"""The targets whose varying numbers are all in text, where they have slots.

Others: `hag` contains texts of settings, with a layout that depends on them; numbers in `glb` and `html` are binary.
"""

SETTING, DIGEST = "setting:", "digest:"
"""Prefixes of the names of slots in a manifest for texts of settings, and for digests of files."""

PATIENCE = 16
"""Number of settings with the same names to compile before a plan is made, which takes about as long as this many compilations."""

Emit = Callable[["EmitRequest", Sequence[str]], "dict[str, Artifacts]"]
"""A function that returns the artifacts of targets: `emitted`, or one that returns fewer."""

Measured = Callable[[Compilation], "dict[str, Any] | None"]
"""A function that returns results of a compilation; None if there are none, and no build is wanted."""


class Build(FrozenStruct):
    """The build of valid settings.

    `results` are those of `measured`; `problems` are all diagnostics; `losses` are counts by kind; `parts` is the number of part
    definitions. `files` returns the files of the folder by path, including the manifest.
    """

    results: dict[str, Any]
    problems: tuple[Diagnostic, ...]
    losses: Mapping[str, int]
    parts: int
    files: Callable[[], dict[str, Content]]


class Builds:
    """Builds of one document, for fixed modes (none: all) and targets.

    `measured` returns their results, `emit` their artifacts. A plan is made for the `patience`-th (a power of two, default `PATIENCE`)
    settings with the same names. For each plan, the first build and then one in `verify` is compared with a compilation, whose models
    MuJoCo compiles, too (None: the first, second, fourth, eighth ...; 0: none).
    """

    def __init__(
        self, session: Session, reader: SettingsReader, *, modes: Sequence[str], targets: Sequence[str], verify: int | None,
        measured: Measured = lambda compilation: {}, emit: Emit = emitted, patience: int | None = None,
    ) -> None:
        self._session = session
        self._reader = reader
        self._modes = tuple(modes)
        self._targets = tuple(targets)
        self._measured = measured
        self._verify = verify
        self._emit = emit
        self._forms: PlanCaches[_Template] = PlanCaches(patience or PATIENCE)

    def planned(self, settings: Settings) -> Build | None:
        """Return the build of settings by a plan; None if there is no plan for them, which says nothing about the settings."""
        read = self._reader.read({**settings.parameters, **settings.choices})
        given = {*settings.parameters, *settings.choices}
        if given != {*read.names, *dict(read.texts)} or not FOLLOWED.issuperset(self._targets):
            return None
        planned = self._forms.planned(read, self._plan)
        if planned is None:
            return None
        plan, outputs = planned
        made = plan.made.build(outputs, settings)
        if made is None:
            return None
        if plan.is_due(self._verify) and not _same(made, self._passed(settings)[0]):
            self._forms.of(read).wrong(f"a plan gave different files for {dict(zip(read.names, read.values))}")
            return None
        return made

    def made(self, settings: Settings) -> tuple[Mapping[str, Content], tuple[Diagnostic, ...]]:
        """Return the files, by a plan or a compilation (empty if the settings are refused), and all diagnostics."""
        planned = self.planned(settings)
        return self.passed(settings) if planned is None else (planned.files(), planned.problems)

    def passed(self, settings: Settings) -> tuple[Mapping[str, Content], tuple[Diagnostic, ...]]:
        """Compile settings, and all models with MuJoCo; return the files (empty if the settings are refused), and all diagnostics."""
        build, problems = self._passed(settings)
        return build.files() if build is not None else {}, problems

    def _passed(self, settings: Settings, verify: int = 1) -> tuple[Build | None, tuple[Diagnostic, ...]]:
        compilation = self._session.compile(settings, self._modes)
        report = compilation.report
        if report.failed:
            return None, tuple(report.ordered())
        results = self._measured(compilation)
        request = pipeline.request_of(self._session.environment, compilation, verify=verify)
        artifacts = self._emit(request, self._targets) if results is not None else {}
        problems = tuple(report.ordered())
        if report.failed or results is None:
            return None, problems
        files = self._session.files(compilation, artifacts)
        return Build(
            results=results, problems=problems, losses=counts_of(loss for one in artifacts.values() for loss in one.losses),
            parts=len(compilation.decisions), files=lambda: files,
        ), problems

    def _plan(self, read: ParsedSettings, form: PlanCache[_Template]) -> NumericPlan[_Template] | None:
        """Return a plan that gives the same builds as compilations; None, with the reason in `form`, if there is none."""
        first, _ = self._passed(self._reader.settings(read))
        if first is None:
            return None

        def attempt(numbers: Mapping[str, Any], texts: Mapping[str, str], *, exact: Collection[str]) -> TraceResult:
            return trace_compilation(self._session, self._modes, numbers, texts, partial(self._written, read), exact)

        def finish(rehearsal: TraceResult, exchange: Exchange | None) -> tuple[Sequence[Any], _Template]:
            template = _Template(rehearsal, first)
            return template.outputs, template

        plan = numeric_plan.make(read, self._reader, attempt, finish, form)
        if plan is None:
            return None
        for sample in numeric_plan.samples(read, self._reader, form):
            settings = self._reader.settings(sample)
            whole = first if sample is read else self._passed(settings, verify=0)[0]
            outputs = plan.outputs(sample.values)
            made = plan.made.build(outputs, settings) if outputs is not None else None
            if whole is not None and made is not None and not _same(made, whole):
                form.refused = "a plan gave different files"
                return None
        return plan

    def _written(self, read: ParsedSettings, compilation: Compilation, tape: Tape) -> tuple[Mapping[str, Content], Mapping[str, Any]]:
        """Return the files with slots for numbers and texts of settings, and results with traced numbers (for `trace_compilation`)."""
        results = self._measured(compilation) or {}
        environment = copy.copy(self._session.environment)
        environment.memo = Memo()
        own = self._reader.settings(read)
        names = (*own.parameters, *own.choices)
        slots = {name: slot(f"{SETTING}{name}") for name in names}
        settings = Settings(parameters={name: slots[name] for name in own.parameters}, choices={name: slots[name] for name in own.choices})
        tape.writing = True
        try:
            request = pipeline.request_of(environment, compilation, verify=0)
            artifacts = self._emit(replace(request, geometry=cast("GeometryService", _Kernel(request.geometry))), self._targets)
            files = pipeline.files(environment, replace(compilation, settings=settings), artifacts)
        finally:
            tape.writing = False
        return files, results


class _Kernel:
    """The geometry service, which does not accept traced numbers: those that the file of the whole robot depends on are pinned."""

    def __init__(self, service: Any) -> None:
        self._service = service

    def __getattr__(self, name: str) -> Any:
        return getattr(self._service, name)

    def assemble(self, name: str, instances: Sequence[Placed]) -> StoredFile:
        """See `GeometryService`. With traced numbers, returns an empty file, since the plan is then for these values only."""
        rows: list[tuple[Any, ...]] = [row for one in instances for row in (*one.pose.rotation, one.pose.translation)]
        traced = [number for row in rows for number in row if isinstance(number, Traced)]
        for number in traced:
            number.tape.pin(number)
        written: StoredFile = StoredFile(sha256="", size=0) if traced else self._service.assemble(name, instances)
        return written


class _Template:
    """A build with slots for numbers. `outputs` are the numbers for them; `like` is a build of this kind."""

    def __init__(self, rehearsal: TraceResult, like: Build) -> None:
        files, results = rehearsal.made
        self._like = like
        self._shape = TracedResults(results)
        self._files: dict[str, Content] = dict(files)
        written = {path: content for path, content in files.items() if isinstance(content, bytes)}
        self._zips = {path: entries(content) for path, content in written.items() if path.endswith(".mjz")}
        models = {path: inflate(inner.pop(MODEL)).decode() for path, inner in self._zips.items()}
        own = {path: models.get(path) or content.decode() for path, content in written.items()}
        manifest = own.pop(MANIFEST)
        self._texts = {path: text for path, content in own.items() if (text := TextTemplate(content)).slots}
        for path in self._texts:
            manifest = manifest.replace(hashlib.sha256(written[path]).hexdigest(), slot(f"{DIGEST}{path}"))
        self._manifest = TextTemplate(manifest)
        self._settings = [name.removeprefix(SETTING) for name in self._manifest.slots if name.startswith(SETTING)]
        said = [name for name in self._manifest.slots if not name.startswith((SETTING, DIGEST))]
        self._numbers = NumberSlots(rehearsal.tape, (*(name for text in self._texts.values() for name in text.slots), *said))
        self.outputs = [*self._numbers.outputs, *self._shape.outputs]

    def build(self, outputs: Sequence[float], settings: Settings) -> Build | None:
        """Return the build for these values of `outputs`; None if a number in a file is not finite."""
        count, like = len(self._numbers.outputs), self._like
        if not all(map(math.isfinite, outputs[:count])):
            return None
        return Build(
            results=self._shape.of(outputs[count:]), problems=like.problems, losses=like.losses, parts=like.parts,
            files=partial(self.files, outputs[:count], settings),
        )

    def files(self, numbers: Sequence[float], settings: Settings) -> dict[str, Content]:
        """Return the files with these numbers and texts of settings."""
        files = dict(self._files)
        words, digests = self._numbers.words(numbers), {}
        given = {**settings.parameters, **settings.choices}
        for path, text in self._texts.items():
            content = text.fill(words).encode()
            if path in self._zips:
                content = zipped({MODEL: content, **self._zips[path]})
            files[path] = content
            digests[f"{DIGEST}{path}"] = hashlib.sha256(content).hexdigest()
        texts = {f"{SETTING}{name}": json_text(encode_basestring(given[name]))[1:-1] for name in self._settings}
        files[MANIFEST] = self._manifest.fill({**words, **digests, **texts}).encode()
        return files


def _same(planned: Build, whole: Build | None) -> bool:
    """Return whether a plan gives the same build as a compilation."""
    said = ("results", "problems", "losses", "parts")
    return whole is not None and all(getattr(planned, name) == getattr(whole, name) for name in said) and planned.files() == whole.files()


class TextTemplate:
    """A text with slots. `slots` are their distinct names."""

    def __init__(self, text: str) -> None:
        self._pieces = SLOT.split(text)
        self.slots = list(dict.fromkeys(self._pieces[1::2]))

    def fill(self, words: Mapping[str, str]) -> str:
        """Return the text with a word in each slot."""
        pieces = self._pieces.copy()
        pieces[1::2] = [words[name] for name in pieces[1::2]]
        return "".join(pieces)


class NumberSlots:
    """The slots for numbers of a tape.

    `outputs` are these numbers, in the order of `names`. Raises `NotTraceable` for names of other slots.
    """

    def __init__(self, tape: Tape, names: Iterable[str]) -> None:
        self.names = list(dict.fromkeys(names))
        self.outputs: list[Traced] = []
        self._formatters = []
        for name in self.names:
            line, _, form = name.partition(":")
            if not line.isdecimal() or int(line) >= len(tape.lines) or not (form in FORMATTERS or form.startswith(":")):
                raise NotTraceable("a string looks like a placeholder of a number")
            self.outputs.append(Traced(tape, int(line), tape.values[int(line)]))
            self._formatters.append(FORMATTERS[form] if form in FORMATTERS else partial(_formatted, form[1:]))

    def words(self, values: Sequence[float]) -> dict[str, str]:
        """Format these values of `outputs`; return the words by slot."""
        return {name: write(value) for name, write, value in zip(self.names, self._formatters, values, strict=True)}


def _formatted(form: str, value: float) -> str:
    return format(value, form)

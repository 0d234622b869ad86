"""Whole builds of many settings: their files are made once, and the texts of other numbers are put into them.
`TextTemplate` is a text with slots for numbers."""

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
"""The targets whose files hold no number that differs but in text, where it has a slot. Not so: `hag`, which writes the words of
settings and is laid out around them; `glb` and `html`, whose numbers are bytes."""

SETTING, DIGEST = "setting:", "digest:"
"""How the names of slots begin that are for the texts of settings, and for the digests of files, in a manifest."""

PATIENCE = 16
"""How many settings of a form are built by every pass before a plan is made, which takes as long as about as many of them."""

Emit = Callable[["EmitRequest", Sequence[str]], "dict[str, Artifacts]"]
"""What gives the artifacts of targets: `emitted`, or less than that."""

Measured = Callable[[Compilation], "dict[str, Any] | None"]
"""What gives results of a compilation; None where there are none, and no build is wanted."""


class Build(FrozenStruct):
    """What comes of settings that are sound: `results`, of whatever was measured; `problems`, all that was said; how many `losses` there
    are, by what becomes of them; and of how many definitions its `parts` are. `files` makes those of the folder, by path, with the
    manifest."""

    results: dict[str, Any]
    problems: tuple[Diagnostic, ...]
    losses: Mapping[str, int]
    parts: int
    files: Callable[[], dict[str, Content]]


class Builds:
    """Builds of one document, for the same modes (none named: all) and targets; `measured` gives their results, `emit` their artifacts, and
    a plan is made for the settings that are the `patience`-th (a power of two, default `PATIENCE`) of their form. `verify`: of each
    plan the first and then one in so many is compared with that by every pass, which MuJoCo compiles, too (None: the first, the second, the
    fourth, the eighth ...; 0: none)."""

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
        """The build of settings by a plan; None where there is no plan that they are of: then nothing is known of them."""
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
            self._forms.of(read).wrong(f"a plan gave other files for {dict(zip(read.names, read.values))}")
            return None
        return made

    def made(self, settings: Settings) -> tuple[Mapping[str, Content], tuple[Diagnostic, ...]]:
        """The files by a plan or by every pass; none where the settings are refused; and all diagnostics."""
        planned = self.planned(settings)
        return self.passed(settings) if planned is None else (planned.files(), planned.problems)

    def passed(self, settings: Settings) -> tuple[Mapping[str, Content], tuple[Diagnostic, ...]]:
        """The files by every pass, of which MuJoCo takes every model; none where the settings are refused; and all that was said."""
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
        """A plan that gives what passes do; None, and the reason in `form`, where there is none."""
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
                form.refused = "a plan gave other files"
                return None
        return plan

    def _written(self, read: ParsedSettings, compilation: Compilation, tape: Tape) -> tuple[Mapping[str, Content], Mapping[str, Any]]:
        """For `trace_compilation`: the files as they are written, with slots for numbers, and for the texts of settings; and results with
        traced numbers."""
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
    """The geometry service, which takes no number on a tape: those that the file of the whole robot depends on are pinned."""

    def __init__(self, service: Any) -> None:
        self._service = service

    def __getattr__(self, name: str) -> Any:
        return getattr(self._service, name)

    def assemble(self, name: str, instances: Sequence[Placed]) -> StoredFile:
        """As a geometry service does; where there are such numbers some file, for the tape is of these values alone."""
        rows: list[tuple[Any, ...]] = [row for one in instances for row in (*one.pose.rotation, one.pose.translation)]
        traced = [number for row in rows for number in row if isinstance(number, Traced)]
        for number in traced:
            number.tape.pin(number)
        written: StoredFile = StoredFile(sha256="", size=0) if traced else self._service.assemble(name, instances)
        return written


class _Template:
    """A build with slots for numbers. `outputs` are those that go into it; `like` is one build of this kind."""

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
        """What comes of these values of `outputs`; None where a number of a file is not finite, which nothing can be said of."""
        count, like = len(self._numbers.outputs), self._like
        if not all(map(math.isfinite, outputs[:count])):
            return None
        return Build(
            results=self._shape.of(outputs[count:]), problems=like.problems, losses=like.losses, parts=like.parts,
            files=partial(self.files, outputs[:count], settings),
        )

    def files(self, numbers: Sequence[float], settings: Settings) -> dict[str, Content]:
        """The files, with these numbers and the texts of these settings."""
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
    """Whether a plan gives what every pass does."""
    said = ("results", "problems", "losses", "parts")
    return whole is not None and all(getattr(planned, name) == getattr(whole, name) for name in said) and planned.files() == whole.files()


class TextTemplate:
    """A text with slots. `slots` are their names, each once."""

    def __init__(self, text: str) -> None:
        self._pieces = SLOT.split(text)
        self.slots = list(dict.fromkeys(self._pieces[1::2]))

    def fill(self, words: Mapping[str, str]) -> str:
        """The text with a word in each slot."""
        pieces = self._pieces.copy()
        pieces[1::2] = [words[name] for name in pieces[1::2]]
        return "".join(pieces)


class NumberSlots:
    """The slots of numbers of a tape. `outputs` are these numbers, in the order of `names`. Raises `NotTraceable` where a text has a slot
    that is none."""

    def __init__(self, tape: Tape, names: Iterable[str]) -> None:
        self.names = list(dict.fromkeys(names))
        self.outputs: list[Traced] = []
        self._formatters = []
        for name in self.names:
            line, _, form = name.partition(":")
            if not line.isdecimal() or int(line) >= len(tape.lines) or not (form in FORMATTERS or form.startswith(":")):
                raise NotTraceable("a text looks like the slot of a number")
            self.outputs.append(Traced(tape, int(line), tape.values[int(line)]))
            self._formatters.append(FORMATTERS[form] if form in FORMATTERS else partial(_formatted, form[1:]))

    def words(self, values: Sequence[float]) -> dict[str, str]:
        """The words for these values of `outputs`."""
        return {name: write(value) for name, write, value in zip(self.names, self._formatters, values, strict=True)}


def _formatted(form: str, value: float) -> str:
    return format(value, form)

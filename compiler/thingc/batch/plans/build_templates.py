"""Create complete builds for many settings of a document.

The build files are generated once with slots. The numbers of other settings are then inserted into these slots.
"""

from __future__ import annotations

import copy
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from json.encoder import encode_basestring
from typing import Any, cast

from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.safe_text import json_text
from thingc.base.zip_files import MODEL, entries, inflate, make_zip
from thingc.batch.plans.numeric_plan import NumericPlan, PlanCache, TracedResults
from thingc.batch.plans.part_exchange import Exchange
from thingc.batch.plans.planner import Planner
from thingc.batch.plans.refusals import Refusals
from thingc.batch.plans.tape import Tape, Traced, slot
from thingc.batch.plans.text_templates import NumberSlots, TextTemplate
from thingc.batch.plans.trace_compilation import TraceResult
from thingc.driver import pipeline
from thingc.driver.pipeline import Compilation
from thingc.driver.session import Session
from thingc.driver.settings import ParsedSettings, SettingsReader
from thingc.geometry.record import Placed, StoredFile
from thingc.geometry.service import GeometryService
from thingc.model.resolve.resolver import Settings
from thingc.targets.artifact import MANIFEST, Artifacts, Content, counts_of
from thingc.targets.registry import TARGETS, run_emitters
from thingc.targets.request import EmitRequest

SETTING, DIGEST = "setting:", "digest:"
"""Prefixes of slot names in a manifest: for the texts of settings, and for the digests of files."""

PATIENCE = 16
"""Number of settings with the same names that are compiled before a plan is created.

Creating a plan takes about as long as this many compilations.
"""

COMPARED = ("results", "problems", "losses", "parts")
"""Fields of builds that are compared, in addition to the files."""

Emit = Callable[["EmitRequest", Sequence[str]], "dict[str, Artifacts]"]
"""A function that returns the artifacts of targets, such as the function `emitted`."""

Measured = Callable[[Compilation], "dict[str, Any] | None"]
"""A function that returns the results of a compilation, or None if results are not available and no build is requested."""


class Build(FrozenStruct):
    """The output files of a build and the measured results of the robot.

    `results` contains the results that the function `measured` returns, and `problems` contains all diagnostics. `losses` maps each kind of
    export loss to a count. `parts` is the number of part definitions of the robot. The method `files` returns a mapping from paths to the
    contents of all files, including the manifest.
    """

    results: dict[str, Any]
    problems: tuple[Diagnostic, ...]
    losses: Mapping[str, int]
    parts: int
    files: Callable[[], dict[str, Content]]


class Builds(Planner["_Template", Build]):
    """Creates builds of a document for many settings, with the same modes (none: all modes) and targets.

    The function `measured` computes the results of a compilation, and the function `emit` creates the files of the targets. A plan is
    created when `patience` settings with the same names have been compiled. `patience` is a power of two (default: `PATIENCE`). For
    each plan, the first build is compared with a compilation, and then one in `verify` builds. If `verify` is None, the first, second,
    fourth, eighth build and so on are compared. If `verify` is 0, no build is compared. MuJoCo also compiles all models of a build that is
    compared.
    """

    exchanges_parts = False

    def __init__(
        self, session: Session, reader: SettingsReader, *, modes: Sequence[str], targets: Sequence[str], verify: int | None,
        measured: Measured = lambda compilation: {}, emit: Emit = run_emitters, patience: int | None = None,
    ) -> None:
        refusals = Refusals(session, reader, modes, verify=verify)
        super().__init__(session, reader, modes, refusals, verify=verify, patience=patience or PATIENCE)
        self._targets = tuple(targets)
        self._has_slots = all(target in TARGETS and TARGETS[target].numbers_in_text for target in targets)
        self._measured = measured
        self._emit = emit

    def build_by_plan(self, settings: Settings) -> Build | None:
        """Create a build for the given settings with a plan.

        Return None if no plan applies to the settings. The settings can then be valid or invalid.
        """
        parsed = self.reader.read({**settings.parameters, **settings.choices})
        names = {*settings.parameters, *settings.choices}
        if names != {*parsed.names, *dict(parsed.texts)} or not self._has_slots:
            return None
        planned = self.find_plan(parsed)
        if planned is None:
            return None
        plan, outputs = planned
        build = plan.template.build(outputs, settings)
        if build is None:
            return None
        confirmed = not plan.is_due(self.verify) or self.confirms(build, self.compile_build(settings)[0], parsed, self.cache_for(parsed))
        return build if confirmed else None

    def find_refusal(self, settings: Settings) -> tuple[tuple[Diagnostic, ...], int] | None:
        """If a plan shows that the settings are refused, return the diagnostics and the number of part definitions.

        Otherwise, return None.
        """
        parsed = self._refusable(settings)
        problems = None if parsed is None else self.refusals.problems(parsed)
        return None if problems is None else (problems, self.refusals.parts)

    def learn(self, settings: Settings, problems: tuple[Diagnostic, ...]) -> None:
        """Record that a compilation of these settings has failed, so that the method `find_refusal` recognizes similar settings."""
        parsed = self._refusable(settings)
        if parsed is not None:
            self.refusals.learn(parsed, problems)

    def _refusable(self, settings: Settings) -> ParsedSettings | None:
        """Parse the settings for the method `find_refusal`.

        Return None if a plan could report other diagnostics than a compilation, or the same diagnostics in another order.
        """
        parsed = self.reader.read({**settings.parameters, **settings.choices})
        rewritten = self.reader.settings(parsed)
        same_order = [*settings.parameters] == [*rewritten.parameters] and [*settings.choices.items()] == [*rewritten.choices.items()]
        return parsed if same_order else None

    def build(self, settings: Settings) -> tuple[Mapping[str, Content], tuple[Diagnostic, ...]]:
        """Create the build files for the given settings, with a plan or by a compilation. Also return the diagnostics of the build.

        For refused settings, do not create any files.
        """
        planned = self.build_by_plan(settings)
        if planned is not None:
            return planned.files(), planned.problems
        refused = self.find_refusal(settings)
        if refused is not None:
            return {}, refused[0]
        build, problems = self.compile_build(settings)
        if build is None:
            self.learn(settings, problems)
        return build.files() if build is not None else {}, problems

    def compile_build(self, settings: Settings, verify: int = 1) -> tuple[Build | None, tuple[Diagnostic, ...]]:
        """Create a build by a compilation, and return it with the diagnostics. The build is None if the settings are refused."""
        compilation = self.session.compile(settings, self.modes)
        report = compilation.report
        if report.failed:
            return None, tuple(report.sorted_diagnostics())
        results = self._measured(compilation)
        request = pipeline.request_of(self.session.environment, compilation, verify=verify)
        artifacts = self._emit(request, self._targets) if results is not None else {}
        problems = tuple(report.sorted_diagnostics())
        if report.failed or results is None:
            return None, problems
        files = self.session.files(compilation, artifacts)
        return Build(
            results=results, problems=problems, losses=counts_of(loss for artifact in artifacts.values() for loss in artifact.losses),
            parts=len(compilation.decisions), files=lambda: files,
        ), problems

    def plan(self, parsed: ParsedSettings, cache: PlanCache[_Template]) -> NumericPlan[_Template] | None:
        """Create a plan that gives the same builds as a compilation.

        If no plan can be created, store the reason in `cache` and return None.
        """
        first, _ = self.compile_build(self.reader.settings(parsed))
        if first is None:
            return None

        def finish(trace: TraceResult, exchange: Exchange | None) -> tuple[Sequence[Any], _Template]:
            template = _Template(trace, first)
            return template.outputs, template

        return self.new_plan(parsed, cache, first, partial(self._write_templates, parsed), finish, applies=False)

    def run_passes(self, parsed: ParsedSettings) -> Build | None:
        """Create a build by a compilation. Return None if the settings are refused."""
        return self.compile_build(self.reader.settings(parsed), verify=0)[0]

    def compute(self, plan: NumericPlan[_Template], outputs: Sequence[float], parsed: ParsedSettings) -> Build | None:
        """Create a build with a plan. Return None if a number in a file would be infinite or NaN."""
        return plan.template.build(outputs, self.reader.settings(parsed))

    def difference(self, computed: Build, compiled: Build) -> str:
        """Return a description of the difference between two builds, or an empty string if they are equal."""
        equal = all(getattr(computed, name) == getattr(compiled, name) for name in COMPARED) and computed.files() == compiled.files()
        return "" if equal else "different files"

    def _write_templates(
        self, parsed: ParsedSettings, compilation: Compilation, tape: Tape,
    ) -> tuple[Mapping[str, Content], Mapping[str, Any]]:
        """Create the files of a traced compilation with slots for numbers and settings, and its results with traced numbers.

        The function `trace_compilation` calls this method.
        """
        results = self._measured(compilation) or {}
        environment = copy.copy(self.session.environment)
        environment.memo = Memo()
        written = self.reader.settings(parsed)
        settings = Settings(
            parameters={name: slot(f"{SETTING}{name}") for name in written.parameters},
            choices={name: slot(f"{SETTING}{name}") for name in written.choices},
        )
        tape.writing = True
        request = pipeline.request_of(environment, compilation, verify=0)
        artifacts = self._emit(replace(request, geometry=cast("GeometryService", _Kernel(request.geometry))), self._targets)
        files = pipeline.files(environment, replace(compilation, settings=settings), artifacts)
        tape.writing = False
        return files, results


class _Kernel:
    """The geometry service that is used during a traced compilation.

    If the STEP file of the robot depends on a traced number, the plan applies only to the current value of this number.
    """

    def __init__(self, service: Any) -> None:
        self._service = service

    def __getattr__(self, name: str) -> Any:
        return getattr(self._service, name)

    def assemble(self, name: str, instances: Sequence[Placed]) -> Callable[[], StoredFile]:
        """Start to write the STEP file of the robot in the same way as `GeometryService`.

        If the poses of parts contain traced numbers, the file is empty instead. In this case, the plan applies only to the current
        values of these numbers.
        """
        rows: list[tuple[Any, ...]] = [row for instance in instances for row in (*instance.pose.rotation, instance.pose.translation)]
        traced = [number for row in rows for number in row if isinstance(number, Traced)]
        for number in traced:
            number.tape.pin(number)
        if traced:
            return lambda: StoredFile(sha256="", size=0)
        wait: Callable[[], StoredFile] = self._service.assemble(name, instances)
        return wait


class _Template:
    """The files of a build with slots for numbers. `outputs` contains the numbers for the slots, followed by those for the results.

    `like` is a compiled build, which has the same diagnostics and export losses.
    """

    def __init__(self, trace: TraceResult, like: Build) -> None:
        files, results = trace.result
        self._like = like
        self._shape = TracedResults(results)
        self._files: dict[str, Content] = dict(files)
        contents = {path: content for path, content in files.items() if isinstance(content, bytes)}
        self._zips = {path: entries(content) for path, content in contents.items() if path.endswith(".mjz")}
        models = {path: inflate(inner.pop(MODEL)).decode() for path, inner in self._zips.items()}
        generated = {path: models.get(path) or content.decode() for path, content in contents.items()}
        manifest = generated.pop(MANIFEST)
        self._texts = {path: text for path, content in generated.items() if (text := TextTemplate(content)).slots}
        for path in self._texts:
            manifest = manifest.replace(hashlib.sha256(contents[path]).hexdigest(), slot(f"{DIGEST}{path}"))
        self._manifest = TextTemplate(manifest)
        self._settings = [name.removeprefix(SETTING) for name in self._manifest.slots if name.startswith(SETTING)]
        manifest_numbers = [name for name in self._manifest.slots if not name.startswith((SETTING, DIGEST))]
        self._numbers = NumberSlots(trace.tape, (*(name for text in self._texts.values() for name in text.slots), *manifest_numbers))
        self.outputs = [*self._numbers.outputs, *self._shape.outputs]

    def build(self, outputs: Sequence[float], settings: Settings) -> Build | None:
        """Create a build in which the numbers have the values `outputs`.

        Return None if a number in one of the files would be infinite or NaN.
        """
        count, like = len(self._numbers.outputs), self._like
        if not all(map(math.isfinite, outputs[:count])):
            return None
        return Build(
            results=self._shape.of(outputs[count:]), problems=like.problems, losses=like.losses, parts=like.parts,
            files=partial(self.files, outputs[:count], settings),
        )

    def files(self, numbers: Sequence[float], settings: Settings) -> dict[str, Content]:
        """Insert numbers and the texts of settings into the slots, and return a mapping from paths to the contents of all files."""
        files = dict(self._files)
        number_texts, digests = self._numbers.format_values(numbers), {}
        setting_texts = {**settings.parameters, **settings.choices}
        for path, text in self._texts.items():
            content = text.fill(number_texts).encode()
            if path in self._zips:
                content = make_zip({MODEL: content, **self._zips[path]})
            files[path] = content
            digests[f"{DIGEST}{path}"] = hashlib.sha256(content).hexdigest()
        texts = {f"{SETTING}{name}": json_text(encode_basestring(setting_texts[name]))[1:-1] for name in self._settings}
        files[MANIFEST] = self._manifest.fill({**number_texts, **digests, **texts}).encode()
        return files

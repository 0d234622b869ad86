"""Compute the diagnostics of invalid settings with a plan, which is faster than running a compilation until it fails.

A failing compilation is traced until it reports its diagnostics. In the texts of these diagnostics, numbers are replaced by slots.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from math import isfinite
from typing import Any

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Severity
from thingc.batch.plans.numeric_plan import NumericPlan, PlanCache
from thingc.batch.plans.part_exchange import Exchange
from thingc.batch.plans.planner import PlanMaker
from thingc.batch.plans.tape import Tape
from thingc.batch.plans.text_templates import NumberSlots, TextTemplate
from thingc.batch.plans.trace_compilation import NotTraceable, TraceResult
from thingc.driver.pipeline import Compilation
from thingc.driver.session import Session
from thingc.driver.settings import ParsedSettings, SettingsReader

CAUSES = 32
"""Maximum number of causes of refusals for which plans are stored. If there are more causes, the least recently used plans are dropped."""
PARTS = frozenset(code for code in Code if code.code.startswith("TC4"))
"""Codes of diagnostics that concern a single part."""
PATIENCE = 4
"""Number of refused settings with the same cause that are compiled before a plan is created for this cause."""
CUT = " characters) ..."
"""A string that all shortened texts contain. The length of a shortened text must not depend on slots."""

Diagnostics = tuple[Diagnostic, ...]
Key = tuple[tuple[str, ...], tuple[tuple[str, str], ...], Hashable]
"""A cache key, which consists of the names of numbers, the texts of other settings, and the cause of the refusal."""


class Refusals(PlanMaker["DiagnosticsTemplate", Diagnostics]):
    """Uses plans to compute the diagnostics of settings that were refused.

    Each cause of a refusal has separate plans. The cause consists of the codes, locations and paths of the diagnostics. `verify` has the
    same meaning as in the class `PlanMaker`. `parts` is the number of part definitions for the most recent refused settings.
    """

    wrong = "different diagnostics"
    traces_failures = True

    def __init__(self, session: Session, reader: SettingsReader, modes: Sequence[str], *, verify: int | None) -> None:
        super().__init__(session, reader, modes, verify=verify)
        self.causes: dict[Key, PlanCache[DiagnosticsTemplate]] = {}
        self.parts = 0
        self._last: tuple[ParsedSettings, Diagnostics | None] | None = None

    def problems(self, parsed: ParsedSettings) -> Diagnostics | None:
        """Return the diagnostics of the given settings if a plan shows that they are refused.

        Return None if no plan applies to the settings. In this case, the settings can be valid or refused.
        """
        if parsed.report is not None or not all(map(isfinite, parsed.values)):  # a compilation rejects such numbers earlier
            return None
        if self._last is None or self._last[0] is not parsed:
            self._last = parsed, self._problems(parsed)
        return self._last[1]

    def learn(self, parsed: ParsedSettings, problems: Diagnostics) -> None:
        """Record that a compilation of these settings has failed with the diagnostics `problems`.

        If several settings are refused for the same cause, a plan is created, unless the errors concern a single part.
        """
        faulty_parts = any(problem.code in PARTS and problem.severity is Severity.ERROR for problem in problems)
        if not parsed.names or parsed.report is not None or faulty_parts:
            return
        key = (parsed.names, parsed.texts, _cause(problems))
        cache = self.causes.pop(key, None) or PlanCache(PATIENCE)
        self.causes = dict([*self.causes.items(), (key, cache)][-CAUSES:])
        if cache.should_create_plan(parsed) and (plan := self._plan(parsed, problems, cache)) is not None:
            cache.add(plan)

    def _problems(self, parsed: ParsedSettings) -> Diagnostics | None:
        for key, cache in reversed(self.causes.items()):
            if key[:2] != (parsed.names, parsed.texts) or (known := cache.find(parsed)) is None:
                continue
            problems = self.compute(*known, parsed)
            if known[0].is_due(self.verify) and not self.confirms(problems, self.run_passes(parsed), parsed, cache):
                return None
            self.causes[key] = self.causes.pop(key)
            self.parts = known[0].template.parts
            return problems
        return None

    def run_passes(self, parsed: ParsedSettings) -> Diagnostics:
        """Compile the document. Return the diagnostics of a refused compilation, or an empty tuple."""
        report = self.session.compile(self.reader.settings(parsed), self.modes).report
        return tuple(report.sorted_diagnostics()) if report.failed else ()

    def compute(self, plan: NumericPlan[DiagnosticsTemplate], outputs: Sequence[float], parsed: ParsedSettings) -> Diagnostics:
        """Compute the diagnostics with a plan."""
        return plan.template.diagnostics(outputs)

    def _plan(
        self, parsed: ParsedSettings, problems: Diagnostics, cache: PlanCache[DiagnosticsTemplate],
    ) -> NumericPlan[DiagnosticsTemplate] | None:
        """Create a plan that gives the same diagnostics as a compilation.

        If no plan can be created, store the reason in `cache` and return None.
        """
        if self.run_passes(parsed) != problems:  # MuJoCo or the writing of files has refused the settings
            cache.failure = "a compilation with these settings succeeds"
            return None

        def collect(compilation: Compilation, tape: Tape) -> tuple[Diagnostics, int]:
            problems_here = tuple(compilation.report.sorted_diagnostics())
            if not compilation.report.failed or _cause(problems_here) != _cause(problems):
                raise NotTraceable("other diagnostics are reported for other values")
            return problems_here, len(compilation.decisions)

        def finish(trace: TraceResult, exchange: Exchange | None) -> tuple[Sequence[Any], DiagnosticsTemplate]:
            template = DiagnosticsTemplate(trace)
            return template.numbers.outputs, template

        return self.new_plan(parsed, cache, problems, collect, finish)


class DiagnosticsTemplate:
    """The diagnostics of a failed compilation, in which numbers are replaced by slots.

    `parts` is the number of part definitions of the failed compilation. Raises `NotTraceable` if a text depends on a number in a way that
    slots do not support.
    """

    def __init__(self, trace: TraceResult) -> None:
        self._all: Diagnostics
        self._all, self.parts = trace.result
        texts = [text for diagnostic in self._all for text in _texts(diagnostic)]
        fixed = [text for diagnostic in self._all for text in (diagnostic.detail or "", *(edit.replacement for edit in diagnostic.fixes))]
        plain = [*trace.tape.quoted, *(trace.parts.quotable_texts if trace.parts is not None else ())]
        self._templates = {text: TextTemplate(text) for text in texts if "⟦" in text}
        if any("⟦" in text for text in fixed) or any(CUT in text for text in self._templates):
            raise NotTraceable("a diagnostic contains text that the plan cannot compute")
        if any(text_of_number in text for text_of_number in plain for text in (*texts, *fixed)):
            raise NotTraceable("a diagnostic contains a number")
        self.numbers = NumberSlots(trace.tape, [name for diagnostic in self._templates.values() for name in diagnostic.slots])

    def diagnostics(self, outputs: Sequence[float]) -> Diagnostics:
        """Insert the values of the numbers into the slots, and return the diagnostics.

        Duplicate diagnostics are omitted, as in a report.
        """
        numbers = self.numbers.format_values(outputs)
        texts = {text: template.fill(numbers) for text, template in self._templates.items()}
        return tuple(dict.fromkeys(_fill(diagnostic, texts) for diagnostic in self._all)) if texts else self._all


def _cause(problems: Diagnostics) -> Hashable:
    return tuple((one.code, one.span, (one.path or "").partition("=")[0], *(note.span for note in one.notes)) for one in problems)


def _texts(diagnostic: Diagnostic) -> list[str]:
    return [diagnostic.message, diagnostic.path or "", diagnostic.help or "", *(note.message for note in diagnostic.notes)]


def _fill(diagnostic: Diagnostic, texts: Mapping[str, str]) -> Diagnostic:
    """Return a copy of a diagnostic in which each text is replaced by its value in `texts`, if any."""
    if not any(text in texts for text in _texts(diagnostic)):
        return diagnostic
    notes = tuple(replace(note, message=texts.get(note.message, note.message)) for note in diagnostic.notes)
    path, help = (None if text is None else texts.get(text, text) for text in (diagnostic.path, diagnostic.help))
    return replace(diagnostic, message=texts.get(diagnostic.message, diagnostic.message), path=path, help=help, notes=notes)

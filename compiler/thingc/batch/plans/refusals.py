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
    """Computes the diagnostics of refused settings with plans.

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

    def problems(self, read: ParsedSettings) -> Diagnostics | None:
        """Return the diagnostics of the given settings if a plan shows that they are refused.

        Return None if no plan applies to the settings. In this case, the settings can be valid or refused.
        """
        if read.report is not None or not all(map(isfinite, read.values)):  # a compilation rejects such numbers earlier
            return None
        if self._last is None or self._last[0] is not read:
            self._last = read, self._problems(read)
        return self._last[1]

    def applies(self, read: ParsedSettings) -> bool:
        """Return whether a plan shows that the given settings are refused."""
        return self.problems(read) is not None

    def learn(self, read: ParsedSettings, problems: Diagnostics) -> None:
        """Record that a compilation of these settings has failed with the diagnostics `problems`.

        If several settings are refused for the same cause, a plan is created, unless the errors concern a single part.
        """
        if not read.names or read.report is not None or any(one.code in PARTS and one.severity is Severity.ERROR for one in problems):
            return
        key = (read.names, read.texts, _cause(problems))
        form = self.causes.pop(key, None) or PlanCache(PATIENCE)
        self.causes = dict([*self.causes.items(), (key, form)][-CAUSES:])
        if form.worth_it(read) and (plan := self._plan(read, problems, form)) is not None:
            form.add(plan)

    def _problems(self, read: ParsedSettings) -> Diagnostics | None:
        for key, form in reversed(self.causes.items()):
            if key[:2] != (read.names, read.texts) or (known := form.plan_for(read)) is None:
                continue
            problems = self.compute(*known, read)
            if known[0].is_due(self.verify) and not self.confirms(problems, self.whole(read), read, form):
                return None
            self.causes[key] = self.causes.pop(key)
            self.parts = known[0].made.parts
            return problems
        return None

    def whole(self, read: ParsedSettings) -> Diagnostics:
        """Compile the document. Return the diagnostics of a refused compilation, or an empty tuple."""
        report = self.session.compile(self.reader.settings(read), self.modes).report
        return tuple(report.sorted_diagnostics()) if report.failed else ()

    def compute(self, plan: NumericPlan[DiagnosticsTemplate], outputs: Sequence[float], read: ParsedSettings) -> Diagnostics:
        """Compute the diagnostics with a plan."""
        return plan.made.diagnostics(outputs)

    def _plan(
        self, read: ParsedSettings, problems: Diagnostics, form: PlanCache[DiagnosticsTemplate],
    ) -> NumericPlan[DiagnosticsTemplate] | None:
        """Create a plan that gives the same diagnostics as a compilation.

        If no plan can be created, store the reason in `form` and return None.
        """
        if self.whole(read) != problems:  # MuJoCo or the writing of files has refused the settings
            form.refused = "a compilation with these settings succeeds"
            return None

        def collect(compilation: Compilation, tape: Tape) -> tuple[Diagnostics, int]:
            found = tuple(compilation.report.sorted_diagnostics())
            if not compilation.report.failed or _cause(found) != _cause(problems):
                raise NotTraceable("other diagnostics are reported for other values")
            return found, len(compilation.decisions)

        def finish(rehearsal: TraceResult, exchange: Exchange | None) -> tuple[Sequence[Any], DiagnosticsTemplate]:
            template = DiagnosticsTemplate(rehearsal)
            return template.numbers.outputs, template

        return self.new_plan(read, form, problems, collect, finish)


class DiagnosticsTemplate:
    """The diagnostics of a failed compilation, in which numbers are replaced by slots.

    `parts` is the number of part definitions of the failed compilation. Raises `NotTraceable` if a text depends on a number in a way that
    slots do not support.
    """

    def __init__(self, rehearsal: TraceResult) -> None:
        self._all: Diagnostics
        self._all, self.parts = rehearsal.made
        texts = [text for one in self._all for text in _texts(one)]
        fixed = [text for one in self._all for text in (one.detail or "", *(edit.replacement for edit in one.fixes))]
        plain = [*rehearsal.tape.quoted, *(rehearsal.parts.words if rehearsal.parts is not None else ())]
        self._templates = {text: TextTemplate(text) for text in texts if "⟦" in text}
        if any("⟦" in text for text in fixed) or any(CUT in text for text in self._templates):
            raise NotTraceable("a diagnostic contains text that the plan cannot compute")
        if any(word in text for word in plain for text in (*texts, *fixed)):
            raise NotTraceable("a diagnostic contains a number")
        self.numbers = NumberSlots(rehearsal.tape, [name for one in self._templates.values() for name in one.slots])

    def diagnostics(self, outputs: Sequence[float]) -> Diagnostics:
        """Insert the values of the numbers into the slots, and return the diagnostics.

        Duplicate diagnostics are omitted, as in a report.
        """
        words = self.numbers.words(outputs)
        texts = {text: template.fill(words) for text, template in self._templates.items()}
        return tuple(dict.fromkeys(_fill(one, texts) for one in self._all)) if texts else self._all


def _cause(problems: Diagnostics) -> Hashable:
    return tuple((one.code, one.span, (one.path or "").partition("=")[0], *(note.span for note in one.notes)) for one in problems)


def _texts(one: Diagnostic) -> list[str]:
    return [one.message, one.path or "", one.help or "", *(note.message for note in one.notes)]


def _fill(one: Diagnostic, texts: Mapping[str, str]) -> Diagnostic:
    """Return a copy of a diagnostic in which words are inserted into the slots of all texts."""
    if not any(text in texts for text in _texts(one)):
        return one
    notes = tuple(replace(note, message=texts.get(note.message, note.message)) for note in one.notes)
    path, help = (None if text is None else texts.get(text, text) for text in (one.path, one.help))
    return replace(one, message=texts.get(one.message, one.message), path=path, help=help, notes=notes)

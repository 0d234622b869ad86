"""Compute the results of a robot, such as its mass and reach, for many settings."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic, Report
from thingc.base.memo import Memo
from thingc.base.units import Quantity
from thingc.batch.families.results import Evaluated
from thingc.batch.measurements import Results, UnknownMount, measure, measure_tests
from thingc.batch.plans.numeric_plan import NumericPlan, PlanCache, TracedResults
from thingc.batch.plans.part_exchange import Exchange
from thingc.batch.plans.planner import Planner
from thingc.batch.plans.refusals import Refusals
from thingc.batch.plans.row_paths import FEW, compute_rows
from thingc.batch.plans.searches import SearchMemo
from thingc.batch.plans.tape import Number, Tape
from thingc.batch.plans.trace_compilation import NotTraceable, TraceResult
from thingc.batch.rules import unkept
from thingc.documents.expressions.evaluation import ExpressionValue
from thingc.driver import pipeline
from thingc.driver.settings import ParsedSettings, SettingsReader

if TYPE_CHECKING:
    from thingc.batch.planning import Plan
    from thingc.batch.plans.columns import Booleans, Floats
    from thingc.driver.pipeline import Compilation
    from thingc.driver.session import Session

Item = tuple[Mapping[str, Any], ParsedSettings]
Planned = tuple[NumericPlan[TracedResults], Sequence[float]]
Verdict = tuple["str | None", tuple[Diagnostic, ...]]
"""The first rule that a robot violates, or None, and the errors of rules that cannot be evaluated."""
Measured = tuple[Results, tuple[Diagnostic, ...]]
"""The results of a compilation and its diagnostics."""


TOGETHER = 4096
"""Maximum number of settings that are read ahead and evaluated together."""
AHEAD = 32
"""Number of settings whose parts are built together."""


class Evaluation(Planner[TracedResults, Measured]):
    """Computes the results of a robot for many settings, in one mode.

    `sites` contains references to mounts whose positions are also results. If `torques` is False, the torque margin is not computed.
    `tests` contains names of document tests. If `tests` is given, only the values that these tests measure are computed.

    The variants document `plan`, if any, specifies the pose, the mounts for the result `reach`, and the rules, which apply if `judged` is
    True. `verify` has the same
    meaning as in the class `Planner`.
    """

    def __init__(
        self, session: Session, reader: SettingsReader, mode: str, plan: Plan | None, refusals: Refusals, *, verify: int | None,
        judged: bool, sites: tuple[str, ...] = (), torques: bool = True, tests: tuple[str, ...] = (),
    ) -> None:
        super().__init__(session, reader, (mode,), refusals, verify=verify)
        self.mode = mode
        pose, reach = (None, None) if plan is None else (plan.pose, plan.reach)
        self.measure = partial(measure, pose=pose, reach=reach, sites=sites, torques=torques)
        self.tests = tests
        self.rules = plan.rules if plan is not None and judged else ()
        self.variants: Any = plan

    def each(self, many: Iterable[Item], *, tests: bool) -> Iterator[Evaluated]:
        """Yield the results of each set of settings, in order. With `tests`, also run the tests of the document."""
        source = iter(many)
        while chunk := list(islice(source, 1 if tests else TOGETHER)):
            ready: dict[int, Planned] = {}
            verdicts: dict[int, Verdict] = {}
            used: set[int] = set()  # plans that have been run for the whole chunk
            for place, (settings, read) in enumerate(chunk):
                planned = ready.pop(place, None)
                if planned is None and not tests:
                    planned = self.find_plan(read)
                    if planned is not None and (
                        id(planned[0]) not in used or (place % AHEAD == 0 and planned[0].exchange is not None)
                    ):
                        used.add(id(planned[0]))
                        together = self._together(planned[0], chunk, place, ready)
                        ready.update(together)
                        verdicts.update(self._verdicts(planned[0], chunk, together))
                if planned is not None and planned[0].is_due(self.verify) and not self.agrees(*planned, read):
                    ready.clear()
                    planned = None
                if planned is None:
                    yield self._evaluate_by_passes(settings, read, tests)
                else:
                    plan, outputs = planned
                    results = plan.made.of(outputs)
                    yield self._apply_rules(settings, read, results, plan.made.problems, verdict=verdicts.get(place))

    def agrees(self, plan: NumericPlan[TracedResults], outputs: Sequence[float], read: ParsedSettings) -> bool:
        """Return whether a plan has given the same results as a compilation. Otherwise, stop using plans for such settings."""
        return self.confirms(self.compute(plan, outputs, read), self.whole(read), read, self.form_of(read))

    def whole(self, read: ParsedSettings) -> Measured | None:
        """Compile the document. Return the results and the diagnostics, or None if there are no results."""
        results, report, _ = self._compile(read)
        return (results, tuple(report.sorted_diagnostics())) if results else None

    def compute(self, plan: NumericPlan[TracedResults], outputs: Sequence[float], read: ParsedSettings) -> Measured:
        """Compute the results and the diagnostics with a plan."""
        return plan.made.of(outputs), plan.made.problems

    def _together(self, plan: NumericPlan[TracedResults], chunk: Sequence[Item], place: int, ready: Collection[int]) -> dict[int, Planned]:
        """Run a plan for the settings after the index `place` that differ only in numbers from the settings at this index.

        Return a mapping from the index of the settings to the outputs of the plan.
        """
        form = (chunk[place][1].names, chunk[place][1].texts)
        alike = [
            other for other in range(place + 1, len(chunk))
            if other not in ready and (chunk[other][1].names, chunk[other][1].texts) == form and chunk[other][1].report is None
        ]
        if plan.exchange is not None:
            plan.prepare([chunk[other][1].values for other in alike[: AHEAD - place % AHEAD]])
        if plan.exchange is not None or len(alike) < FEW:
            return {}
        outputs, ok = plan.columns(np.array([chunk[other][1].values for other in alike]))
        self.form_of(chunk[place][1]).met += int(ok.sum())
        return {other: (plan, row) for other, row, applies in zip(alike, outputs.tolist(), ok, strict=True) if applies}

    def columns(
        self, rows: Floats, names: Sequence[str], item: Callable[[Floats], Item],
        restricted: Callable[[NumericPlan[TracedResults]], NumericPlan[TracedResults]],
    ) -> tuple[Floats, Booleans, tuple[Diagnostic, ...]] | None:
        """Compute the results of many settings at once with a plan. Each row of `rows` contains values of the numbers `names`.

        Return the outputs of the plan, a flag for each row that is True if the plan applies, and the diagnostics that all rows have in
        common. Return None if no plan exists for these settings. The callback `item` converts a row to settings. The callback `restricted`
        returns a plan that computes only the required outputs.
        """
        if len(rows) < FEW:
            return None
        read = item(rows[0])[1]
        plan, _ = self.plan_at(read)
        if plan is None or plan.exchange is not None:
            return None
        values = np.tile(read.values, (len(rows), 1))
        values[:, [read.names.index(name) for name in names]] = rows + 0.0  # adding 0.0 removes the sign of zeros
        outputs, applies = restricted(plan).columns(values)
        for row in rows[applies] if self.verify != 0 else ():
            if plan.is_due(self.verify):
                due = item(row)[1]
                whole = plan.outputs(due.values)
                if whole is None or not self.agrees(plan, whole, due):
                    return None
        return outputs, applies, plan.made.problems

    def plan_at(self, read: ParsedSettings) -> tuple[NumericPlan[TracedResults] | None, str]:
        """Return the plan that applies to the given settings. If no plan exists, create a plan.

        If no plan can be created, return None and the reason.
        """
        form = self.form_of(read)
        known = form.plan_for(read)
        plan = self.plan(read, form) if known is None and form.refused is None else None
        if plan is not None and (outputs := plan.outputs(read.values)) is not None:
            form.add(plan)
            known = plan, outputs
        return (None if known is None else known[0]), "; ".join(f"`{name}`: {why}" for name, why in form.why.items()) or form.refused or ""

    def plan(self, read: ParsedSettings, form: PlanCache[TracedResults]) -> NumericPlan[TracedResults] | None:
        """Create a plan that gives the same results as a compilation.

        If no plan can be created, store the reason in `form` and return None.
        """
        first = self.whole(read)
        if first is None:
            return None

        def finish(rehearsal: TraceResult, exchange: Exchange | None) -> tuple[Sequence[Any], TracedResults]:
            if exchange is not None and first[1]:
                raise NotTraceable("diagnostics were reported that may depend on a part", list(form.modelled))
            shape = TracedResults(rehearsal.made, first[1])
            return shape.outputs, shape

        def trace(compilation: Compilation, tape: Tape) -> Results:
            return self._results(compilation, SearchMemo(tape))

        return self.new_plan(read, form, first, trace, finish)

    def _results(self, compilation: Compilation, memo: Memo | None = None) -> Results:
        if self.tests:
            request = pipeline.request_of(self.session.environment, compilation)
            return measure_tests(replace(request, memo=memo or request.memo), self.tests)
        return self.measure(compilation.robots[0], memo=memo)

    # --- through every pass ---------------------------------------------------------------------------------------------

    def _compile(self, read: ParsedSettings) -> tuple[Results, Report, Compilation | None]:
        """Compile the document with the given settings. Return a tuple of the results, the report, and the compilation.

        If the settings are refused, the results are empty. If there are errors, the compilation is None.
        """
        if read.report is not None:
            return {}, read.report, None
        compilation = self.session.compile(self.reader.settings(read), (self.mode,))
        report: Report = compilation.report
        if report.failed:
            return {}, report, None
        try:
            return self._results(compilation), report, compilation
        except UnknownMount as fault:
            report.say(fault.diagnostic)
            return {}, report, None

    def _evaluate_by_passes(self, settings: Mapping[str, Any], read: ParsedSettings, tests: bool) -> Evaluated:
        known = self.refusals.problems(read)
        if known is not None:
            return self._apply_rules(settings, read, {}, known)
        results, report, compilation = self._compile(read)
        if report.failed and compilation is None:
            self.refusals.learn(read, tuple(report.sorted_diagnostics()))
        done: tuple[Any, ...] = ()
        if tests and compilation is not None:
            from thingc.driver.testing.test_runner import Selection, run

            whole = self.session.compile(self.reader.settings(read))
            report = whole.report
            if not report.failed:
                said = len(report.diagnostics)
                done = tuple(run(pipeline.request_of(self.session.environment, whole), Selection()))
                del report.diagnostics[said:]  # failures are in the results of the tests
        return self._apply_rules(settings, read, results, tuple(report.sorted_diagnostics()), done)

    def _apply_rules(
        self, settings: Mapping[str, Any], read: ParsedSettings, results: Results, problems: tuple[Diagnostic, ...],
        tests: tuple[Any, ...] = (), verdict: Verdict | None = None,
    ) -> Evaluated:
        broken = None
        if results and self.rules:
            broken, more = verdict or self._find_violation(read, results)
            problems = (*problems, *more)
        return Evaluated(settings=settings, results=results, problems=problems, broken=broken, tests=tests)

    def _verdicts(self, plan: NumericPlan[TracedResults], chunk: Sequence[Item], together: Mapping[int, Planned]) -> dict[int, Verdict]:
        """Evaluate the rules for all results of a plan at once.

        Return a mapping from the index of settings to the verdict. Settings for which a rule cannot be evaluated are omitted.
        """
        reads = [chunk[place][1] for place in together]
        if not (self.rules and reads) or self._has_texts(reads[0]):
            return {}
        names, kinds = reads[0].names, [one.dimension for one in self.reader.quantities(reads[0]).values()]

        def judge(numbers: Sequence[Number]) -> tuple[Verdict, Sequence[Number]] | None:
            given = {name: Quantity(number, kind) for name, kind, number in zip(names, kinds, numbers)}
            values, results = self.variants.values(given), plan.made.of(numbers[len(names) :])
            rule, wrong = next(unkept(self.rules, values, results, self.mode), (None, None))
            return None if wrong is not None else ((None if rule is None else rule.text, ()), ())

        rows = np.array([(*read.values, *outputs) for read, (_, outputs) in zip(reads, together.values(), strict=True)])
        return {place: one[0] for place, one in zip(together, compute_rows(judge, rows), strict=True) if one is not None}

    def _has_texts(self, read: ParsedSettings) -> bool:
        """Return whether some parameters are not numbers, but flags, texts or expressions."""
        return any(name in self.reader.parameters for name, _ in read.texts)

    def _find_violation(self, read: ParsedSettings, results: Results) -> Verdict:
        """Return the first rule that the results violate, or None if all rules are satisfied.

        Also return the errors of rules that cannot be evaluated.
        """
        given: Mapping[str, ExpressionValue] = self.reader.values(read) if self._has_texts(read) else self.reader.quantities(read)
        undecided: list[Diagnostic] = []
        for rule, wrong in unkept(self.rules, self.variants.values(given), results, self.mode):
            if wrong is None:
                return rule.text, ()
            undecided.append(wrong)
        return None, tuple(undecided)

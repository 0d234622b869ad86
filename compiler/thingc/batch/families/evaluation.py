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
from thingc.batch.plans.tape import Number
from thingc.batch.plans.trace_compilation import NotTraceable, TraceResult
from thingc.batch.rules import violations
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
    True. `verify` has the same meaning as in the class `Planner`.
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

    def each(self, items: Iterable[Item], *, tests: bool) -> Iterator[Evaluated]:
        """Yield the results of each set of settings, in order. With `tests`, also run the tests of the document."""
        source = iter(items)
        while chunk := list(islice(source, 1 if tests else TOGETHER)):
            ready: dict[int, Planned] = {}
            verdicts: dict[int, Verdict] = {}
            used: set[int] = set()  # plans that have been run for the whole chunk
            for place, (settings, parsed) in enumerate(chunk):
                planned = ready.pop(place, None)
                if planned is None and not tests:
                    if place % AHEAD == 0:
                        self._build_parts(chunk, place, used)
                    planned = self.find_plan(parsed)
                    if planned is not None and id(planned[0]) not in used:
                        used.add(id(planned[0]))
                        if planned[0].exchange is not None:
                            self._build_parts(chunk, place, used)
                        together = self._together(planned[0], chunk, place, ready)
                        ready.update(together)
                        verdicts.update(self._verdicts(planned[0], chunk, together))
                if planned is not None and planned[0].is_due(self.verify) and not self.agrees(*planned, parsed):
                    ready.clear()
                    planned = None
                if planned is None:
                    yield self._evaluate_by_passes(settings, parsed, tests)
                else:
                    plan, outputs = planned
                    results = plan.template.of(outputs)
                    yield self._apply_rules(settings, parsed, results, plan.template.problems, verdict=verdicts.get(place))

    def agrees(self, plan: NumericPlan[TracedResults], outputs: Sequence[float], parsed: ParsedSettings) -> bool:
        """Return whether the results of a plan equal those of a compilation. Otherwise, stop using plans for similar settings."""
        return self.confirms(self.compute(plan, outputs, parsed), self.run_passes(parsed), parsed, self.cache_for(parsed))

    def run_passes(self, parsed: ParsedSettings) -> Measured | None:
        """Compile the document. Return the results and the diagnostics, or None if there are no results."""
        results, report, _ = self._compile(parsed)
        return (results, tuple(report.sorted_diagnostics())) if results else None

    def compute(self, plan: NumericPlan[TracedResults], outputs: Sequence[float], parsed: ParsedSettings) -> Measured:
        """Compute the results and the diagnostics with a plan."""
        return plan.template.of(outputs), plan.template.problems

    def _build_parts(self, chunk: Sequence[Item], place: int, used: set[int]) -> None:
        """Build the parts of the settings `chunk[place]`, and of similar settings in the same group of `AHEAD` settings, at the same time.

        The parts are built only if there is a plan with exchanged parts for these settings. The identity of this plan is added to `used`.
        """
        plan = next((plan for plan in self.cache_for(chunk[place][1]).plans if plan.exchange is not None), None)
        if plan is not None:
            used.add(id(plan))
            end = place - place % AHEAD + AHEAD
            plan.prepare([chunk[other][1].values for other in _similar(chunk[:end], place)])

    def _together(self, plan: NumericPlan[TracedResults], chunk: Sequence[Item], place: int, ready: Collection[int]) -> dict[int, Planned]:
        """Run the plan of the settings `chunk[place]` for all later settings of the chunk that differ from them only in numbers.

        Return the plan and its outputs for each of these settings, keyed by index in the chunk. Settings in `ready` are skipped.
        """
        others = [other for other in _similar(chunk, place) if other != place and other not in ready]
        if plan.exchange is not None or len(others) < FEW:
            return {}
        outputs, ok = plan.columns(np.array([chunk[other][1].values for other in others]))
        self.cache_for(chunk[place][1]).hits += int(ok.sum())
        return {other: (plan, row) for other, row, applies in zip(others, outputs.tolist(), ok, strict=True) if applies}

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
        parsed = item(rows[0])[1]
        plan, _ = self.plan_at(parsed)
        if plan is None or plan.exchange is not None:
            return None
        values = np.tile(parsed.values, (len(rows), 1))
        values[:, [parsed.names.index(name) for name in names]] = rows + 0.0  # adding 0.0 removes the sign of zeros
        outputs, applies = restricted(plan).columns(values)
        for row in rows[applies] if self.verify != 0 else ():
            if plan.is_due(self.verify):
                due = item(row)[1]
                outputs_of_row = plan.outputs(due.values)
                if outputs_of_row is None or not self.agrees(plan, outputs_of_row, due):
                    return None
        return outputs, applies, plan.template.problems

    def plan_at(self, parsed: ParsedSettings) -> tuple[NumericPlan[TracedResults] | None, str]:
        """Return the plan that applies to the given settings. If no plan exists, create a plan.

        If no plan can be created, return None and the reason.
        """
        cache = self.cache_for(parsed)
        known = cache.find(parsed)
        plan = self.plan(parsed, cache) if known is None and cache.failure is None else None
        if plan is not None and (outputs := plan.outputs(parsed.values)) is not None:
            cache.add(plan)
            known = plan, outputs
        reasons = "; ".join(f"`{name}`: {why}" for name, why in cache.reasons.items())
        return (None if known is None else known[0]), reasons or cache.failure or ""

    def plan(self, parsed: ParsedSettings, cache: PlanCache[TracedResults]) -> NumericPlan[TracedResults] | None:
        """Create a plan that gives the same results as a compilation.

        If no plan can be created, store the reason in `cache` and return None.
        """
        first = self.run_passes(parsed)
        if first is None:
            return None

        def finish(trace: TraceResult, exchange: Exchange | None) -> tuple[Sequence[Any], TracedResults]:
            if exchange is not None and first[1]:
                raise NotTraceable("diagnostics were reported that may depend on a part", list(cache.modelled))
            shape = TracedResults(trace.result, first[1])
            return shape.outputs, shape

        return self.new_plan(parsed, cache, first, lambda compilation, tape: self._results(compilation, SearchMemo(tape)), finish)

    def _results(self, compilation: Compilation, memo: Memo | None = None) -> Results:
        if self.tests:
            request = pipeline.request_of(self.session.environment, compilation)
            return measure_tests(replace(request, memo=memo or request.memo), self.tests)
        return self.measure(compilation.robots[0], memo=memo)

    # --- through every pass ---------------------------------------------------------------------------------------------

    def _compile(self, parsed: ParsedSettings) -> tuple[Results, Report, Compilation | None]:
        """Compile the document with the given settings. Return a tuple of the results, the report, and the compilation.

        If the settings are refused, the results are empty. If there are errors, the compilation is None.
        """
        if parsed.report is not None:
            return {}, parsed.report, None
        compilation = self.session.compile(self.reader.settings(parsed), (self.mode,))
        report: Report = compilation.report
        if report.failed:
            return {}, report, None
        try:
            return self._results(compilation), report, compilation
        except UnknownMount as fault:
            report.say(fault.diagnostic)
            return {}, report, None

    def _evaluate_by_passes(self, settings: Mapping[str, Any], parsed: ParsedSettings, tests: bool) -> Evaluated:
        known = self.refusals.problems(parsed)
        if known is not None:
            return self._apply_rules(settings, parsed, {}, known)
        results, report, compilation = self._compile(parsed)
        if report.failed and compilation is None:
            self.refusals.learn(parsed, tuple(report.sorted_diagnostics()))
        test_results: tuple[Any, ...] = ()
        if tests and compilation is not None:
            from thingc.driver.testing.test_runner import Selection, run

            full = self.session.compile(self.reader.settings(parsed))
            report = full.report
            if not report.failed:
                reported = len(report.diagnostics)
                test_results = tuple(run(pipeline.request_of(self.session.environment, full), Selection()))
                del report.diagnostics[reported:]  # failures are in the results of the tests
        return self._apply_rules(settings, parsed, results, tuple(report.sorted_diagnostics()), test_results)

    def _apply_rules(
        self, settings: Mapping[str, Any], parsed: ParsedSettings, results: Results, problems: tuple[Diagnostic, ...],
        tests: tuple[Any, ...] = (), verdict: Verdict | None = None,
    ) -> Evaluated:
        broken = None
        if results and self.rules:
            broken, rule_errors = verdict or self._find_violation(parsed, results)
            problems = (*problems, *rule_errors)
        return Evaluated(settings=settings, results=results, problems=problems, broken=broken, tests=tests)

    def _verdicts(self, plan: NumericPlan[TracedResults], chunk: Sequence[Item], together: Mapping[int, Planned]) -> dict[int, Verdict]:
        """Evaluate the rules for all results of a plan at once.

        Return a mapping from the index of settings to the verdict. Settings for which a rule cannot be evaluated are omitted.
        """
        reads = [chunk[place][1] for place in together]
        if not (self.rules and reads) or self._has_texts(reads[0]):
            return {}
        names, kinds = reads[0].names, [quantity.dimension for quantity in self.reader.quantities(reads[0]).values()]

        def judge(numbers: Sequence[Number]) -> tuple[Verdict, Sequence[Number]] | None:
            quantities = {name: Quantity(number, kind) for name, kind, number in zip(names, kinds, numbers)}
            values, results = self.variants.values(quantities), plan.template.of(numbers[len(names) :])
            rule, error = next(violations(self.rules, values, results, self.mode), (None, None))
            return None if error is not None else ((None if rule is None else rule.text, ()), ())

        rows = np.array([(*parsed.values, *outputs) for parsed, (_, outputs) in zip(reads, together.values(), strict=True)])
        return {place: quantity[0] for place, quantity in zip(together, compute_rows(judge, rows), strict=True) if quantity is not None}

    def _has_texts(self, parsed: ParsedSettings) -> bool:
        """Return whether some parameters are not numbers, but flags, texts or expressions."""
        return any(name in self.reader.parameters for name, _ in parsed.texts)

    def _find_violation(self, parsed: ParsedSettings, results: Results) -> Verdict:
        """Return the first rule that the results violate and no errors, or else None and the errors of rules that cannot be evaluated."""
        values: Mapping[str, ExpressionValue] = self.reader.values(parsed) if self._has_texts(parsed) else self.reader.quantities(parsed)
        undecided: list[Diagnostic] = []
        for rule, error in violations(self.rules, self.variants.values(values), results, self.mode):
            if error is None:
                return rule.text, ()
            undecided.append(error)
        return None, tuple(undecided)


def _similar(chunk: Sequence[Item], place: int) -> list[int]:
    """Return the indices of the valid settings from `chunk[place]` on that differ from these settings only in numbers."""
    names, texts = chunk[place][1].names, chunk[place][1].texts
    return [
        other for other in range(place, len(chunk))
        if chunk[other][1].names == names and chunk[other][1].texts == texts and chunk[other][1].report is None
    ]

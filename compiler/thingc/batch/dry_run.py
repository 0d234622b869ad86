"""Count the variants of a batch and check their settings, without building parts or writing files.

Rules on parameters are evaluated for every variant. Variants are resolved as in a build. Resolving checks values, limits, poses and parts,
but does not build geometry. For a large number of variants, only a random sample is resolved. A plan, if available, checks further
variants.
"""

from __future__ import annotations

import random
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, tee
from typing import Any

from thingc.base.diagnostics import Diagnostic, Report, Severity
from thingc.base.memo import Memo
from thingc.batch.families.evaluation import Evaluation, Item
from thingc.batch.families.results import Evaluated
from thingc.batch.measurements import Results
from thingc.batch.planning import Plan
from thingc.batch.plans.part_exchange import PartDependsOnNumber, numbers_of
from thingc.batch.plans.refusals import Refusals
from thingc.batch.variant import Variant
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.driver.session import Session
from thingc.driver.settings import ParsedSettings, SettingsReader
from thingc.geometry.record import PartDefinition
from thingc.model.assembly.linking import link
from thingc.model.resolve.resolver import Settings, Sources

SHOWN = 5
"""Number of example variants that a dry run prints."""
MOST = 1000
"""Maximum number of variants that a dry run resolves without a plan. Resolving this many variants takes some seconds."""


@dataclass(slots=True, kw_only=True)
class DryRun:
    """The result of a dry run of a batch with `count` variants.

    `failing` maps each rule on parameters to the number of variants that violate the rule. `looked_at` is the number of variants that were
    resolved, all of which satisfy the rules on parameters. `unsound` maps diagnostic codes to numbers of resolved variants. `examples`
    contains the first variant and error with each code. The resolved variants use `parts` distinct part definitions, of which `known` are
    in the store. `first` contains the first variants of the batch.
    """

    count: int = 0
    failing: dict[str, int] = field(default_factory=dict)
    looked_at: int = 0
    unsound: dict[str, int] = field(default_factory=dict)
    examples: dict[str, tuple[str, Diagnostic]] = field(default_factory=dict)
    parts: int = 0
    known: int = 0
    first: list[Variant] = field(default_factory=list)

    @property
    def left(self) -> int:
        """The number of variants that satisfy all rules on parameters."""
        return self.count - sum(self.failing.values())


def forecast(plan: Plan, options: Options, limit: int | None = None) -> DryRun:
    """Check the settings of all variants of a plan, or of the first `limit` variants, without geometry.

    If there are more than `MOST` variants, only a random sample is resolved.
    """
    result, sample_result = DryRun(), DryRun()
    count = plan.count if limit is None else min(limit, plan.count)
    sampled_indices = range(count) if count <= MOST else frozenset(random.Random(0).sample(range(count), MOST))
    with Resolving(plan.assembly, options) as session:
        assert session.sources is not None  # the plan was created from these sources
        resolution = Resolution(session, SettingsReader(session.sources, kinds=plan.paths.kinds), sampled_indices)
        variants, resolved = tee(_satisfying(islice(plan, count), result))
        for variant, evaluated in zip(variants, resolution.each(map(resolution.item, resolved), tests=False)):
            error = next((problem for problem in evaluated.problems if problem.severity is Severity.ERROR), None)
            if not evaluated.results and error is None:
                continue
            for tally in (result, sample_result) if variant.index in sampled_indices else (result,):
                tally.looked_at += 1
                if error is not None:
                    code = error.code.code
                    tally.unsound[code] = tally.unsound.get(code, 0) + 1
                    if code not in tally.examples:
                        tally.examples[code] = _example(session, variant, error)
        if result.looked_at < result.left:  # otherwise, errors would be rare, because plans apply to valid settings more often
            result.looked_at, result.unsound, result.examples = sample_result.looked_at, sample_result.unsound, sample_result.examples
        result.parts = len(resolution.parts)
        result.known = sum(session.environment.geometry.in_store(part) for part in resolution.parts.values())
    return result


def _satisfying(variants: Iterable[Variant], result: DryRun) -> Iterator[Variant]:
    """Yield the variants that satisfy all rules on parameters, and update the counts in `result`."""
    for variant in variants:
        result.count += 1
        if len(result.first) < SHOWN:
            result.first.append(variant)
        if variant.failed is None:
            yield variant
        else:
            result.failing[variant.failed] = result.failing.get(variant.failed, 0) + 1


class Resolving(Session):
    """A session that compiles a document without geometry, up to the pass `link`."""

    def passes(self, environment: Environment, sources: Sources | None, settings: Settings, modes: Sequence[str]) -> Compilation:
        """Run the passes `resolve` and `link` without geometry. The compilation contains no part records, no assembly and no robots."""
        report = Report()
        assert sources is not None
        model = pipeline.model(environment, sources, settings, report)
        if model is not None:
            if dependent := [part for part in model.part_definitions() if numbers_of(part)]:
                raise PartDependsOnNumber(dependent[0])
            link(model, {}, report, unmodelled=True)
        return Compilation(settings=settings, report=report, model=model)


class Resolution(Evaluation):
    """Checks settings by resolving the document without building parts.

    `parts` contains the part definitions of all resolved settings, keyed by definition text. After `MOST` settings have been resolved, only
    variants whose index is in `drawn` are resolved. All other settings then give no results.
    """

    def __init__(self, session: Session, reader: SettingsReader, sampled_indices: Container[int]) -> None:
        super().__init__(session, reader, "", None, Refusals(session, reader, (), verify=None), verify=None, judged=False)
        self.parts: dict[str, PartDefinition] = {}
        self._sampled_indices = sampled_indices
        self._required: set[ParsedSettings] = set()
        self._resolved = 0

    def item(self, variant: Variant) -> Item:
        """Convert a variant to a pair of settings and parsed settings, as the method `each` requires."""
        settings = {**variant.parameters, **variant.choices}
        parsed = self.reader.read(settings)
        if variant.index in self._sampled_indices:
            self._required.add(parsed)
        return settings, parsed

    def _results(self, compilation: Compilation, memo: Memo | None = None) -> Results:
        assert compilation.model is not None
        parts = {part.text: part for part in compilation.model.part_definitions()}
        self.parts.update(parts)
        return {"parts": float(len(parts))}

    def _evaluate_by_passes(self, settings: Mapping[str, Any], parsed: ParsedSettings, tests: bool) -> Evaluated:
        if self.refusals.problems(parsed) is None:
            if self._resolved >= MOST and parsed not in self._required:
                return Evaluated(settings=settings, results={})
            self._resolved += 1
        return super()._evaluate_by_passes(settings, parsed, tests)


def _example(session: Session, variant: Variant, error: Diagnostic) -> tuple[str, Diagnostic]:
    """Compile a variant without plans, and return its name and its error, in which numbers have the units of the documents."""
    report = session.compile(Settings(parameters=variant.parameters, choices=variant.choices)).report
    return variant.name, next((diagnostic for diagnostic in report.sorted_diagnostics() if diagnostic.code is error.code), error)

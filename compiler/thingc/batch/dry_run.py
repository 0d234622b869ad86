"""Dry run of a batch: count and check variants without building parts or writing files.

Rules on parameters are evaluated for every variant. The documents (values, limits, poses and parts) are resolved as in a build, but without
geometry. For many variants, only a random sample is resolved.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from itertools import islice

from thingc.base.diagnostics import Diagnostic, Report, Severity
from thingc.batch.planning import Plan, Variant
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.geometry.record import PartDefinition
from thingc.model.assembly.linking import link
from thingc.model.resolve.nested_assemblies import part_definitions
from thingc.model.resolve.resolver import Settings, Sources

SHOWN = 5
"""Number of variants that a dry run shows."""
MOST = 1000
"""Maximum number of variants that a dry run resolves. Resolving this number takes some seconds."""


@dataclass(slots=True, kw_only=True)
class DryRun:
    """The result of a dry run of `count` variants.

    `failing` counts the variants that violate each rule on parameters. `looked_at` is the number of resolved variants, which satisfy these
    rules. Among the resolved variants, `unsound` counts variants with errors per code, and `examples` contains the first variant and error
    of each code. The resolved variants use `parts` distinct parts; the store contains `known` of these parts. `first` are the first
    variants.
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
        """The number of variants that satisfy the rules on parameters."""
        return self.count - sum(self.failing.values())


def forecast(plan: Plan, options: Options, limit: int | None = None) -> DryRun:
    """Check all variants, or the first `limit` variants, without geometry. For more than `MOST` variants, resolve only a sample."""
    foreseen = DryRun()
    parts: dict[str, PartDefinition] = {}
    count = plan.count if limit is None else min(limit, plan.count)
    drawn = None if count <= MOST else frozenset(random.Random(0).sample(range(count), MOST))
    with Environment(plan.assembly, options) as environment:
        sources = pipeline.read(environment)
        for number, variant in enumerate(islice(plan, count)):
            foreseen.count += 1
            if len(foreseen.first) < SHOWN:
                foreseen.first.append(variant)
            if variant.failed is not None:
                foreseen.failing[variant.failed] = foreseen.failing.get(variant.failed, 0) + 1
            elif drawn is None or number in drawn:
                foreseen.looked_at += 1
                if sources is not None:
                    _look(environment, sources, variant, foreseen, parts)
        foreseen.parts = len(parts)
        foreseen.known = sum(environment.geometry.in_store(part) for part in parts.values())
    return foreseen


def _look(environment: Environment, own: Sources, variant: Variant, forecast: DryRun, parts: dict[str, PartDefinition]) -> None:
    """Resolve a variant, and record its parts or its first error."""
    report = Report()
    model = pipeline.model(environment, own, Settings(parameters=variant.parameters, choices=variant.choices), report)
    if model is not None:
        link(model, {}, report, unmodelled=True)
    wrong = next((one for one in report.ordered() if one.severity is Severity.ERROR), None)
    if wrong is not None:
        forecast.unsound[wrong.code.code] = forecast.unsound.get(wrong.code.code, 0) + 1
        forecast.examples.setdefault(wrong.code.code, (variant.name, wrong))
    elif model is not None:
        parts.update({part.text: part for part in part_definitions(model)})

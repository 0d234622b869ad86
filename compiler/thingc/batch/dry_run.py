"""What a batch would do: counted and said, with nothing modelled and nothing written.

Rules on parameters are decided of every variant. What the documents alone say of one (its values, its limits and its poses, the parts
that it takes) is worked out as a build does it, with parts of which nothing is known: of very many variants, of some that are drawn.
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
"""Variants that a forecast shows."""
MOST = 1000
"""Variants that are worked out: some seconds."""


@dataclass(slots=True, kw_only=True)
class DryRun:
    """`count` variants, of which `failing` do not keep a rule on parameters, by rule. Of the others `looked_at` were worked out: `unsound`
    of them have errors before any part is modelled, by code, and all take `parts` distinct parts, of which `known` need not be
    modelled. `first` are the first variants, `examples` the first that has an error of a code, with that."""

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
        """Variants that rules on parameters leave."""
        return self.count - sum(self.failing.values())


def forecast(plan: Plan, options: Options, limit: int | None = None) -> DryRun:
    """Look at every variant (at the first `limit`) as far as it is known without geometry; of more than `MOST`, at so many of them."""
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
    """Work out what the documents say of a variant: its parts, or the first error."""
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

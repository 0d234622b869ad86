"""What a batch would do: counted and said, with nothing modelled and nothing written."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import islice

from thingc.diagnostics import Report
from thingc.pipeline import Front, Options
from thingc.realize.record import PartDefinition
from thingc.resolve import part_definitions, resolve
from thingc.variants.planning import Plan, Variant

SHOWN = 5
"""Variants that a forecast shows."""


@dataclass(slots=True, kw_only=True)
class Forecast:
    """`count` variants, of which `failing` do not keep a rule on parameters, by rule, and `unsound` have errors before any part is
    modelled, by code; `parts` distinct parts, of which `known` need not be modelled. `first` are the first variants."""

    count: int = 0
    failing: dict[str, int] = field(default_factory=dict)
    unsound: dict[str, int] = field(default_factory=dict)
    parts: int = 0
    known: int = 0
    first: list[Variant] = field(default_factory=list)


def forecast(plan: Plan, options: Options, limit: int | None = None) -> Forecast:
    """Look at every variant (at the first `limit`) as far as it is known without geometry."""
    found = Forecast()
    parts: dict[str, PartDefinition] = {}
    with Front(plan.assembly, options) as front:
        front.read()
        for variant in islice(plan, limit):
            found.count += 1
            if len(found.first) < SHOWN:
                found.first.append(variant)
            if variant.failed is not None:
                found.failing[variant.failed] = found.failing.get(variant.failed, 0) + 1
                continue
            report = Report()
            sources = front.sources(variant.choices, report)
            if sources is None or front.workspace is None:
                break
            model = resolve(
                sources.documents, sources.specs, front.workspace, sources.schemas, variant.parameters, report, variant.choices,
            )
            if model is None or report.failed:
                code = next((one.code.code for one in report.ordered()), "")
                found.unsound[code] = found.unsound.get(code, 0) + 1
                continue
            parts.update({part.text: part for part in part_definitions(model)})
        found.parts = len(parts)
        found.known = sum(front.geometry.in_store(part) for part in parts.values())
    return found

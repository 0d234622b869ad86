"""Values that variants set by their path: what stands there in the assembly, and of which kind values are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any

from thingc.base.frozen import dataclass
from thingc.base.units import Quantity
from thingc.documents.expressions.evaluation import ExpressionValue, evaluate
from thingc.documents.expressions.terms import Expression, ExpressionError
from thingc.documents.load.documents import Documents
from thingc.documents.spec.settable_values import current_value
from thingc.documents.spec.variants import AxisSpec, VariantsSpec


@dataclass(frozen=True, slots=True, kw_only=True)
class Paths:
    """Every path at which a document of variants sets values, in the order written: `kinds` has a value of the kind that stands there,
    `own` those that the assembly says itself, of which `expressions` are worked out."""

    kinds: Mapping[str, ExpressionValue]
    own: Mapping[str, ExpressionValue]
    expressions: Mapping[str, Expression]


def read(spec: VariantsSpec, documents: Documents, parameters: Mapping[str, ExpressionValue]) -> Paths:
    """The paths of a document; `parameters` are the values of the assembly's."""
    given: dict[str, list[ExpressionValue]] = {}
    for name, raw in _entries(spec):
        if "." in name:
            given.setdefault(name, []).extend(value for one in _each(raw) if (value := as_value(one)) is not None)
    stated = {path: current_value(documents, path) for path in given}
    own = {path: value for path, value in stated.items() if value is not None and not isinstance(value, Expression)}
    expressions = {path: value for path, value in stated.items() if isinstance(value, Expression)}
    for path, expression in expressions.items():
        with suppress(ExpressionError):
            own[path] = evaluate(expression, parameters)
    kinds = {path: kind for path, values in given.items() if (kind := _kind(own.get(path), values)) is not None}
    return Paths(kinds=kinds, own={path: of_kind(value, kinds[path]) or value for path, value in own.items()}, expressions=expressions)


def _entries(spec: VariantsSpec) -> Iterator[tuple[str, Any]]:
    yield from spec.parameters.items()
    if spec.sample is not None:
        yield from spec.sample.ranges.items()
    for entry in spec.list_:
        yield from entry.parameters.items()


def _each(raw: Any) -> Iterable[Any]:
    if isinstance(raw, AxisSpec):
        return (raw.from_, raw.to)
    return raw if isinstance(raw, list) else (raw,)


def as_value(raw: Any) -> ExpressionValue | None:
    """A value as documents write it; None for an expression."""
    if isinstance(raw, Expression):
        return None
    return Quantity(float(raw)) if isinstance(raw, (int, float)) and not isinstance(raw, bool) else raw


def _kind(own: ExpressionValue | None, given: Iterable[ExpressionValue]) -> ExpressionValue | None:
    """A value of the kind that values at a path have: the assembly's own, or the first that is given. A bare 0 says nothing of its unit."""
    known = [one for one in (own, *given) if one is not None]
    return next((one for one in known if one != Quantity(0.0)), known[0] if known else None)


def of_kind(value: ExpressionValue, kind: ExpressionValue | None) -> ExpressionValue | None:
    """A value as one of the kind of another; None where it is none."""
    if not isinstance(value, Quantity) or not isinstance(kind, Quantity):
        return value if kind is None or type(value) is type(kind) else None
    if value == Quantity(0.0):
        return Quantity(0.0, kind.dimension)
    return value if value.dimension == kind.dimension else None


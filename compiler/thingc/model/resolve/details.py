"""Resolve the levels of detail that simulation models omit."""

from __future__ import annotations

from collections.abc import Iterable

from thingc.base.diagnostics import Code
from thingc.base.suggestions import did_you_mean
from thingc.documents.spec.assembly import AssemblySpec
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import AssemblyDefinition, Component


def omitted(scope: Scope, spec: AssemblySpec, components: Iterable[Component]) -> dict[str, frozenset[str]]:
    """Return the levels of detail that each simulation target omits.

    An error is reported for a level to which no component belongs, in this document or in a nested document.
    """
    if spec.detail is None:
        return {}
    known = levels(components)
    stated = {key: value for key, value in spec.detail if value is not None}
    for key, names in stated.items():
        for name in (one for one in names if one not in known):
            help = did_you_mean(name, known, what="levels") if known else f"write `detail: [{name}]` in a component"
            scope.error(Code.UNKNOWN_CHOICE, f"no component has the level of detail `{name}`", ("detail", key), help=help)
    common = stated.pop("sim", ())
    return {target: frozenset(stated.get(target, common)) for target in type(spec.detail).model_fields if target != "sim"}


def levels(components: Iterable[Component]) -> set[str]:
    """Return the levels of detail of components and of the components nested in them."""
    found: set[str] = set()
    for one in components:
        found |= one.detail
        if isinstance(one.definition, AssemblyDefinition):
            found |= levels(one.definition.components)
    return found

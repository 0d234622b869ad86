"""Resolve the levels of detail that simulation models omit."""

from __future__ import annotations

from thingc.base.diagnostics import Code
from thingc.base.suggestions import did_you_mean
from thingc.documents.spec.assembly import DetailSpec
from thingc.model.resolve.nested_assemblies import assemblies_of
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import AssemblyDefinition


def omitted(scope: Scope, detail: DetailSpec, model: AssemblyDefinition) -> dict[str, frozenset[str]]:
    """Return the levels of detail that each simulation target omits.

    An error is reported for a level to which no component belongs, in this document or in a nested document.
    """
    known = {level for one in assemblies_of(model) for component in one.components for level in component.detail}
    stated = {key: value for key, value in detail if value is not None}
    for key, names in stated.items():
        for name in (one for one in names if one not in known):
            help = did_you_mean(name, known, what="levels") if known else f"write `detail: [{name}]` in a component"
            scope.error(Code.UNKNOWN_CHOICE, f"no component has the level of detail `{name}`", ("detail", key), help=help)
    common = stated.pop("sim", ())
    return {target: frozenset(stated.get(target, common)) for target in type(detail).model_fields if target != "sim"}

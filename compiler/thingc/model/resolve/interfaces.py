"""Resolve the mating features of a mount that a document adds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from thingc.base.diagnostics import Code
from thingc.base.interfaces import Bolts, Bore, Boss, Connector, MatingFeature, Shank
from thingc.base.source import Path
from thingc.base.units import ANGLE, LENGTH
from thingc.documents.spec.interfaces import InterfaceSpec
from thingc.model.resolve.scope import Scope

_CLASSES: dict[str, Callable[..., MatingFeature]] = {"bolts": Bolts, "bore": Bore, "boss": Boss, "shank": Shank}
_SIGNED = ("at", "clearance", "start")


def features_of(scope: Scope, spec: InterfaceSpec, path: Path) -> tuple[MatingFeature, ...]:
    """Return the mating features of the interface at `path`. Invalid features are reported and omitted."""
    features: list[MatingFeature] = [Connector(spec.connector, spec.side, spec.counterpart)] if spec.connector is not None else []
    for key, create in _CLASSES.items():
        said = getattr(spec, key)
        values = {name: _value(scope, name, one, (*path, key, name)) for name, one in said or () if one is not None}
        if said is not None and None not in values.values():
            try:
                features.append(create(**values))
            except ValueError as error:
                scope.error(Code.OUT_OF_RANGE, str(error), (*path, key))
    return tuple(features)


def _value(scope: Scope, name: str, raw: Any, path: Path) -> Any:
    """Return a value of a feature in SI units. An invalid value is reported, and None is returned."""
    if isinstance(raw, list):
        values = tuple(_value(scope, name, one, (*path, index)) for index, one in enumerate(raw))
        return None if None in values else values
    if name == "thread":
        return raw
    if name == "count":
        return scope.count(raw, path, "`count`", least=1)
    above = None if name in _SIGNED else 0.0
    return scope.number(raw, path, ANGLE if name == "start" else LENGTH, f"`{name}`", above=above)

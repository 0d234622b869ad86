"""Raw attributes: handed on to one target as they are, with the place where they are written."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from thingc.base.diagnostics import Code
from thingc.base.source import Path
from thingc.base.suggestions import near_hint
from thingc.model.resolve.raw_elements import ADD, IN_ORDER, ORDER, ORDERED, text
from thingc.model.resolve.raw_protected import fixed, fixed_in_all
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import RawAttribute

EXAMPLES = {
    "mjcf": "{solreflimit: 0.01 1}", "urdf": "{limit: {effort: 20}}", "sdf": "{axis: {limit: {effort: 20}}}",
    "usd": '{"physics:breakForce": 20.0}',
}
"""Targets that take raw attributes, each with one of a joint."""

IN_PLACE = {"ros": "write them under `urdf`: the URDF of a package has them, too", "mjz": "write them under `mjcf`: its models are packed"}
"""What to write of targets whose files are those of others."""


def raw(scope: Scope, written: Mapping[str, Any]) -> tuple[RawAttribute, ...]:
    """Every attribute under `raw:`, in document order; those of an unknown target and those that are not to be set are reported."""
    flattened: list[RawAttribute] = []
    for target, attributes in written.items():
        path: Path = ("raw", target)
        if target not in EXAMPLES:
            *first, last = (f"`{one}`" for one in EXAMPLES)
            message = f"raw attributes are for {', '.join(first)} or {last}, found `{target}`"
            scope.error(Code.RAW_TARGET, message, path, key=True, help=IN_PLACE.get(target) or near_hint(target, EXAMPLES))
            continue
        if not isinstance(attributes, Mapping):
            scope.error(
                Code.VALUE_KIND, f"raw attributes of `{target}` are a mapping, found `{text(attributes)}`", path,
                help=f"write for example `{target}: {{joint: {{yaw: {EXAMPLES[target]}}}}}`",
            )
            continue
        laid = {key: one for key, one in attributes.items() if target != "mjcf" or key not in (ADD, ORDER)}  # `raw_added` reads ADD
        flattened.extend(_flattened(scope, target, laid, path, ()))
        if len(laid) < len(attributes):
            flattened.extend(_ordered(scope, attributes.get(ORDER, {}), (*path, ORDER)))
    return tuple(flattened)


def _ordered(scope: Scope, written: Any, path: Path) -> Iterator[RawAttribute]:
    """The place of each element that `raw: {mjcf: {order: ...}}` lists; report anything else."""
    for kind, names in written.items() if isinstance(written, Mapping) else [("", written)]:
        if kind not in ORDERED or not isinstance(names, list) or any(isinstance(one, (Mapping, list)) for one in names):
            message = f"`{ORDER}` lists the names of {' or '.join(f'`{one}`' for one in ORDERED)} elements"
            where = (*path, kind) if kind else path
            scope.error(Code.VALUE_KIND, message, where, help="write for example `order: {actuator: [hip, knee]}`")
            continue
        for number, name in enumerate(names):
            origin = scope.origin((*path, kind, number))
            yield RawAttribute(target="mjcf", path=(kind, text(name), IN_ORDER), value=str(number), origin=origin)


def _flattened(scope: Scope, target: str, node: Any, path: Path, keys: tuple[str, ...]) -> Iterator[RawAttribute]:
    if isinstance(node, Mapping):
        for key, child in node.items():
            yield from _flattened(scope, target, child, (*path, key), (*keys, key))
    elif isinstance(node, list) and (target != "usd" or any(isinstance(one, (Mapping, list)) for one in node)):
        scope.error(
            Code.VALUE_KIND, f"`{keys[-1]}` is text, a number, true or false in `{target}`, found a list of {len(node)}", path,
            help=f"write `{' '.join(map(text, node))}`" if not any(isinstance(one, (Mapping, list)) for one in node)
            else "elements are added under `raw: mjcf: add:`",
        )
    else:
        refused = fixed(keys) if target == "mjcf" else fixed_in_all(target, keys)
        if refused is not None:
            message, instead = refused
            scope.error(Code.RAW_FIXED, message, path, key=True, help=instead)
            return
        first = len(path) - len(keys)
        yield RawAttribute(
            target=target, path=keys, value=json.dumps(node) if target == "usd" else text(node), origin=scope.origin(path),
            keys=tuple(scope.span(path[: first + depth], key=True) for depth in range(1, len(keys) + 1)),
        )

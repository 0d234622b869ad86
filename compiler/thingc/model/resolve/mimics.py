"""Resolve mimics, by which a joint follows another joint: q = multiplier * q(joint) + offset, or a polynomial in q(joint)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note
from thingc.base.graphs import MAX_CYCLE, find_cycles, format_cycle
from thingc.base.source import Path
from thingc.base.units import NUMBER, Dimension, Quantity
from thingc.documents.spec.assembly import JointSpec, MimicSpec
from thingc.model.resolve import references
from thingc.model.resolve.coordinates import CoordinateName, Mimic
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.repeats import Unrolled
from thingc.model.resolve.scope import DefaultLayers
from thingc.model.resolve.types import Joint


def mimics(table: DocumentScope, items: Sequence[Unrolled[JointSpec]]) -> None:
    """Resolve the mimics of all joints, and add them to `table.joints`. Invalid mimics are reported and omitted."""
    for item in items:
        own = [joint for joint in table.joints.values() if joint is not None and joint.name.joint == item.name]
        for number, joint in enumerate(own):
            setting = DefaultLayers(((item.spec, item.path),)).pick("mimic", None if len(own) == 1 else number)
            mimic = _mimic(table, replace(item, name=joint.name), joint, *setting) if setting else None
            if mimic is not None:
                table.joints[joint.name] = replace(joint, mimic=mimic)
    _break_cycles(table, {name: item for item in items for name, joint in table.joints.items() if joint and joint.name.joint == item.name})


def _mimic(table: DocumentScope, item: Unrolled[JointSpec], joint: Joint, spec: MimicSpec, path: Path) -> Mimic | None:
    scope = item.scope
    if not isinstance(spec, MimicSpec):
        return None  # a list of mimics for a joint with one coordinate has already been reported
    coordinate = joint.twist.coordinate if joint.twist is not None else None
    if joint.kind.at_once:
        message = f"joint `{joint.name.joint}` is {joint.kind.words} and cannot have `mimic`"
        scope.error(Code.MIMIC, message, path, key=True, help="remove `mimic`")
        return None
    if coordinate is None:
        scope.error(
            Code.MIMIC, f"joint `{item.name}` is {joint.kind.words} and cannot have `mimic`", path, key=True,
            help="remove `mimic`", notes=scope.second_note("the type of the joint is set here", (*item.path, "type"), path),
        )
        return None
    followed = _resolve_leader(table, item, spec, path)
    if followed is None or followed.twist is None:
        return None
    name, notes, other = followed.name, followed.definition_note(followed.name), followed.twist.coordinate
    if spec.polynomial is not None:
        return _polynomial(item, followed, (coordinate, other), spec.polynomial, path)
    ratio = coordinate / other
    what = f"`mimic.multiplier` of joint `{item.name}`"
    if "multiplier" not in spec.model_fields_set and ratio != NUMBER:
        scope.error(
            Code.DIMENSION, f"`mimic` of joint `{item.name}` requires a `multiplier` that is {ratio.words}",
            path, key=True, help=f"write, for example, `multiplier: {ratio.example}`", notes=notes,
        )
        return None
    raw = spec.multiplier
    multiplier = scope.number(raw, (*path, "multiplier"), ratio, what, notes=notes)
    if multiplier is not None and isinstance(raw, Quantity) and raw.value == 0.0:
        scope.error(Code.MIMIC, f"{what} must not be 0", (*path, "multiplier"), help="use `type: fixed`")
        return None
    offset = scope.number(spec.offset, (*path, "offset"), coordinate, f"`mimic.offset` of joint `{item.name}`")
    if multiplier is None or offset is None:
        return None
    return Mimic(joint=name, multiplier=multiplier, offset=offset, origin=scope.origin(path, key=True))


def _polynomial(
    item: Unrolled[JointSpec], followed: Joint, of: tuple[Dimension, Dimension], written: Sequence[Any], path: Path,
) -> Mimic | None:
    """Resolve the polynomial of a mimic. The coefficient of q(joint)^k has the unit of q / q(joint)^k.

    `of` contains the physical dimensions of q and q(joint).
    """
    scope, place = item.scope, (*path, "polynomial")
    values: list[float] = []
    dimension, other = of
    for k, raw in enumerate(written):
        what = f"the coefficient of q(`{followed.name}`)^{k} in the `polynomial` of joint `{item.name}`"
        value = scope.number(raw, (*place, k), dimension, what, notes=followed.definition_note(followed.name))
        if value is None:
            return None
        values.append(value)
        dimension = dimension / other
    if not any(values[1:]):
        scope.error(Code.MIMIC, f"the `polynomial` of joint `{item.name}` is constant", place, help="use `type: fixed`")
        return None
    offset, multiplier, *higher = values
    return Mimic(joint=followed.name, multiplier=multiplier, offset=offset, higher=tuple(higher), origin=scope.origin(path, key=True))


def _resolve_leader(table: DocumentScope, item: Unrolled[JointSpec], spec: MimicSpec, path: Path) -> Joint | None:
    """Resolve the reference `mimic.joint`, and return the joint that is mimicked. It moves, and has a single coordinate.

    If the referenced joint cannot be mimicked, report an error and return None.
    """
    scope, place = item.scope, (*path, "joint")
    written = CoordinateName(spec.joint)
    parts = references.split_names(scope, written.joint, place)
    if parts is None:
        return None
    name = CoordinateName(".".join(parts))
    if written.number is not None:
        name = name.with_number(written.number)
    if name not in table.joints:
        others = [other for other in table.joints if other != item.name]
        hint = references.suggest(name, others, what="joints") if others else "there is no other joint in this document"
        if len(parts) > 1:
            scope.error(Code.MIMIC, f"`mimic.joint` must be a joint of the same document, found `{name}`", place, help=hint)
        elif not any(f"{name}_".startswith(prefix) for prefix in table.unbuilt_joints):
            scope.error(Code.UNKNOWN_JOINT, f"this document has no joint `{name}`", place, help=hint)
        return None
    if name == item.name:
        scope.error(Code.MIMIC, f"joint `{name}` cannot mimic itself", place, help="set `joint` to another joint")
        return None
    other = table.joints[name]
    if other is None:
        return None
    if other.twist is not None and not other.kind.at_once:
        return other
    shown = name.joint if other.kind.at_once else str(name)
    message = f"joint `{item.name}` cannot mimic joint `{shown}`, which is {other.kind.words}"
    scope.error(Code.MIMIC, message, place, notes=other.definition_note(shown))
    return None


def _break_cycles(table: DocumentScope, items: dict[str, Unrolled[JointSpec]]) -> None:
    """Report every cycle of joints that mimic each other, and remove the mimics of these joints."""
    follows = {name: joint.mimic.joint for name, joint in table.joints.items() if joint is not None and joint.mimic is not None}
    for cycle in find_cycles(follows, follows.get):
        first = items[cycle[0]]
        first.scope.error(
            Code.MIMIC, f"joints mimic each other in a cycle: {format_cycle(cycle)}", (*first.path, "mimic", "joint"),
            help="remove `mimic` from one of these joints", notes=[
                Note(message=f"`{step}` mimics here", span=items[step].scope.span((*items[step].path, "mimic", "joint")))
                for step in cycle[1:MAX_CYCLE]
            ],
        )
        for step in cycle:
            joint = table.joints[step]
            if joint is not None:
                table.joints[step] = replace(joint, mimic=None)

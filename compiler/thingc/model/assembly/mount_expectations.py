"""Warn of mounts of parts to which another component is attached than the part class expects."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from thingc.base.diagnostics import Code, noted
from thingc.geometry.record import MountExpectation
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Connected, Occurrence

_NUMBER = re.compile(r"\d+\.\d+(?:e[+-]?\d+)?|\d+e[+-]?\d+")


def check_expectations(robot: Connected, laid: Collection[int], findings: LinkReport) -> None:
    """Warn of each mount at which a component other than the expected one is attached.

    `laid` contains the indices of mates from `at`, which do not connect mounts. An empty mount is accepted if the top document exports the
    mount, because a parent assembly may use it.
    """
    occurrences = robot.occurrences
    open_mounts = {(mount.occurrence, mount.mount) for mount in robot.exported if "/" not in mount.path}
    on: dict[tuple[int, str], list[tuple[int, str]]] = {}
    for number, mate in enumerate(robot.mates):
        if number not in laid:
            on.setdefault((mate.parent, mate.parent_mount), []).append((mate.child, mate.child_mount))
            on.setdefault((mate.child, mate.child_mount), []).append((mate.parent, mate.parent_mount))
    for owner in occurrences:
        if owner.record is None:
            continue
        expected = owner.record.expectations
        for one in expected:
            sitting = [(occurrences[other], mount) for other, mount in on.get((owner.index, one.mount), ())]
            if any(_is(other, one, owner) and mount == one.child_mount for other, mount in sitting):
                continue
            if not sitting and (owner.index, one.mount) in open_mounts:
                continue
            spoken_for = [e for e in expected if e.mount == one.mount]
            others = [(o, m) for o, m in sitting if not any(_is(o, e, owner) and m == e.child_mount for e in spoken_for)]
            _warn(owner, one, others, findings)


def _is(other: Occurrence, expected: MountExpectation, owner: Occurrence) -> bool:
    """Return whether `other` is the part that the part class expects at the mount.

    On a mirrored part, the mirror image of the expected part is required. For a symmetric part, the mirror image is the part itself.
    """
    plain = other.definition.plain if owner.definition.mirror is not None else None
    texts = (other.definition.text,) if plain is None else (other.definition.text, plain.text)
    return other.record is not None and _rounded(expected.text) in map(_rounded, texts)


def _rounded(definition: str) -> str:
    """Round the numbers in the text of a definition to 12 digits, because the conversion to millimetres can change the last digits."""
    return _NUMBER.sub(lambda number: f"{float(number[0]):.12g}", definition)


def _warn(owner: Occurrence, one: MountExpectation, others: Sequence[tuple[Occurrence, str]], findings: LinkReport) -> None:
    name, wanted = owner.component.name, one.label
    other, mount = next(((o, m) for o, m in others if _is(o, one, owner)), others[0] if others else (None, ""))
    found = other.definition.label if other is not None else ""
    if other is not None and found == wanted:  # the labels are equal, because they do not show the digits that differ
        wanted, found = one.text, other.definition.text
    cut = f"`{name}.{one.mount}` expects `{wanted}`"
    help = f"attach the mount `{one.child_mount}` of `{wanted}` to `{name}.{one.mount}`"
    if other is None:
        findings.warn(Code.EXPECTATION, f"{cut}, but nothing is attached to it", owner.origin, path=owner.path, help=help, allow=True)
        return
    if _is(other, one, owner):
        message = f"{cut} with its mount `{one.child_mount}`, but `{other.component.name}` is attached with its mount `{mount}`"
    else:
        message = f"{cut}, but `{other.component.name}` (`{found}`) is attached to it"
    notes = noted(f"`{name}` is defined here", owner.origin)
    findings.warn(Code.EXPECTATION, message, other.origin, path=other.path, help=help, notes=notes, allow=True)

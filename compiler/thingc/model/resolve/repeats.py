"""Unroll components, joints and transmissions with the key `repeat:`, and check names: reserved words, duplicates, and names that differ
only in case.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Generic, TypeVar

from thingc.base.diagnostics import Code, Note
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Path
from thingc.documents.spec.assembly import ComponentSpec, JointSpec
from thingc.documents.spec.name_types import RESERVED
from thingc.documents.spec.transmissions import TransmissionSpec
from thingc.model.resolve.scope import Scope

MAX_REPEAT = 10_000
"""Maximum count of one `repeat`."""

MAX_OCCURRENCES = 100_000
"""Maximum number of parts, links and frames of a robot, and of items of all repeats in one document."""

Spec = TypeVar("Spec", ComponentSpec, JointSpec, TransmissionSpec)


class Unrolled(FrozenStruct, Generic[Spec], kw_only=False):
    """One item of a component, joint or transmission whose `repeat` has been unrolled.

    The scope of the item contains the value of the repeat's index.
    """

    name: str
    spec: Spec
    path: Path
    scope: Scope


def unroll(scope: Scope, section: str, specs: Mapping[str, Spec], parameters: Iterable[str]) -> tuple[list[Unrolled[Spec]], list[str]]:
    """Return the items of the section `components`, `joints` or `transmissions` in document order.

    Also return the prefixes of items that are invalid or exceed a limit. A prefix such as `leg_` means all items of a repeat. An empty
    prefix means all items of the section.

    If several items have the same name, report the duplicates and use the first item.
    """
    unbuilt: list[str] = []
    in_doubt: list[str] = [name for name in specs if scope.doubts.touch((section, name, "repeat"))]
    unbuilt.extend(f"{name}_" for name in dict.fromkeys((*in_doubt, *scope.doubts.names(section))))
    if scope.doubts.lacks(section):
        unbuilt.append("")
    specs = {name: spec for name, spec in specs.items() if name not in in_doubt}
    counts = _counts(scope, section, specs, parameters)
    if counts is None:
        return [], [""]
    unbuilt.extend(f"{name}_" for name, count in counts.items() if count is None)
    items: dict[str, Unrolled[Spec]] = {}
    for name, spec in specs.items():
        path = (section, name)
        if spec.repeat is None:
            copies = [Unrolled(name, spec, path, scope)]
        else:
            as_ = spec.repeat.as_
            copies = [Unrolled(f"{name}_{k}", spec, path, scope.repeat_scope(as_, k)) for k in range(counts[name] or 0)]
        for item in copies:
            first = items.setdefault(item.name, item)
            if first is not item:
                scope.error(
                    Code.NAME_CLASH, f"two {section} are named `{item.name}`", path, key=True, help="rename one of the two elements",
                    notes=[Note(message="the other element is defined here", span=scope.span(first.path, key=True))],
                )
    return list(items.values()), unbuilt


def _counts(scope: Scope, section: str, specs: Mapping[str, Spec], parameters: Iterable[str]) -> dict[str, int | None] | None:
    """Return the count of each element with a `repeat`, or None for an invalid count.

    If there are too many items in total, return None instead of a mapping.
    """
    counts: dict[str, int | None] = {}
    total = 0
    for name, spec in specs.items():
        if spec.repeat is None:
            total += 1
            continue
        path: Path = (section, name, "repeat")
        count = scope.count(spec.repeat.count, (*path, "count"), f"the count of `{name}`")
        if count is not None and count > MAX_REPEAT:
            scope.error(Code.TOO_MANY, f"`{name}` is repeated {count} times (at most {MAX_REPEAT} are allowed)", (*path, "count"))
            count = None
        if count is not None and spec.repeat.as_ in set(parameters):
            scope.error(
                Code.NAME_CLASH, f"the index `{spec.repeat.as_}` has the name of a parameter", path,
                help="rename the index, for example `as: k`", key=True,
                notes=[Note(message="the parameter is defined here", span=scope.span(("parameters", spec.repeat.as_), key=True))],
            )
            count = None
        if count is not None and total + count > MAX_OCCURRENCES:
            scope.error(
                Code.TOO_MANY, f"the document has {total + count} {section} (at most {MAX_OCCURRENCES} are allowed)",
                (*path, "count"),
            )
            return None
        counts[name] = count
        total += count or 0
    return counts


def check_names(scope: Scope, names: Iterable[tuple[str, Path, str]], *, reserved: bool = True) -> None:
    """Report reserved names, duplicates, and names that differ only in case.

    `names` contains tuples of a name, its path in the document, and the type of the element.
    """
    seen: dict[str, tuple[str, Path, str]] = {}
    for name, path, what in names:
        if reserved and name in RESERVED:
            scope.error(Code.RESERVED_NAME, f"{what} cannot have the reserved name `{name}`", path, key=True, help="choose another name")
            continue
        first = seen.setdefault(name.lower(), (name, path, what))
        if first[1] != path:
            note = [Note(message="the other element is defined here", span=scope.span(first[1], key=True))]
            clash = f"is the name of both {first[2]} and {what}" if first[0] == name else f"and `{first[0]}` differ only in case"
            scope.error(Code.NAME_CLASH, f"`{name}` {clash}", path, key=True, notes=note, help="rename one of the two elements")

"""Keys of an entry that stand beside it: `drive:` indented like the joint that it is of.

Such a key is an entry of its own to the parser, with everything missing that an entry needs and nothing known that it has. All of that,
and the same of further keys behind it, is one fault.
"""

from __future__ import annotations

from typing import Any

from thingc.base.source import Document, MappingNode, node_at
from thingc.base.units import shortened
from thingc.documents.spec.annotation_types import FieldType, alternatives, likeness, model_keys
from thingc.documents.spec.base import Model
from thingc.documents.spec.pruning import MISPLACED, Fault
from thingc.documents.spec.unknown_keys import sections


def gathered(document: Document, root: type[Model], faults: list[Fault]) -> list[Fault]:
    """The faults, with those of the keys that stand beside their entry as one, and without those of the entry that misses them."""
    misplaced: list[Fault] = []
    for section, entry in sections(root):
        around = node_at(document.tree, (section,))
        if entry.model is None or not isinstance(around, MappingNode):
            continue
        owner: str | None = None
        last: str | None = None
        for name, node in around.entries.items():
            key = model_keys(entry.model).get(name)
            wrong = key is not None and any(fault.path[:2] == (section, name) for fault in faults)
            if key is None or not wrong or not _is_rather(node.plain(), key[0], entry):
                owner = last = name
                continue
            if misplaced and last == misplaced[-1].value[-1] and misplaced[-1].path[0] == section:
                misplaced[-1].value.append(name)
            else:
                misplaced.append(Fault(path=(section, name), kind=MISPLACED, context={"owner": owner}, value=[name], shape=entry, key=True))
            last = name
    if not misplaced:
        return faults
    beside = {(one.path[0], name) for one in misplaced for name in one.value}
    owned = {(one.path[0], one.context["owner"], name) for one in misplaced for name in one.value}
    owners = {(one.path[0], one.context["owner"]) for one in misplaced}
    rest = [
        fault for fault in faults
        if fault.path[:2] not in beside and not (fault.kind == "missing" and fault.path in owned)
        and not (fault.kind == "rule" and fault.path in owners)
    ]
    return [*rest, *misplaced]


def message_of(fault: Fault, *, toml: bool) -> tuple[str, str]:
    """What is said of keys beside their entry, and what to do; `toml`: the document has tables, and no indentation."""
    section, owner, names = str(fault.path[0]), fault.context["owner"], [f"`{shortened(name)}`" for name in fault.value]
    several = len(names) > 1
    shown = ", ".join(names[:-1]) + f" and {names[-1]}" if several else names[0]
    message = f"{shown} {'are' if several else 'is'} {'written' if toml else 'indented'} like a {section.removesuffix('s')}"
    it = "them" if several else "it"
    if owner is None:
        return f"{message}, and {'are keys' if several else 'is a key'} of one", f"write {it} inside one of the {section}"
    owner = shortened(owner)
    help = f"write `[{section}.{owner}.{fault.value[0]}]`" if toml else f"indent {it} further, like the other keys of `{owner}`"
    return f"{message}, and probably {'belong' if several else 'belongs'} to `{owner}`", help


def _is_rather(value: Any, key: FieldType, entry: FieldType) -> bool:
    """Whether a value looks like that of a key of an entry rather than like an entry."""
    if not isinstance(value, dict):
        return True
    known = sum(name in model_keys(entry.model) for name in value) if entry.model is not None else 0
    return any(likeness(one, value) > known for one in alternatives(key) if one.kind in ("model", "dict"))

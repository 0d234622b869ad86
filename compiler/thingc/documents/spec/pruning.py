"""Remove the invalid entries of a document, so that later passes can use the valid entries.

For each error, the smallest entry that contains the error and can be removed is removed.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Path
from thingc.base.suggestions import nearest
from thingc.documents.spec.annotation_types import FieldType, model_keys
from thingc.documents.spec.invalid_entries import ANY_NAME

ROUNDS = 12
"""Maximum number of rounds in which invalid entries are removed. Several rounds may be needed, because removing a required key makes the
enclosing entry invalid.
"""

_PLACEHOLDERS: dict[str, Any] = {"parameters": 0, "poses": {}}
"""Placeholder values by section, for removed entries whose name is valid."""


MISPLACED = "misplaced"
"""Kind of an error (type `value`) for keys that have the same indentation as the entry to which they belong.

The context of the error contains this entry as `owner`, or None if the keys precede the first entry.
"""


class Fault(FrozenStruct):
    """A validation error of the value at `path` of a document, or of the key at `path` if `key` is True.

    `kind` and `context` are the type and the context of the error, from pydantic or from `fields`. `shape` is the expected type of the
    value. For an unknown or missing key, it is the type of the mapping.
    """

    path: Path
    kind: str
    context: dict[str, Any]
    value: Any
    shape: FieldType
    key: bool = False


def prune(plain: dict[str, Any], faults: Sequence[Fault]) -> set[Path] | None:
    """Remove the invalid entries from `plain`, which is a document as plain Python values.

    Return the removed paths, or None if required keys of the document are invalid.
    """
    removed: set[Path] = set()
    for fault in faults:
        path = fault.path
        if fault.kind == "extra_forbidden":
            mapping = value_at(plain, path[:-1])
            keys = model_keys(fault.shape.model) if fault.shape.model is not None else {}
            absent = [key for key in keys if not isinstance(mapping, dict) or key not in mapping]
            similar = nearest(str(path[-1]), absent)
            removed.update((*path[:-1], key) for key in ([similar] if similar else absent))
            removed.add(path)
            if isinstance(mapping, dict):
                mapping.pop(path[-1], None)
            continue
        if fault.kind == MISPLACED:
            for name in fault.value:
                removed.update(((*path[:-1], name), (*path[:-1], fault.context["owner"], name)))
                value_at(plain, path[:-1]).pop(name, None)
            continue
        if fault.kind == "missing":
            path = path[:-1]
        elif fault.kind == "rule":
            path = (*path, *fault.context.get("path", ()))
        removed_path = remove_entry(plain, path, name=fault.key)
        if removed_path is None:
            return None
        removed.add(removed_path)
        if fault.key:
            removed.add((*removed_path[:-1], ANY_NAME))
    return removed


def remove_entry(plain: dict[str, Any], path: Path, *, name: bool = False) -> Path | None:
    """Remove the value at `path` from `plain`, which is a document as plain Python values.

    If the value is an item of a list, remove the whole list. `name` is True if the name of the entry is invalid; otherwise, a parameter or
    pose is replaced by a placeholder. Return the path of the removed value, or None if the value is required.
    """
    while path and isinstance(path[-1], int):
        path = path[:-1]
    if not path or path[0] in ("thingc", "name") or path == ("components",):  # required keys of an assembly
        return None
    if plain.get("thingc") == "materials/1" and len(path) == 1:  # the required key is `materials`
        return None
    for length in range(1, len(path)):  # a key may look like the index of a list
        if isinstance(value_at(plain, path[:length]), list):
            return remove_entry(plain, path[:length], name=name)
    mapping = value_at(plain, path[:-1])
    if isinstance(mapping, dict) and path[-1] in mapping:
        if len(path) == 2 and path[0] in _PLACEHOLDERS and not name:
            mapping[path[-1]] = copy(_PLACEHOLDERS[str(path[0])])
        else:
            del mapping[path[-1]]
    return path


def value_at(value: Any, path: Path) -> Any:
    """Return the value at a path of a document that consists of plain Python values. Return None if the path does not exist."""
    for step in path:
        if isinstance(value, dict):
            value = value.get(step)
        elif isinstance(value, list) and isinstance(step, int) and step < len(value):
            value = value[step]
        else:
            return None
    return value

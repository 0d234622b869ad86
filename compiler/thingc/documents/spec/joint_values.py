"""Values whose dimension follows from the joint that they are of: `lower`, `kp` and the like are those of a turn or of a slide."""

from __future__ import annotations

import re
from collections.abc import Iterator
from fnmatch import fnmatchcase

from thingc.base.joints.dimensions import dimensions_of
from thingc.base.joints.kinds import KINDS
from thingc.base.source import Document, MappingNode, Path, ScalarNode, node_at
from thingc.base.units import Dimension


def dimension_at(document: Document, path: Path) -> Dimension | None:
    """The dimension that the value at `path` has as the `type` of its joint says (in `defaults`, in a pose and under a pattern: of all
    joints that may be meant); None where it is no value of a joint, or the document does not tell."""
    names, key = _joints(document, path)
    coordinates = {_coordinate(document, name) for name in names}
    coordinate = coordinates.pop() if len(coordinates) == 1 else None
    return dimensions_of(coordinate).get(key) if coordinate is not None else None


def _joints(document: Document, path: Path) -> tuple[Iterator[str], str]:
    """The joints that a value may be of, and the key that says which value it is."""
    every = node_at(document.tree, ("joints",))
    names = list(every.entries) if isinstance(every, MappingNode) else []
    key = str(path[-1]) if path else ""
    if len(path) > 2 and path[0] == "joints":
        return iter((str(path[1]),)), key
    if path[:2] == ("defaults", "joint"):
        return iter(names), key
    if len(path) == 3 and path[0] == "poses":
        made_by = re.sub(r"_\d+$", "", key)  # a repeat
        return (name for name in names if name in (key, made_by) or fnmatchcase(name, key)), "offset"
    return iter(()), key


def _coordinate(document: Document, name: str) -> Dimension | None:
    kind = node_at(document.tree, ("joints", name, "type"))
    joint_kind = KINDS.get(str(kind.value)) if isinstance(kind, ScalarNode) else None
    return joint_kind.coordinate if joint_kind is not None else None

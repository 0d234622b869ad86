"""Paths of what may be set in place of what a document says: choices (`components.foot.part`) and values
(`joints.elbow.limit.upper`)."""

from __future__ import annotations

from thingc.base.frozen_struct import FrozenStruct

KEYS = ("part", "file", "assembly", "material")
"""Keys of a component that may be chosen."""
DEFAULT_MATERIAL = "defaults.component.material"
EXAMPLES = "`components.NAME.part` (or `.assembly`, `.file`, `.material`), or `defaults.component.material`"

VALUES = "the path of a value, such as `joints.NAME.limit.upper` or `components.NAME.mass`"
SECTIONS = ("components", "defaults", "joints", "links", "materials", "poses", "sensors", "tendons")
"""Sections of a nested assembly in which something may be set from outside; none is a key of a component."""


class ChoicePath(FrozenStruct):
    """A path taken apart: the names of the components on the way, and the key (`DEFAULT_MATERIAL` or one of `KEYS`)."""

    components: tuple[str, ...]
    key: str


def parse(path: str) -> ChoicePath | None:
    """The parts of a path; None where it is none."""
    words = path.split(".")
    names: list[str] = []
    while len(words) > 2 and words[0] == "components":
        names.append(words[1])
        words = words[2:]
    rest = ".".join(words)
    if not all(name.isidentifier() and name.isascii() for name in names):
        return None
    if rest == DEFAULT_MATERIAL or (names and rest in KEYS):
        return ChoicePath(components=tuple(names), key=rest)
    return None


def nested(path: str) -> tuple[str, str] | None:
    """The component that a path leads through, and the path from there on in its nested assembly; None where the path ends in the
    document that it begins in."""
    words = path.split(".", 2)
    if len(words) < 3 or words[0] != "components" or words[2].partition(".")[0] not in SECTIONS or "." not in words[2]:
        return None
    return words[1], words[2]


def is_value(path: str) -> bool:
    """Whether a path is written as that of a value, and not as that of a choice."""
    words = path.split(".")
    return len(words) > 1 and all(words) and " " not in path and parse(path) is None

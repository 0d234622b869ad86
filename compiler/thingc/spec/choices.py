"""Paths of what may be chosen in place of what a document says: `components.foot.part`."""

from __future__ import annotations

from dataclasses import dataclass

KEYS = ("part", "file", "assembly", "material")
"""Keys of a component that may be chosen."""
DEFAULT_MATERIAL = "defaults.component.material"
EXAMPLES = "`components.NAME.part` (or `.assembly`, `.file`, `.material`), or `defaults.component.material`"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChoicePath:
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

"""The invalid entries of a document. Later passes receive only the valid rest of the document."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from thingc.base.diagnostics import Allowance
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Path

if TYPE_CHECKING:
    from thingc.documents.spec.assembly import AssemblySpec
    from thingc.documents.spec.materials import MaterialsSpec


ANY_NAME = "*"
"""Placeholder in a path for an entry whose name is invalid. Any unresolved reference may refer to this entry."""


class InvalidEntries(FrozenStruct):
    """The paths of invalid values that validation removed from a document, and the paths of keys that an invalid key may be a misspelling
    of.

    All of these errors have been reported.

    Later passes do not report errors at such a path, at its parent paths, or inside its value.
    """

    paths: frozenset[Path] = frozenset()

    def __bool__(self) -> bool:
        return bool(self.paths)

    def touch(self, path: Path) -> bool:
        """Return whether the value at `path`, one of its parents, or a value inside it is invalid."""
        return any(doubt[: len(path)] == path[: len(doubt)] for doubt in self.paths)

    def at(self, path: Path) -> bool:
        """Return whether the whole value at `path`, or one of its parents, is invalid."""
        return any(doubt == path[: len(doubt)] for doubt in self.paths)

    def lacks(self, section: str) -> bool:
        """Return whether some names in a section may be unknown because the section or one of its names is invalid."""
        return (section, ANY_NAME) in self.paths or self.at((section,))

    def names(self, section: str) -> Iterator[str]:
        """Yield the entries of a section that are invalid as a whole, in alphabetical order."""
        yield from sorted(str(doubt[1]) for doubt in self.paths if len(doubt) == 2 and doubt[0] == section and doubt[1] != ANY_NAME)


NO_DOUBTS = InvalidEntries()


class Specs(dict[str, "AssemblySpec | MaterialsSpec"]):
    """The validated models of documents, keyed by the path of the document in the workspace.

    `doubts` contains the invalid entries of each document; `allowances` contains the warnings that each document suppresses.
    """

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.doubts: dict[str, InvalidEntries] = {}
        self.allowances: list[Allowance] = []

    def joined(self, more: Specs) -> Specs:
        """Return the validated models of these documents and of the documents in `more`."""
        both = Specs({**self, **more})
        both.doubts = {**self.doubts, **more.doubts}
        both.allowances = [*self.allowances, *more.allowances]
        return both

"""The invalid entries of a document. Later passes receive only the valid rest of the document."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from thingc.base.diagnostics import Allowance
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Path

if TYPE_CHECKING:
    from thingc.documents.spec.assembly import AssemblySpec
    from thingc.documents.spec.catalog import CatalogSpec
    from thingc.documents.spec.materials import MaterialsSpec


ANY_NAME = "*"
"""Placeholder in a path for an entry whose name is invalid. Every reference that cannot be resolved may refer to this entry."""


class InvalidEntries(FrozenStruct):
    """The paths of invalid values that validation has reported and removed from a document.

    If an invalid key may be a misspelling of another key, the path of the other key is also included. Later passes do not report errors at
    these paths, at their parent paths, or inside their values.
    """

    paths: frozenset[Path] = frozenset()

    def __bool__(self) -> bool:
        return bool(self.paths)

    def touch(self, path: Path) -> bool:
        """Return whether the value at `path`, a value that contains it, or a value inside it is invalid."""
        return any(invalid[: len(path)] == path[: len(invalid)] for invalid in self.paths)

    def at(self, path: Path) -> bool:
        """Return whether the value at `path`, or a value that contains it, is invalid as a whole."""
        return any(invalid == path[: len(invalid)] for invalid in self.paths)

    def lacks(self, section: str) -> bool:
        """Return whether names may be missing in a section, because the whole section or the name of an entry is invalid."""
        return (section, ANY_NAME) in self.paths or self.at((section,))

    def names(self, section: str) -> Iterator[str]:
        """Yield the names of the entries of a section that are invalid as a whole, in alphabetical order."""
        yield from sorted(str(path[1]) for path in self.paths if len(path) == 2 and path[0] == section and path[1] != ANY_NAME)


NO_DOUBTS = InvalidEntries()


class Specs(dict[str, "AssemblySpec | CatalogSpec | MaterialsSpec"]):
    """The validated models of documents, keyed by the path of the document in the workspace.

    `doubts` contains the invalid entries of each document, and `allowances` contains the warnings that each document suppresses.
    """

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.doubts: dict[str, InvalidEntries] = {}
        self.allowances: list[Allowance] = []

    def union(self, more: Specs) -> Specs:
        """Return the union of these validated models and the models in `more`."""
        combined = Specs({**self, **more})
        combined.doubts = {**self.doubts, **more.doubts}
        combined.allowances = [*self.allowances, *more.allowances]
        return combined

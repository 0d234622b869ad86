"""What validation could not make sense of in a document whose rest goes on to the later passes."""

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
"""In a path in doubt the name of an entry that was no name (reported): it may stand for any that is referred to."""


class InvalidEntries(FrozenStruct):
    """The key paths of a document whose values were wrong (reported) and left out, or may be what a wrong key meant.

    What a later pass would say of such a place, of what is around it, or of what is inside, is no news.
    """

    paths: frozenset[Path] = frozenset()

    def __bool__(self) -> bool:
        return bool(self.paths)

    def touch(self, path: Path) -> bool:
        """Whether the value at `path`, something around it or something inside it is in doubt."""
        return any(doubt[: len(path)] == path[: len(doubt)] for doubt in self.paths)

    def at(self, path: Path) -> bool:
        """Whether the value at `path` as a whole, or something around it, is in doubt."""
        return any(doubt == path[: len(doubt)] for doubt in self.paths)

    def lacks(self, section: str) -> bool:
        """Whether nobody knows which names a section has: it is in doubt as a whole, or one of its names was none."""
        return (section, ANY_NAME) in self.paths or self.at((section,))

    def names(self, section: str) -> Iterator[str]:
        """The entries of a section that are in doubt as a whole, in alphabetical order."""
        yield from sorted(str(doubt[1]) for doubt in self.paths if len(doubt) == 2 and doubt[0] == section and doubt[1] != ANY_NAME)


NO_DOUBTS = InvalidEntries()


class Specs(dict[str, "AssemblySpec | MaterialsSpec"]):
    """The models of documents by path in the workspace; `doubts` has those of which only the sound rest is here, `allowances`
    the warnings that they allow."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.doubts: dict[str, InvalidEntries] = {}
        self.allowances: list[Allowance] = []

    def joined(self, more: Specs) -> Specs:
        """These and others together."""
        both = Specs({**self, **more})
        both.doubts = {**self.doubts, **more.doubts}
        both.allowances = [*self.allowances, *more.allowances]
        return both

"""Find the declarations and uses of all names in the documents and parts of a workspace.

The module `references.py` resolves the names in a single document.
"""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Span
from thingc.documents.names.document_names import DocumentNames
from thingc.documents.names.part_names import PartNames
from thingc.documents.names.references import Name, NamePlace, NameReader, part_name


class NameIndex(FrozenStruct, kw_only=False):
    """The locations at which names are declared or used in the documents and part modules of a workspace."""

    places: tuple[NamePlace, ...]
    by_name: Mapping[Name, tuple[NamePlace, ...]]

    def at(self, file: str, line: int, column: int) -> NamePlace | None:
        """Return the declaration or the use of a name at a cursor position (line and column, counted from 1).

        The cursor can also be directly after the name. If several names contain the position, return the shortest name.
        """
        around = [
            place for place in self.places
            if place.span.file == file and (place.span.line, place.span.column) <= (line, column)
            <= (place.span.end_line, place.span.end_column)
        ]
        return min(around, key=lambda place: (place.role == "fits", place.span.end_column - place.span.column), default=None)

    def declared(self, name: Name) -> Span | None:
        """Return the location at which a name is declared, or None if the declaration is unknown."""
        return next((place.span for place in self.by_name.get(name, ()) if place.role == "declared"), None)


def index(documents: Mapping[str, DocumentNames], parts: PartNames) -> NameIndex:
    """Build the index of all names in the documents of a workspace and in their part modules. `documents` is keyed by absolute path."""
    seen: dict[tuple[Name, Span], NamePlace] = {}
    for written in documents.values():
        for place in NameReader(documents, parts, written).places():
            known = seen.get((place.name, place.span))
            if known is None or known.role != "declared":
                seen[place.name, place.span] = place
    for part in parts.places():
        name = part_name(part.name)
        seen[name, part.span] = NamePlace(name, part.span, "declared" if part.declared else "used")
    for reference, thing in parts.classes():
        if thing.span is not None:
            name = Name("part", thing.file, reference.partition(":")[2])
            seen[name, thing.span] = NamePlace(name, thing.span, "declared")
    places = tuple(sorted(seen.values(), key=lambda one: (one.span.file, one.span.line, one.span.column, one.name.what, one.name.text)))
    by_name: dict[Name, list[NamePlace]] = {}
    for place in places:
        by_name.setdefault(place.name, []).append(place)
    return NameIndex(places, {name: tuple(those) for name, those in by_name.items()})

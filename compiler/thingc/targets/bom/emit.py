"""Write `bom.csv` and `bom.json`, which list the parts to print, to machine and to buy, with their quantities."""

from __future__ import annotations

import csv
import io
import re
from decimal import Decimal
from itertools import count, groupby

from msgspec.structs import asdict, astuple

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import format_cell
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.model.resolve.types import BomEntry
from thingc.targets import json_writer
from thingc.targets.artifact import Artifacts
from thingc.targets.request import EmitRequest

MACHINED = frozenset({"cnc", "machine", "machined", "mill", "milled", "milling", "lathe", "turning", "laser", "waterjet"})
"""Kinds of manufacturing processes that remove material. A part with any other kind of process is printed."""

_AMOUNT = re.compile(r"\d+(?:\.\d+)?", re.ASCII)
"""The amount of a cost. The cost of a Thing can be any text."""

_ORDER = {"print": 0, "machine": 1, "buy": 2}


class BomRow(FrozenStruct):
    """A row of the bill of materials. The row represents `quantity` equal pieces, each with the mass `mass` [kg].

    `cost` is the price per piece for this quantity, and `total` the price of all pieces, each with its currency. `picture` is the path of a
    file in the workspace.
    """

    number: str
    name: str
    definition: str
    quantity: int
    make: str
    material: str | None
    mass: float
    mass_source: str
    supplier: str | None
    cost: str | None
    total: str | None
    link: str | None
    picture: str | None


COLUMNS = BomRow.__struct_fields__
"""The columns of `bom.csv`, which are also the keys of each object in `bom.json`, in this order."""


def make_of(occurrence: Occurrence) -> str:
    """Return how an occurrence is made: `buy`, `print` or `machine`.

    A part of a nested assembly that is listed as one part has the value of the assembly, which is `buy` by default.

    The value comes from the document, or else from the Thing. If neither specifies a value, it is derived from the manufacturing process.

    In this case, an occurrence without geometry (a frame with a mass, such as a circuit board) counts as bought, because it cannot be
    manufactured. An occurrence with geometry is bought, machined (if its process removes material) or printed.
    """
    if occurrence.unit is not None:
        return occurrence.unit.bom.make or "buy"
    if occurrence.bom.make is not None:
        return occurrence.bom.make
    if occurrence.record is None or occurrence.record.box is None:
        return "buy"
    kind = occurrence.overrides.process_with(occurrence.material).technique.lower()
    return "buy" if kind == "bought" else "machine" if kind in MACHINED else "print"


def is_listed(occurrence: Occurrence) -> bool:
    """Return whether the bill of materials lists an occurrence, because it has geometry, mass or its own entry.

    A frame that only marks a position is not listed.
    """
    return (
        occurrence.unit is not None
        or (occurrence.record is not None and (occurrence.record.box is not None or bool(occurrence.record.bom)))
        or occurrence.properties.mass > 0.0
        or occurrence.bom != BomEntry()
    )


def items(assembly: Assembly) -> tuple[BomRow, ...]:
    """Return the rows of the bill of materials."""
    return tuple(row for row, _ in with_pieces(assembly))


def with_pieces(assembly: Assembly) -> tuple[tuple[BomRow, tuple[Occurrence, ...]], ...]:
    """Return each row of the bill of materials with the occurrences that it represents.

    Printed items come first, then machined, then bought items. Each of these groups is in the order of the document. If all values of
    several pieces are equal, the pieces share a row. A piece is an occurrence, or all occurrences of a nested assembly that is one part.

    The part number comes from the document, or else from the Thing. Rows without a part number get the numbers 1, 2, 3 and so on. Numbers
    that are already in use are skipped.
    """
    rows: dict[tuple[object, ...], list[list[_Piece]]] = {}
    listed = filter(is_listed, assembly.occurrences)
    for _, members in groupby(listed, lambda member: member.index if member.unit is None else member.unit.path):
        piece = _Piece(tuple(members))
        groups_of_key = rows.setdefault(piece.key, [])
        group = next((group for group in groups_of_key if group[0].mass == piece.mass), None)
        if group is None:
            groups_of_key.append([piece])
        else:
            group.append(piece)
    ordered = (group for groups_of_key in rows.values() for group in groups_of_key)
    groups = sorted(ordered, key=lambda group: (_ORDER.get(group[0].make, len(_ORDER)), group[0].first.index))
    numbers = _numbers([group[0].bom.number for group in groups])
    return tuple(
        (_row(number, group[0], len(group)), tuple(member for piece in group for member in piece.occurrences))
        for number, group in zip(numbers, groups, strict=True)
    )


class _Piece:
    """A piece to make or to buy: one occurrence, or all occurrences of a nested assembly that is listed as one part."""

    def __init__(self, occurrences: tuple[Occurrence, ...]) -> None:
        self.occurrences = occurrences
        first = self.first = occurrences[0]
        unit = first.unit
        self.bom = first.bom if unit is None else unit.bom
        self.make = make_of(first)
        self.mass = first.properties.mass if unit is None else sum(member.properties.mass for member in occurrences)
        sources = {member.mass_source for member in occurrences if member.properties.mass > 0.0} or {first.mass_source}
        self.mass_source = sources.pop() if len(sources) == 1 else "derived"
        has_geometry = unit is None and first.record is not None and first.record.box is not None
        self.material = first.material.name if first.material is not None and has_geometry else None
        definition = first.definition if unit is None else unit.definition
        self.definition = definition.plain if definition.plain is not None and self.make == "buy" and unit is None else definition

    @property
    def name(self) -> str:
        """The display name. For a mirror image, it includes the mirror axis.

        The display name is the name of the Thing, or else the name of the class, of the file without suffix, or of the component. For a
        nested assembly, it is the label of its definition.
        """
        if self.first.unit is not None:
            return self.definition.label
        mirror = self.definition.mirror
        return plain_name(self.first) + (f" (mirror={mirror})" if mirror is not None else "")

    @property
    def key(self) -> tuple[object, ...]:
        """The values that distinguish rows. The mass, the quantity and the assigned number are not included.

        If a frame or link has a part number, the number identifies it, regardless of the name of the component. Nested assemblies are
        identified by their definition.
        """
        by_name = self.first.unit is None and (self.bom.number is None or self.definition.kind not in ("frame", "link"))
        return self.definition, self.name if by_name else None, self.make, self.material, self.mass_source, self.bom


def _row(number: str, piece: _Piece, quantity: int) -> BomRow:
    cost = piece.bom.price(quantity)
    amount, _, currency = (cost or "").partition(" ")
    return BomRow(
        number=number, name=piece.name, definition=piece.definition.text, quantity=quantity, make=piece.make, material=piece.material,
        mass=piece.mass, mass_source=piece.mass_source, supplier=piece.bom.supplier, cost=cost,
        total=f"{quantity * Decimal(amount)} {currency}" if currency and _AMOUNT.fullmatch(amount) else None,
        link=piece.bom.link, picture=piece.bom.picture,
    )


def csv_text(rows: tuple[BomRow, ...]) -> str:
    """Format the bill of materials as CSV (RFC 4180) with a header line and line feeds as line ends.

    The mass is the mass of one piece [kg]. Unknown values are empty. If a spreadsheet would evaluate a cell, `'` is inserted at its
    beginning (see `format_cell`). The table has no row of totals, so a spreadsheet can sum its columns.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in rows:
        writer.writerow(map(format_cell, astuple(row)))
    return stream.getvalue()


def emit(request: EmitRequest) -> Artifacts:
    """Write `bom.csv` and `bom.json`, which contain the same rows. `bom.json` is a list of objects, in which unknown values are null."""
    rows = items(request.assembly)
    return Artifacts(files={"bom.csv": csv_text(rows).encode(), "bom.json": json_writer.encode([asdict(row) for row in rows])})


def plain_name(occurrence: Occurrence) -> str:
    """Return the name of the Thing, or else of its class, of its file without suffix, or of the component."""
    if occurrence.record is not None and (name := occurrence.record.bom.get("name")):
        return str(name)
    definition = occurrence.definition
    if definition.kind == "part":
        return definition.reference.rpartition(":")[2]
    if definition.kind == "file":
        return definition.reference.rpartition("/")[2].rpartition(".")[0] or definition.reference
    return occurrence.component.key


def _numbers(given: list[str | None]) -> list[str]:
    used = {number for number in given if number is not None}
    unused = (text for text in map(str, count(1)) if text not in used)
    return [next(unused) if number is None else number for number in given]

"""Write `bom.csv` and `bom.json`, which list the parts to print, to machine and to buy, with their quantities."""

from __future__ import annotations

import csv
import io
from itertools import count

from msgspec.structs import asdict, astuple

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import format_cell
from thingc.model.assembly.hag import Definition
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.targets import json_writer
from thingc.targets.artifact import Artifacts
from thingc.targets.request import EmitRequest

MACHINED = frozenset({"cnc", "machine", "machined", "mill", "milled", "milling", "lathe", "turning", "laser", "waterjet"})
"""Kinds of manufacturing processes that remove material. A part with any other kind of process is printed."""

_ORDER = {"print": 0, "machine": 1, "buy": 2}


class BomRow(FrozenStruct):
    """A row of the bill of materials. The row represents `quantity` equal pieces, each with the mass `mass` [kg]. `cost` is a string that
    the document or the Thing specifies.
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


COLUMNS = BomRow.__struct_fields__
"""The columns of `bom.csv`, which are also the keys of each object in `bom.json`, in this order."""


def make_of(occurrence: Occurrence) -> str:
    """Return how an occurrence is made: `buy`, `print` or `machine`.

    The value comes from the document, or else from the Thing. If neither specifies a value, it is derived from the manufacturing process.

    In this case, an occurrence without geometry (a frame with a mass, such as a circuit board) counts as bought, because it cannot be
    manufactured. An occurrence with geometry is bought, machined (if its process removes material) or printed.
    """
    record = occurrence.record
    stated = occurrence.bom.make or (record.bom.get("make") if record is not None else None)
    if stated:
        return stated
    if record is None or record.box is None:
        return "buy"
    own = occurrence.overrides.process
    kind = own.kind if own is not None else None
    if kind is None and occurrence.material is not None and occurrence.material.process is not None:
        kind = occurrence.material.process.kind
    if kind is None:
        return "print"
    return "buy" if kind.lower() == "bought" else "machine" if kind.lower() in MACHINED else "print"


def listed(occurrence: Occurrence) -> bool:
    """Return whether the bill of materials lists an occurrence, because it has geometry, mass or its own entry.

    A frame that only marks a position is not listed.
    """
    own = occurrence.bom
    return (
        (occurrence.record is not None and (occurrence.record.box is not None or bool(occurrence.record.bom)))
        or occurrence.properties.mass > 0.0
        or any(value is not None for value in (own.number, own.supplier, own.cost, own.make))
    )


def items(assembly: Assembly) -> tuple[BomRow, ...]:
    """Return the rows of the bill of materials."""
    return tuple(row for row, _ in with_pieces(assembly))


def with_pieces(assembly: Assembly) -> tuple[tuple[BomRow, tuple[Occurrence, ...]], ...]:
    """Return each row of the bill of materials with the occurrences that it represents.

    Printed items come first, then machined, then bought items. Each of these groups is in the order of the document. If all values of
    several occurrences are equal, the occurrences share a row.

    The part number comes from the document, or else from the Thing. Rows without a part number get the numbers 1, 2, 3 and so on. Numbers
    that are already in use are skipped.
    """
    rows: dict[tuple[object, ...], list[list[Occurrence]]] = {}
    for occurrence in assembly.occurrences:
        if listed(occurrence):
            alike = rows.setdefault(_key(occurrence), [])
            mass = occurrence.properties.mass
            group = next((group for group in alike if group[0].properties.mass == mass), None)
            if group is None:
                alike.append([occurrence])
            else:
                group.append(occurrence)
    ordered = (group for alike in rows.values() for group in alike)
    groups = sorted(ordered, key=lambda group: (_ORDER.get(make_of(group[0]), len(_ORDER)), group[0].index))
    numbers = _numbers([_said(group[0], "number") for group in groups])
    return tuple(
        (BomRow(
            number=number,
            name=_name(group[0]),
            definition=_definition(group[0]).text,
            quantity=len(group),
            make=make_of(group[0]),
            material=_material(group[0]),
            mass=group[0].properties.mass,
            mass_source=group[0].mass_source,
            supplier=_said(group[0], "supplier"),
            cost=_said(group[0], "cost"),
        ), tuple(group))
        for number, group in zip(numbers, groups, strict=True)
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


def json_text(rows: tuple[BomRow, ...]) -> bytes:
    """Format the bill of materials as a JSON list of objects. Unknown values are null."""
    return json_writer.encode([asdict(row) for row in rows])


def emit(request: EmitRequest) -> Artifacts:
    """Write `bom.csv` and `bom.json`, which contain the same rows."""
    rows = items(request.assembly)
    return Artifacts(files={"bom.csv": csv_text(rows).encode(), "bom.json": json_text(rows)})


def _key(occurrence: Occurrence) -> tuple[object, ...]:
    """Return the values that distinguish rows of the bill of materials. The mass, the quantity and the assigned number are not included.

    If a frame or link has a part number, the number identifies it, regardless of the name of the component.
    """
    number = _said(occurrence, "number")
    return (
        _definition(occurrence),
        _name(occurrence) if number is None or occurrence.definition.kind not in ("frame", "link") else None,
        make_of(occurrence),
        _material(occurrence),
        occurrence.mass_source,
        number,
        *(_said(occurrence, key) for key in ("supplier", "cost")),
    )


def _definition(occurrence: Occurrence) -> Definition:
    """Return the definition that is manufactured or bought for an occurrence. For a mirror image that is bought, return the definition of
    the original part.
    """
    own = occurrence.definition
    return own.plain if own.plain is not None and make_of(occurrence) == "buy" else own


def _said(occurrence: Occurrence, key: str) -> str | None:
    """Return the value of a key of the bill of materials for an occurrence.

    A value in the document takes precedence over the value of the Thing. Return None if neither specifies a value.
    """
    own: str | None = getattr(occurrence.bom, key)
    if own is None and occurrence.record is not None:
        return occurrence.record.bom.get(key)
    return own


def _material(occurrence: Occurrence) -> str | None:
    """Return the name of the material. Return None if the occurrence has no geometry or has several materials."""
    has_geometry = occurrence.record is not None and occurrence.record.box is not None
    return occurrence.material.name if occurrence.material is not None and has_geometry else None


def _name(occurrence: Occurrence) -> str:
    """Return the display name of the definition of an occurrence. For a mirror image, it includes the mirror axis.

    The display name is the name of the Thing, or else the name of the class, of the file without suffix, or of the component.
    """
    mirror = _definition(occurrence).mirror
    return _plain_name(occurrence) + (f" (mirror={mirror})" if mirror is not None else "")


def _plain_name(occurrence: Occurrence) -> str:
    if occurrence.record is not None and occurrence.record.bom.get("name"):
        return occurrence.record.bom["name"]
    definition = occurrence.definition
    if definition.kind == "part":
        return definition.reference.rpartition(":")[2]
    if definition.kind == "file":
        return definition.reference.rpartition("/")[2].rpartition(".")[0] or definition.reference
    return occurrence.component.key


def _numbers(said: list[str | None]) -> list[str]:
    taken = {number for number in said if number is not None}
    free = (text for text in map(str, count(1)) if text not in taken)
    return [next(free) if number is None else number for number in said]

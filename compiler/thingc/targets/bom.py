"""`bom.csv` and `bom.json`: what to print, to machine and to buy, rolled up."""

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
"""Kinds of process that take material away; a part of any other kind is printed."""

_ORDER = {"print": 0, "machine": 1, "buy": 2}


class BomRow(FrozenStruct):
    """One row: `quantity` equal pieces of `mass` [kg] each; `cost` as the document wrote it."""

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
"""The columns of `bom.csv` and the keys of every entry of `bom.json`, in order."""


def make_of(occurrence: Occurrence) -> str:
    """`buy | print | machine`: what the document says, else what the Thing says, else by the process.

    Without a word from either: what has no geometry (a frame with a mass, say a circuit board) is bought, since nobody
    can make it from these files; what has geometry is as its process says: bought, machined if that cuts, else printed.
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
    """Whether it is a thing to have in hand: it has geometry, or mass, or an entry of its own in the bill of materials.

    A frame that only marks a place is none.
    """
    own = occurrence.bom
    return (
        (occurrence.record is not None and (occurrence.record.box is not None or bool(occurrence.record.bom)))
        or occurrence.properties.mass > 0.0
        or any(value is not None for value in (own.number, own.supplier, own.cost, own.make))
    )


def items(assembly: Assembly) -> tuple[BomRow, ...]:
    """The rows of `with_pieces`, without them."""
    return tuple(row for row, _ in with_pieces(assembly))


def with_pieces(assembly: Assembly) -> tuple[tuple[BomRow, tuple[Occurrence, ...]], ...]:
    """The rows, each with its pieces: printed, machined, then bought things, each in document order.

    Occurrences are one row where nothing that a row says differs. A number comes from the document, else from the Thing; the
    others are counted 1, 2, 3 down the list, leaving out numbers that are taken.
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
    """RFC 4180 with a header and `\\n` line ends; mass of one piece in kg; empty where nothing is known; text that a
    spreadsheet would compute begins with `'` (see `format_cell`). No line of totals, so that a column can be summed."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in rows:
        writer.writerow(map(format_cell, astuple(row)))
    return stream.getvalue()


def json_text(rows: tuple[BomRow, ...]) -> bytes:
    """A list of objects; null where nothing is known."""
    return json_writer.encode([asdict(row) for row in rows])


def emit(request: EmitRequest) -> Artifacts:
    """`bom.csv` and `bom.json`, of the same rows."""
    rows = items(request.assembly)
    return Artifacts(files={"bom.csv": csv_text(rows).encode(), "bom.json": json_text(rows)})


def _key(occurrence: Occurrence) -> tuple[object, ...]:
    """What a row says, apart from the mass, the quantity and a counted number. The number of a frame or link identifies it, whatever the
    component is called."""
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
    """What is made or bought. Nobody sells the mirror image of a part: where one is bought, it is the part itself."""
    own = occurrence.definition
    return own.plain if own.plain is not None and make_of(occurrence) == "buy" else own


def _said(occurrence: Occurrence, key: str) -> str | None:
    """An entry of the document, else of the Thing."""
    own: str | None = getattr(occurrence.bom, key)
    if own is None and occurrence.record is not None:
        return occurrence.record.bom.get(key)
    return own


def _material(occurrence: Occurrence) -> str | None:
    """The material's name where the piece is of one material; what has no geometry has none."""
    has_geometry = occurrence.record is not None and occurrence.record.box is not None
    return occurrence.material.name if occurrence.material is not None and has_geometry else None


def _name(occurrence: Occurrence) -> str:
    """What a person calls the piece: as the Thing says, else the class, the file without its ending, or the component; and how it is
    mirrored, if it is."""
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

"""Parse CSV files with source positions: the catalogue of bought parts to a tree, and the table of a motion to cells."""

from __future__ import annotations

import csv
import io

from thingc.base.diagnostics import Code, Report
from thingc.base.source import MappingNode, Node, ScalarNode, SequenceNode, Span, line_of
from thingc.base.suggestions import did_you_mean, nearest
from thingc.base.units import shorten
from thingc.documents.load.text import Source

COLUMNS = ("number", "supplier", "cost", "quantity", "link", "picture")
"""The columns of a catalogue, in any order."""


def read_csv(source: Source, report: Report) -> MappingNode | None:
    """Parse CSV (RFC 4180) with a header line to the tree of a catalogue: a list `rows`, in which each row is a mapping.

    All values are strings. Empty cells and empty rows are omitted. If the table is invalid, report the error and return None. For the table
    of a motion, which has a column `time` or no column of a catalogue, return an empty tree: `model/resolve/motions.py` reads its cells.
    """
    rows = cells_of(source, report)
    if rows is None:
        return None
    if not rows:
        columns = f"`{','.join(COLUMNS)}` for a catalogue, or `time,elbow [deg]` for a motion"
        report.add(Code.NOT_A_MAPPING, "the table is empty", source.span(0, 0), help=f"write column names in the first row: {columns}")
        return None
    table_span, header = source.span(0, len(source.text)), rows[0]
    names = [text for text, _ in header]
    if len(header) == 1 and (delimiter := next((mark for mark in ";\t" if mark in names[0]), None)):
        mark = "`;`" if delimiter == ";" else "tabs"
        report.add(Code.SYNTAX, f"expected cells separated by `,`, found {mark}", header[0][1], help="export the table with commas")
        return None
    if any(text.startswith("time") for text in names) or not any(nearest(text, COLUMNS) for text in names):
        return MappingNode(entries={}, keys={}, span=table_span)
    unknown = [(text, span) for text, span in header if text not in COLUMNS]
    for text, span in unknown:
        help = did_you_mean(text, [name for name in COLUMNS if name not in names], what="columns")
        report.add(Code.UNKNOWN_KEY, f"unknown column `{shorten(text)}`", span, help=help)
    duplicates = [(text, span) for k, (text, span) in enumerate(header) if text in names[:k]]
    for text, span in duplicates:
        report.add(Code.DUPLICATE_KEY, f"the column `{shorten(text)}` occurs twice", span, help="remove one of the columns")
    if COLUMNS[0] not in names and not unknown:
        report.add(Code.MISSING_KEY, f"the column `{COLUMNS[0]}` is missing", header[0][1], help="add a column with order numbers")
    if unknown or duplicates or COLUMNS[0] not in names:
        return None
    entries: list[Node] = []
    for row in rows[1:]:
        if len(row) > len(header):
            text, span = row[len(header)]
            report.add(
                Code.SYNTAX, f"expected {len(header)} cells as in the header, found `{shorten(text)}` in cell {len(header) + 1}", span,
                help="write cells that contain a comma in double quotes",
            )
            return None
        filled = [(name, text, key, span) for (name, key), (text, span) in zip(header, row, strict=False) if text]
        if filled and COLUMNS[0] not in (name for name, *_ in filled):
            report.add(Code.MISSING_KEY, f"the row has no `{COLUMNS[0]}`", filled[0][3], help="add the order number of the part")
        elif filled:
            entries.append(MappingNode(
                entries={name: ScalarNode(value=text, text=text, span=span) for name, text, _, span in filled},
                keys={name: span for name, _, _, span in filled}, span=filled[0][3],
            ))
    return MappingNode(entries={"rows": SequenceNode(items=tuple(entries), span=table_span)}, keys={"rows": table_span}, span=table_span)


def cells_of(source: Source, report: Report) -> list[list[tuple[str, Span]]] | None:
    """Split a table into rows of cells, each with its span. Empty rows are omitted."""
    rows: list[list[tuple[str, Span]]] = []
    position = 0
    reader = csv.reader(io.StringIO(source.text, newline=""), strict=True, skipinitialspace=True)
    try:
        for cells in reader:
            row: list[tuple[str, Span]] = []
            for text in map(str.rstrip, cells):
                start = source.text.find(text, position)  # not found if a quote is written as two
                position = position if start < 0 else start + len(text)
                row.append((text, source.span(position - len(text) if start >= 0 else position, position)))
            if any(cells):
                rows.append(row)
    except csv.Error:
        report.add(
            Code.SYNTAX, 'the quotes (`"`) of a cell are invalid', line_of(source.file, reader.line_num),
            help='write each quote character in a quoted cell twice: `""`',
        )
        return None
    return rows

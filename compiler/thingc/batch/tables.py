"""Write the table of results of a batch, `results.csv` and `results.parquet`. The table has one row per variant, in the order of the plan.

Rows are read and written one at a time, so that even a table with many rows needs little memory.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from itertools import islice
from typing import Any

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import format_cell
from thingc.batch import folder_layout
from thingc.batch.build_records import in_order, lengths_in
from thingc.batch.folder_layout import Line
from thingc.batch.packed_layout import arrow_table
from thingc.batch.rules import PARAMETERS, RESULTS, dimension_of

BLOCK = 1024
"""Number of rows in a group of the Parquet file."""

HEAD = ("index", "id", "name", "status", "rule", "code", "message")
LOSSES = "losses"
"""The name of the column with the number of export losses of a variant."""

TAIL = ("path", "command")
RUN = ("parts_modelled", "parts_reused", "seconds")
"""Names of the columns that describe the run. The values in these columns differ between runs."""


class Column(FrozenStruct):
    """A column of the table of results.

    `kind` is the type of the values: `integer`, `number`, `text` or `flag`. `unit` is the SI unit of the values, or an empty string for
    values without a unit. `written` is the unit of the values in the documents, in which the page displays the column. `written` is empty
    if the documents use SI units.
    """

    name: str
    kind: str
    unit: str = ""
    written: str = ""


def setting(name: str) -> str:
    """Return the name of the table column for a parameter or a path.

    The column of a parameter has the prefix `parameters.`; the column of a path has the path as its name.
    """
    return name if "." in name else PARAMETERS + name


def columns(parameters: Sequence[Column], choices: Sequence[str], lengths: Sequence[str]) -> tuple[Column, ...]:
    """Return all columns of the table of results, in order.

    `parameters` contains the columns of parameters, `choices` the paths of choices, and `lengths` the names of the results `length.JOINT`.
    """
    return (
        *(Column(name=name, kind="integer" if name == "index" else "text") for name in HEAD),
        *(replace(column, name=setting(column.name)) for column in parameters),
        *(Column(name=path, kind="text") for path in choices),
        *(Column(name=name, kind="number", unit=dimension_of(name).symbol) for name in (*RESULTS, *lengths)),
        Column(name=LOSSES, kind="integer"),
        *(Column(name=name, kind="text") for name in TAIL),
        *(Column(name=name, kind="number" if name == "seconds" else "integer", unit="s" if name == "seconds" else "") for name in RUN),
    )


def flat(line: Line) -> dict[str, Any]:
    """Convert a journal line to a mapping from columns of the table to cells. Empty cells are None, and infinity is the string `inf`."""
    return {
        **{name: line.get(name) for name in HEAD},
        **{setting(name): value for name, value in line["parameters"].items()},
        **line["choices"],
        **line.get("results", {}),
        LOSSES: sum(line["losses"].values()) if "losses" in line else None,
        **{name: line.get(name) for name in TAIL},
        "parts_modelled": len(line["modelled"]) if "modelled" in line else None,
        "parts_reused": line.get("reused"),
        "seconds": line.get("seconds"),
    }


def cells(line: Line, columns: Sequence[Column]) -> list[Any]:
    """Convert a journal line to a list of table cells, in the order of `columns`. Empty cells are None."""
    values = flat(line)
    typed = [(column.kind, values.get(column.name)) for column in columns]
    return [float(value) if kind == "number" and value is not None else value for kind, value in typed]


def write_tables(folder: str, parameters: Sequence[Column], choices: Sequence[str]) -> tuple[Column, ...]:
    """Write the files `results.csv` and `results.parquet` of a batch again, each in one atomic step. Return the columns of the table."""
    from pyarrow.parquet import ParquetWriter

    table_columns = columns(parameters, choices, lengths_in(folder))
    paths = os.path.join(folder, folder_layout.TABLE_CSV), os.path.join(folder, folder_layout.TABLE_PARQUET)
    schema, lines = _schema(table_columns), in_order(folder)
    with open(f"{paths[0]}.new", "w", encoding="utf-8", newline="") as stream, ParquetWriter(f"{paths[1]}.new", schema) as parquet:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow([format_cell(column.name) for column in table_columns])
        while block := [cells(line, table_columns) for line in islice(lines, BLOCK)]:
            rows.writerows([format_cell(value) for value in row] for row in block)
            parquet.write_table(arrow_table(schema, block))
    for path in paths:
        os.replace(f"{path}.new", path)
    return table_columns


def _schema(columns: Sequence[Column]) -> Any:
    """Return the Arrow schema of the table. The metadata of a column contains its unit."""
    import pyarrow

    types = {"integer": pyarrow.int64(), "number": pyarrow.float64(), "text": pyarrow.string(), "flag": pyarrow.bool_()}
    return pyarrow.schema([
        pyarrow.field(column.name, types[column.kind], metadata={"unit": column.unit} if column.unit else None) for column in columns
    ])

"""Write the HTML page of a batch, `index.html`.

The page contains pictures of variants, the table of results, and a plot of any two columns. The page is a single file that loads nothing
from the network. The HTML file contains the style sheet, the script and the data; the pictures are in the folder `pictures/`. The page of
the same batch always has the same bytes, because columns about the run (`parts_modelled`, `seconds`, ...) are omitted.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

from thingc.base.diagnostics import Diagnostic
from thingc.base.safe_text import escape_control, html_text, in_script, pieces
from thingc.base.units import Quantity
from thingc.batch import folder_layout, variants_document
from thingc.batch.build_records import lengths_in, sample_records
from thingc.batch.folder import check_chunks, clear_state, explain_os_error, lock_folder, read_description, record_states
from thingc.batch.pictures import OnPicture, draw, usual
from thingc.batch.planning import Plan
from thingc.batch.tables import RUN, Column, cells, columns
from thingc.batch.values import size_of
from thingc.driver.environment import Options

MOST = 10_000
"""Maximum number of table rows on a page, which take about 4 MB. The page of a longer table contains this number of evenly spaced rows."""


def write_page(folder: str, described: Mapping[str, Any], columns: Sequence[Column]) -> str:
    """Write the HTML page of a batch into its folder in one atomic step, and return the path of the page.

    `described` is the content of `batch.json`, and `columns` contains the columns of the table. Only one row of the table is in memory at a
    time.
    """
    path = os.path.join(folder, folder_layout.PAGE)
    columns = [column for column in columns if column.name not in RUN]
    units = _units(columns)
    html_before, html_after = _frame(described)
    finished, lines = sample_records(folder, MOST)
    pictures = folder_layout.ids_with_pictures(folder)
    fresh = f"{path}.new"
    with open(fresh, "w", encoding="utf-8", newline="\n") as stream:
        stream.write(html_before)
        stream.write(_head({**described, "done": finished}, columns, [unit for unit, _ in units]))
        for number, line in enumerate(lines):
            row = [
                _json_value(value if size is None else _in_unit(value, size))
                for value, (_, size) in zip(cells(line, columns), units, strict=True)
            ]
            stream.write((",\n" if number else "\n") + in_script([*row, int(line["id"] in pictures)]))
        stream.write("\n]}" + html_after)
    os.replace(fresh, path)
    return path


def _frame(described: Mapping[str, Any]) -> tuple[str, str]:
    """Return two parts of the HTML page: the text before the data, and the text after the data."""
    package = resources.files("thingc.batch")
    texts = {place: (package / name).read_text(encoding="utf-8") for place, name in (("@STYLE@", "page.css"), ("@SCRIPT@", "page.js"))}
    texts["@TITLE@"] = html_text(f"{described['name']}: variants of {described['assembly']}")
    frame = pieces((package / "page.html").read_text(encoding="utf-8"))
    before, after = frame[: frame.index("@DATA@")], frame[frame.index("@DATA@") + 1 :]
    return "".join(texts.get(piece, piece) for piece in before), "".join(texts.get(piece, piece) for piece in after)


def _units(columns: Sequence[Column]) -> list[tuple[str, float | None]]:
    """Return the unit in which the page displays each column, and the size of this unit in SI units.

    The size is None for a column in SI units. The page displays a parameter in the unit of the documents. The page displays a result in the
    unit of the first parameter with the same physical dimension.
    """
    unit_of_dimension: dict[str, str] = {}
    for column in columns:
        if column.written and size_of(column.written) is not None:
            unit_of_dimension.setdefault(column.unit, column.written)
    chosen = [column.written or unit_of_dimension.get(column.unit, "") if column.unit else "" for column in columns]
    sizes = [size_of(unit) if unit else None for unit in chosen]
    return [(column.unit if size is None else unit, size) for column, unit, size in zip(columns, chosen, sizes, strict=True)]


def _in_unit(value: Any, size: float) -> Any:
    """Convert an SI value to a unit with the given size, with 12 digits. For example, 0.07 m is converted to 70 mm."""
    return float(f"{value / size:.12g}") if isinstance(value, (int, float)) and math.isfinite(value) else value


def _head(described: Mapping[str, Any], columns: Sequence[Column], units: Sequence[str]) -> str:
    """Return the first part of the JSON data of the page, up to the rows of the table."""
    names = ("name", "document", "assembly", "count", "done", "pose", "finished", "layout")
    data: dict[str, Any] = {name: _json_value(described[name]) for name in names}
    data["modes"] = [escape_control(name) for name in described["modes"]]
    data["columns"] = [{"name": column.name, "kind": column.kind, "unit": unit} for column, unit in zip(columns, units, strict=True)]
    return in_script(data)[:-1] + ',"rows":['


def _json_value(value: Any) -> Any:
    """Convert the value of a table cell to a JSON value.

    Infinity is converted to the string `inf`, and control characters in strings are escaped.
    """
    if isinstance(value, str):
        return escape_control(value)
    return "inf" if isinstance(value, float) and not math.isfinite(value) else value


def parameter_columns(plan: Plan) -> list[Column]:
    """Return the table columns for all parameters of the assembly, and for all values that the plan sets by path."""
    return [
        Column(name=name, kind="number", unit=plan.units[name], written=plan.written_in.get(name, "")) if isinstance(value, Quantity)
        else Column(name=name, kind="flag" if isinstance(value, bool) else "text")
        for name, value in plan.kinds.items()
    ]


def show(
    folder: str, described: Mapping[str, Any], columns: Sequence[Column], *, max_pictures: int, jobs: int,
    on_picture: OnPicture | None = None,
) -> Diagnostic | None:
    """Render pictures of at most `max_pictures` variants, and write the HTML page of the batch.

    Return a warning if this machine cannot render pictures. Ctrl-C ends only the rendering of pictures. After Ctrl-C, the page shows the
    pictures that are finished. Raises `OSError` if writing fails.
    """
    warning = None
    clear_state(folder, folder_layout.PAGE)
    try:
        warning = draw(folder, described["modes"][0], described["pose"], max_pictures=max_pictures, jobs=jobs, on_picture=on_picture)
    except KeyboardInterrupt:
        pass
    write_page(folder, described, columns)
    record_states(folder, folder_layout.PAGE)
    return warning


def show_again(
    document: str, *, output: str | None = None, pictures: int | None = None, jobs: int = 0, options: Options | None = None,
    on_picture: OnPicture | None = None,
) -> tuple[str, Diagnostic | None]:
    """Render the pictures of an existing batch and replace its HTML page. Return the path of the page, and a warning or None.

    The warning explains why this machine cannot render pictures. `pictures` has the same meaning as for the function `run`. Raises
    `PlanError` for a document with errors, and `BatchFault` if the batch does not exist or is still in progress.
    """
    plan = variants_document.plan(document, options=options)
    folder = plan.folder_in(output)
    described = read_description(plan.relative, folder, "build the batch first, without --page-only")
    try:
        with lock_folder(folder):
            check_chunks(folder, described)
            table_columns = columns(parameter_columns(plan), plan.choice_paths, lengths_in(folder))
            most = usual(described["count"]) if pictures is None else pictures
            warning = show(folder, described, table_columns, max_pictures=most, jobs=jobs or os.cpu_count() or 1, on_picture=on_picture)
    except OSError as fault:
        raise explain_os_error(folder, fault) from fault
    return os.path.join(folder, folder_layout.PAGE), warning

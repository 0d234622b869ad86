"""The page of a batch, `index.html`: pictures of the variants in a grid, the table, and a plot of anything against anything.

One file without a request to anywhere: style, program and data are in it, pictures lie beside it in `pictures/`. The same batch
gives the same bytes; what tells of the run (`parts_modelled`, `seconds`, ...) is left out.
"""

from __future__ import annotations

import html
import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

from thingc.shown import json_text, shown
from thingc.variants import places
from thingc.variants.journal import in_order
from thingc.variants.tables import RUN, Column, cells

MOST = 50_000
"""Rows of a page: about 20 MB. A browser takes no more; the tables have all."""

_ESCAPED = {ord("<"): "\\u003c", ord(">"): "\\u003e", ord("&"): "\\u0026"}
"""What could end a `<script>`, as JSON writes it instead."""


def write_page(folder: str, described: Mapping[str, Any], wanted: Sequence[Column]) -> str:
    """Write the page of the batch in `folder` from its journal; it appears as a whole. Returns its path.

    `described` is what `batch.json` says, `wanted` the columns of the table. A row is in memory at a time.
    """
    path = os.path.join(folder, places.PAGE)
    wanted = [column for column in wanted if column.name not in RUN]
    before, after = _frame(described)
    pictures = places.pictured(folder)
    fresh = f"{path}.new"
    with open(fresh, "w", encoding="utf-8", newline="\n") as stream:
        stream.write(before)
        stream.write(_head(described, wanted))
        for number, line in enumerate(in_order(os.path.join(folder, places.JOURNAL))):
            if number == MOST:
                break
            row = [_plain(value) for value in cells(line, wanted)]
            stream.write((",\n" if number else "\n") + _encoded([*row, int(line["id"] in pictures)]))
        stream.write("\n]}" + after)
    os.replace(fresh, path)
    return path


def _frame(described: Mapping[str, Any]) -> tuple[str, str]:
    """The page before and after its data."""
    own = resources.files("thingc.variants")
    texts = {place: (own / name).read_text(encoding="utf-8") for place, name in (("@STYLE@", "page.css"), ("@SCRIPT@", "page.js"))}
    texts["@TITLE@"] = html.escape(shown(f"{described['name']}: variants of {described['assembly']}"))
    # cut before anything is put in: a name may hold the word for a place
    pieces = re.split("(@[A-Z]+@)", (own / "page.html").read_text(encoding="utf-8"))
    before, after = pieces[: pieces.index("@DATA@")], pieces[pieces.index("@DATA@") + 1 :]
    return "".join(texts.get(piece, piece) for piece in before), "".join(texts.get(piece, piece) for piece in after)


def _head(described: Mapping[str, Any], wanted: Sequence[Column]) -> str:
    """The object that the page's program reads, up to its rows."""
    told: dict[str, Any] = {name: _plain(described[name]) for name in ("name", "document", "assembly", "count", "pose", "finished")}
    told["modes"] = [shown(name) for name in described["modes"]]
    told["columns"] = [{"name": column.name, "kind": column.kind, "unit": column.unit} for column in wanted]
    return _encoded(told)[:-1] + ',"rows":['


def _plain(value: Any) -> Any:
    """A cell as the page shows it: an infinite one is the text `inf`, text is on one line."""
    if isinstance(value, str):
        return shown(value)
    return "inf" if isinstance(value, float) and not math.isfinite(value) else value


def _encoded(value: Any) -> str:
    """JSON that can stand in a `<script>` whatever names and messages say."""
    return json_text(json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)).translate(_ESCAPED)

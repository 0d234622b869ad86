"""Pages that stand alone: their pieces put into a frame, and data in a `<script>`. For the viewer and for the page of a batch."""

from __future__ import annotations

import json
import re

from thingc.base.safe_text import json_text

_ESCAPED = {ord("<"): "\\u003c", ord(">"): "\\u003e", ord("&"): "\\u0026"}
"""What could end a `<script>`, as JSON writes it instead."""


def pieces(frame: str) -> list[str]:
    """A frame cut at its places (`@TITLE@`), which are pieces, too. It is cut before anything is put in: a name may hold the word for a
    place."""
    return re.split("(@[A-Z]+@)", frame)


def in_script(value: object) -> str:
    """JSON that can stand in a `<script>` whatever names and messages say. Raises ValueError for a number that is not finite."""
    return json_text(json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)).translate(_ESCAPED)

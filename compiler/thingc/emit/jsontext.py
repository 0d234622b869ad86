"""JSON as our artifacts write it: two spaces, `repr` floats, and a row of numbers on one line so that a matrix reads as one."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence


def encode(value: object) -> bytes:
    """`value` (mappings, sequences, text, numbers, flags, None) as UTF-8 JSON with a final newline, keys in the order given.

    Raises `ValueError` for a number that is not finite, which JSON cannot say, and `TypeError` for anything else.
    """
    return (_text(value, "\n") + "\n").encode()


def _text(value: object, newline: str) -> str:
    inner = newline + "  "
    if isinstance(value, Mapping):
        if not value:
            return "{}"
        entries = (f"{json.dumps(str(key), ensure_ascii=False)}: {_text(item, inner)}" for key, item in value.items())
        return "{" + inner + ("," + inner).join(entries) + newline + "}"
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
        if not any(isinstance(item, (Mapping, list, tuple)) for item in value):
            return "[" + ", ".join(_text(item, inner) for item in value) + "]"
        return "[" + inner + ("," + inner).join(_text(item, inner) for item in value) + newline + "]"
    if isinstance(value, float):
        value += 0.0  # a rotation leaves -0.0 where nothing is
    return json.dumps(value, ensure_ascii=False, allow_nan=False)

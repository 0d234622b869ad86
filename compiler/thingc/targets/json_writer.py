"""Encode values in the JSON format of build outputs. The format uses an indentation of two spaces and writes floats as `repr` does. Each
row of numbers is on one line.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from json.encoder import encode_basestring

from thingc.base.numeric import Recorded, formatter, isfinite
from thingc.base.safe_text import json_text


def encode(value: object) -> bytes:
    """Encode a JSON value as UTF-8 with a final newline. The value can consist of mappings, sequences, strings, numbers, booleans and None.
    The order of the keys is preserved.

    Raises `ValueError` for a number that is not finite, because JSON does not support such numbers. Raises `TypeError` for any other type.
    """
    return (json_text(_format_json(value, "\n")) + "\n").encode()


class JsonFragment(str):
    """A value that is already encoded as JSON. The value is indented for its nesting depth (see `fragment`)."""

    __slots__ = ()


def fragment(value: object, depth: int) -> JsonFragment:
    """Encode a value that is part of another JSON value, at the nesting depth `depth`. Raises the same exceptions as `encode`."""
    return JsonFragment(_format_json(value, "\n" + "  " * depth))


@formatter("json")
def number(value: float) -> str:
    """Format a finite number in the same way as `encode`."""
    return repr(value + 0.0)  # replaces the -0.0 in rotations by 0.0


_PLAIN = {float, int, str, bool, type(None)}


def _format_json(value: object, newline: str) -> str:
    if type(value) is float and isfinite(value):
        return number(value)
    if isinstance(value, str):
        return value if type(value) is JsonFragment else encode_basestring(value)
    inner = newline + "  "
    if isinstance(value, (dict, Mapping)):  # concrete types first, because abstract ones are slow to check
        if not value:
            return "{}"
        entries = [f"{encode_basestring(str(key))}: {_format_json(item, inner)}" for key, item in value.items()]
        return "{" + inner + ("," + inner).join(entries) + newline + "}"
    if isinstance(value, (list, tuple, Sequence)) and not isinstance(value, bytes):
        texts = [_format_json(item, inner) for item in value]
        if _PLAIN.issuperset(map(type, value)) or not any(isinstance(item, (Mapping, list, tuple, JsonFragment)) for item in value):
            return "[" + ", ".join(texts) + "]"
        return "[" + inner + ("," + inner).join(texts) + newline + "]"
    if isinstance(value, Recorded):
        return number(value)
    return json.dumps(value, ensure_ascii=False, allow_nan=False)

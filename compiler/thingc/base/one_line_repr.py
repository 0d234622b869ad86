"""Represent objects of the compiler in one line for debugging, and format counts with their nouns."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence, Set
from dataclasses import fields, is_dataclass
from typing import Any

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Span

LONGEST = 160
"""Maximum number of characters of a representation."""
LISTED = 6
"""Maximum number of items of a collection that are listed."""
_WORD = 40


class OneLineRepr:
    """Base class that provides a `__repr__` in one line, such as `Robot('arm', mode=LinkedMode('bench'), base='fixed', bodies=[7 Body])`.

    The representation contains the name of the object and all fields that are not empty, in order. Nested objects are represented by their
    names, and long collections by their lengths. The class is a base of structs, and of dataclasses with `repr=False`.
    """

    __slots__ = ()

    def __repr__(self) -> str:
        return _line(self)


class OneLineStruct(OneLineRepr, FrozenStruct):
    """Base class of immutable structs with a `__repr__` in one line."""


def format_count(number: int, noun: str) -> str:
    """Format a number with its noun in the singular or plural: `1 document`, `2 documents`, `2 losses`."""
    return f"{number} {noun}{'' if number == 1 else 'es' if noun.endswith(('s', 'sh')) else 's'}"


def _line(self: Any) -> str:
    named = _name_of(self)
    parts = [] if named is None else [_short_repr(named)]
    names = self.__struct_fields__ if isinstance(self, FrozenStruct) else [one.name for one in fields(self) if one.repr]
    for name in names:
        value = getattr(self, name)
        empty = value is None or (isinstance(value, (str, bytes, Sequence, Mapping, Set)) and not value)
        if not empty and value is not named:
            parts.append(f"{name}={_short_repr(value)}")
    line = f"{type(self).__name__}({', '.join(parts)})"
    while len(line) > LONGEST:
        parts.pop()
        line = f"{type(self).__name__}({', '.join([*parts, '...'])})"
    return line


def _name_of(value: object) -> str | None:
    """Return the name, path, text or code of an object, for its representation. Return None if the object has none of these attributes."""
    names = (getattr(value, attribute, None) for attribute in ("name", "path", "text", "code"))
    return next((one for one in names if isinstance(one, str) and one), None)


def _short_repr(value: Any) -> str:
    """Return a short representation of a field value for `OneLineRepr`."""
    if isinstance(value, (str, bytes)):
        return repr(value) if len(value) <= _WORD else f"{value[:_WORD]!r}..."
    if isinstance(value, Span):
        return f"{os.path.basename(value.file)}:{value.line}:{value.column}"
    if isinstance(value, FrozenStruct) or is_dataclass(value):
        named = _name_of(value)
        return type(value).__name__ + ("" if named is None else f"({_short_repr(named)})")
    if isinstance(value, (Mapping, Set)):
        return _format_items(list(value))
    if isinstance(value, Sequence):
        return _short_repr(value[0]) if isinstance(value[0], Span) else _format_items(value)
    if hasattr(value, "dtype"):
        return f"{value.dtype}{list(value.shape)}"
    return f"{value:.6g}" if isinstance(value, float) else f"{value!r}"[: _WORD + 20]


def _format_items(values: Sequence[Any]) -> str:
    """Format a collection for `OneLineRepr`: a short list of plain values as `[bench, drawing]`, other collections as `[7 Body]`."""
    if len(values) <= LISTED and all(isinstance(one, (str, int, float)) and len(f"{one}") <= _WORD for one in values):
        return "[" + ", ".join(one if isinstance(one, str) else _short_repr(one) for one in values) + "]"
    kinds = {type(one).__name__ for one in values}
    return f"[{len(values)} {kinds.pop() if len(kinds) == 1 else 'items'}]"

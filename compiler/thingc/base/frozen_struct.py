"""The base class of the compiler's data: an immutable msgspec struct."""

from __future__ import annotations

from typing import Any, dataclass_transform

import msgspec


class _KeywordOnly(msgspec.StructMeta):
    """Makes fields keyword-only unless a class passes `kw_only=False`. (msgspec does not inherit this option.)"""

    def __new__(
        mcls, name: str, bases: tuple[type, ...], namespace: dict[str, Any], /, *, kw_only: bool = True, **options: Any,
    ) -> _KeywordOnly:
        return super().__new__(mcls, name, bases, namespace, kw_only=kw_only, **options)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(msgspec.field,))
class FrozenStruct(msgspec.Struct, metaclass=_KeywordOnly, frozen=True):
    """A frozen struct with keyword-only fields. Its fields determine equality and the hash.

    A class can set the options `eq=False`, `kw_only=False` and `dict=True` (for `cached_property`). Equality compares every field.
    """

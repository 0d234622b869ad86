"""The base class for immutable data of the compiler, which is an msgspec struct."""

from __future__ import annotations

from typing import Any, dataclass_transform

import msgspec


class _KeywordOnly(msgspec.StructMeta):
    """A metaclass that makes all fields of a struct keyword-only.

    The metaclass is required because msgspec does not inherit the option `kw_only`.

    A class can pass `kw_only=False` to allow positional fields.
    """

    def __new__(
        mcls, name: str, bases: tuple[type, ...], namespace: dict[str, Any], /, *, kw_only: bool = True, **options: Any,
    ) -> _KeywordOnly:
        return super().__new__(mcls, name, bases, namespace, kw_only=kw_only, **options)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(msgspec.field,))
class FrozenStruct(msgspec.Struct, metaclass=_KeywordOnly, frozen=True):
    """Base class of immutable msgspec structs with keyword-only fields. Equality and hash are determined by the values of all fields.

    A subclass can set the options `eq=False`, `kw_only=False` and `dict=True`. The option `dict=True` is required for `cached_property`.
    """

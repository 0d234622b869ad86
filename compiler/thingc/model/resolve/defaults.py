"""Keys that may be written in more than one place (a component and its document's defaults, a mode and the one it extends)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Path


def numbered(written: list[Any] | dict[str, Any], number: int) -> tuple[Any, int | str] | None:
    """What a list, or a mapping by number, says for one of several, and its key there; None where it says nothing."""
    if isinstance(written, dict):
        return (written[str(number)], str(number)) if str(number) in written else None
    return (written[number], number) if number < len(written) else None


class DefaultLayers(FrozenStruct, kw_only=False):
    """Models of one kind with the key paths where they stand, the most specific first."""

    items: tuple[tuple[BaseModel, Path], ...]

    def pick(self, key: str, number: int | None = None) -> tuple[Any, Path] | None:
        """What is written for `key` (of a list, or of a mapping by number, for the one with this `number`), and its path; None where
        no layer has it."""
        return next(self._written(key, number), None)

    def sub(self, key: str, number: int | None = None) -> DefaultLayers:
        """The mappings written under `key` (and for `number`), to be merged key by key."""
        return DefaultLayers(tuple((value, path) for value, path in self._written(key, number) if isinstance(value, BaseModel)))

    def _written(self, key: str, number: int | None) -> Iterator[tuple[Any, Path]]:
        for model, path in self.items:
            value = getattr(model, key, None) if key in model.model_fields_set else None
            place: Path = (*path, key.rstrip("_"))
            if number is not None and isinstance(value, (list, dict)):
                own = numbered(value, number)
                value, place = (None, place) if own is None else (own[0], (*place, own[1]))
            if value is not None:
                yield value, place

    def __bool__(self) -> bool:
        return bool(self.items)

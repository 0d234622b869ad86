"""Keys that may be written in more than one place (a component and its document's defaults, a mode and the one it extends)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel

from thingc.source import Path


@dataclass(frozen=True, slots=True)
class Layers:
    """Models of one kind with the key paths where they stand, the most specific first."""

    items: tuple[tuple[BaseModel, Path], ...]

    def pick(self, key: str) -> tuple[Any, Path] | None:
        """What is written for `key`, and its path; None where no layer has it."""
        for model, path in self.items:
            if key in model.model_fields_set:
                value = getattr(model, key, None)
                if value is not None:
                    return value, (*path, key.rstrip("_"))
        return None

    def sub(self, key: str) -> Layers:
        """The mappings written under `key`, to be merged key by key."""
        found: list[tuple[BaseModel, Path]] = []
        for model, path in self.items:
            value = getattr(model, key, None)
            if isinstance(value, BaseModel) and key in model.model_fields_set:
                found.append((value, (*path, key.rstrip("_"))))
        return Layers(tuple(found))

    def __bool__(self) -> bool:
        return bool(self.items)

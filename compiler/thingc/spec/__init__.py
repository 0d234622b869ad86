"""Document models and their check. They are imported late: pydantic costs more than reading a document."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from thingc.spec.doubts import Specs
    from thingc.spec.fields import REFERENCE_PATTERN
    from thingc.spec.saying import within
    from thingc.spec.schema import json_schema
    from thingc.spec.stated import stated_choices, stated_value
    from thingc.spec.validation import part_references, validate, validate_one

_EXPORTS = {
    "REFERENCE_PATTERN": "fields", "Specs": "doubts", "json_schema": "schema", "part_references": "validation",
    "stated_choices": "stated", "stated_value": "stated", "validate": "validation", "validate_one": "validation", "within": "saying",
}
"""Exported name to the module that has it."""

__all__ = [
    "REFERENCE_PATTERN", "Specs", "json_schema", "part_references", "stated_choices", "stated_value", "validate", "validate_one", "within",
]


def __getattr__(name: str) -> Any:
    """The exported object, from its module; `AttributeError` for any other name."""
    if name in _EXPORTS:
        from importlib import import_module

        return getattr(import_module(f"thingc.spec.{_EXPORTS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

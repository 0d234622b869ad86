"""Document models and their check. They are imported late: pydantic costs more than reading a document."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from thingc.spec.saying import within
    from thingc.spec.validation import part_references, validate, validate_one

__all__ = ["part_references", "validate", "validate_one", "within"]


def __getattr__(name: str) -> Any:
    if name in __all__:
        from importlib import import_module

        return getattr(import_module("thingc.spec.saying" if name == "within" else "thingc.spec.validation"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

"""Document models and their check. They are imported late: pydantic costs more than reading a document."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from thingc.spec.saying import within
    from thingc.spec.validation import part_references, validate, validate_one

__all__ = ["part_references", "validate", "validate_one", "within"]


def __getattr__(name: str) -> Any:
    if name in __all__:
        from thingc.spec import saying, validation

        return getattr(saying if name == "within" else validation, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

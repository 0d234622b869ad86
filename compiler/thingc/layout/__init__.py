"""The text of documents, rewritten without changing what it means: canonical layout, and edits at places."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from thingc.layout.formatting import format_document, write_in_place

if TYPE_CHECKING:
    from thingc.layout.autofix import Looked, TextEdit, located, sure_edits
    from thingc.layout.setting import Unsettable, with_values

_EXPORTS = {
    "Looked": "autofix", "TextEdit": "autofix", "Unsettable": "setting", "located": "autofix", "sure_edits": "autofix",
    "with_values": "setting",
}

__all__ = [
    "Looked", "TextEdit", "Unsettable", "format_document", "located", "sure_edits", "with_values", "write_in_place",
]


def __getattr__(name: str) -> Any:
    """What `fmt` does not need, imported when it is asked for."""
    if name in _EXPORTS:
        from importlib import import_module

        return getattr(import_module(f"thingc.layout.{_EXPORTS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

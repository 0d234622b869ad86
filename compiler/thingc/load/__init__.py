"""Reading documents: text to trees whose every key and value has a position; nothing is interpreted here."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from thingc.load.documents import Documents, load, load_more, read_tree
from thingc.load.paths import find_assembly, named
from thingc.load.text import Source

if TYPE_CHECKING:
    from thingc.load.finding import assemblies_in, documents_in, documents_near, has_header, is_document
    from thingc.load.packaged import packaged_documents

__all__ = [
    "Documents", "Source", "assemblies_in", "documents_in", "documents_near", "find_assembly", "has_header", "is_document", "load",
    "load_more", "named", "packaged_documents", "read_tree",
]


def __getattr__(name: str) -> Any:
    """What only commands for whole folders need, imported when it is asked for."""
    if name in ("assemblies_in", "documents_in", "documents_near", "has_header", "is_document"):
        from thingc.load import finding

        return getattr(finding, name)
    if name == "packaged_documents":
        from thingc.load import packaged

        return packaged.packaged_documents
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

"""Reading documents: text to trees whose every key and value has a position; nothing is interpreted here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.exports import exported
from thingc.documents.load.documents import Documents, load, load_more, read_tree, remember
from thingc.documents.load.paths import find_assembly, named
from thingc.documents.load.text import Source

if TYPE_CHECKING:
    from thingc.documents.load.finding import assemblies_in, documents_in, documents_near, has_header, is_document
    from thingc.documents.load.packaged import packaged_documents

__all__ = [
    "Documents", "Source", "assemblies_in", "documents_in", "documents_near", "find_assembly", "has_header", "is_document", "load",
    "load_more", "named", "packaged_documents", "read_tree", "remember",
]

__getattr__ = exported(__name__, {
    "assemblies_in": "finding", "documents_in": "finding", "documents_near": "finding", "has_header": "finding", "is_document": "finding",
    "packaged_documents": "packaged",
})

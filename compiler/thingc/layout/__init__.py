"""The text of documents, rewritten without changing what it means: canonical layout, and edits at places."""

from __future__ import annotations

from thingc.layout.formatting import format_document, write_in_place

__all__ = ["format_document", "write_in_place"]

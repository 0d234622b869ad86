"""Reading documents: text to trees whose every key and value has a position; nothing is interpreted here."""

from __future__ import annotations

from thingc.load.documents import Documents, load, load_more, read_tree

__all__ = ["Documents", "load", "load_more", "read_tree"]

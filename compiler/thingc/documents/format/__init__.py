"""The text of documents, rewritten without changing what it means: canonical layout, and edits at places."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.exports import exported
from thingc.documents.format.formatting import format_document, is_laid_out

if TYPE_CHECKING:
    from thingc.documents.format.autofix import Looked, TextEdit, located, sure_edits
    from thingc.documents.format.setting import Unsettable, with_values

__all__ = [
    "Looked", "TextEdit", "Unsettable", "format_document", "is_laid_out", "located", "sure_edits", "with_values",
]

__getattr__ = exported(__name__, {
    "Looked": "autofix", "TextEdit": "autofix", "Unsettable": "setting", "located": "autofix", "sure_edits": "autofix",
    "with_values": "setting",
})

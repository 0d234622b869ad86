"""Formatting a document as `thingc fmt` does."""

from __future__ import annotations

from typing import Any

from thingc.base.diagnostics import Report
from thingc.documents.format.formatting import format_document
from thingc.tools.lsp.analysis import Analysis
from thingc.tools.lsp.line_edits import edits
from thingc.tools.lsp.positions import TextPlace


def formatted(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """The edits that bring a document into canonical layout; None where it is not well-formed, or none of ours."""
    after = format_document(analysis.path, text.encode(errors="surrogatepass"), Report()) if analysis.documents is not None else None
    return None if after is None else edits(analysis.lines(), after.decode())

"""Formatting a document as `thingc fmt` does."""

from __future__ import annotations

from typing import Any

from thingc.diagnostics import Report
from thingc.layout import format_document
from thingc.lsp.analysis import Analysis
from thingc.lsp.positions import TextPlace


def formatted(analysis: Analysis, text: str, place: TextPlace, params: Any) -> Any:
    """One edit of the lines that change; none where the text is not well-formed, or stands as it should."""
    after = format_document(analysis.path, text.encode(errors="surrogatepass"), Report())
    if after is None:
        return []
    new = after.decode()
    if new == text:
        return []
    return [{"range": analysis.lines().range_of(0, len(text)), "newText": new}]

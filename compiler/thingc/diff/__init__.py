"""What changed in a robot between two states of its documents: `thingc diff`."""

from __future__ import annotations

from thingc.diff.answer import Differences, answered, as_json
from thingc.diff.change import WHATS, Change, What
from thingc.diff.comparing import Comparison, compare
from thingc.diff.packing import pack, unpack
from thingc.diff.page import as_html
from thingc.diff.portrait import Portrait
from thingc.diff.reading import portrait
from thingc.diff.sides import Asked, UnknownSide, asked
from thingc.diff.states import Both, BrokenSide, compared, laid_out
from thingc.diff.telling import as_markdown, as_text

__all__ = [
    "WHATS",
    "Asked",
    "Both",
    "BrokenSide",
    "Change",
    "Comparison",
    "Differences",
    "Portrait",
    "UnknownSide",
    "What",
    "answered",
    "as_html",
    "as_json",
    "as_markdown",
    "as_text",
    "asked",
    "compare",
    "compared",
    "laid_out",
    "pack",
    "portrait",
    "unpack",
]

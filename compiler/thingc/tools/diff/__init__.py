"""What changed in a robot between two states of its documents: `thingc diff`."""

from __future__ import annotations

from thingc.tools.diff.answer import Differences, answered, as_json
from thingc.tools.diff.change import WHATS, Change, What
from thingc.tools.diff.comparing import Comparison, compare
from thingc.tools.diff.packing import pack, unpack
from thingc.tools.diff.page import as_html
from thingc.tools.diff.portrait import Portrait
from thingc.tools.diff.reading import portrait
from thingc.tools.diff.sides import Asked, UnknownSide, asked
from thingc.tools.diff.states import Both, BrokenSide, compared, laid_out
from thingc.tools.diff.telling import as_markdown, as_text

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

"""Write and parse the first line of generated files, which names the source document and mode."""

from __future__ import annotations

import re

_OF_MODE = re.compile(rb"Written by thingc from [^\r\n]*, mode (\w+)\.")


def heading(document: str, mode: str | None = None) -> str:
    """Return the header line of a file that is generated from a document, or from one of its modes."""
    return f"Written by thingc from {document}." if mode is None else f"Written by thingc from {document}, mode {mode}."


def mode_of(text: bytes) -> str | None:
    """Return the mode in the header line of a generated file, or None if the line does not contain a mode."""
    found = _OF_MODE.search(text)
    return None if found is None else found[1].decode("ascii", "replace")

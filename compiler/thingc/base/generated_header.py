"""Write and parse the comment in the first line of generated files, which contains the source document and the mode of the robot."""

from __future__ import annotations

import re

_OF_MODE = re.compile(rb"Written by thingc from [^\r\n]*, mode (\w+)\.")


def heading(document: str, mode: str | None = None) -> str:
    """Return the first line of a file that is generated from `document`. If `mode` is given, the line also contains the mode."""
    return f"Written by thingc from {document}." if mode is None else f"Written by thingc from {document}, mode {mode}."


def mode_of(text: bytes) -> str | None:
    """Return the mode that is written in the first line of a generated file. Return None if this line does not contain a mode."""
    found = _OF_MODE.search(text)
    return None if found is None else found[1].decode("ascii", "replace")

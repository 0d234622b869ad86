"""The line that generated files begin with, which says what they were made of: how it is written, and read again."""

from __future__ import annotations

import re

_OF_MODE = re.compile(rb"Written by thingc from [^\r\n]*, mode (\w+)\.")


def heading(document: str, mode: str | None = None) -> str:
    """Of a file that is written from a document, of one of its modes if it is of one."""
    return f"Written by thingc from {document}." if mode is None else f"Written by thingc from {document}, mode {mode}."


def mode_of(text: bytes) -> str | None:
    """The mode that a file is of, by the heading among what stands before its contents; None of a file of others."""
    found = _OF_MODE.search(text)
    return None if found is None else found[1].decode("ascii", "replace")

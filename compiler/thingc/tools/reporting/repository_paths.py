"""How places are named to programs that look at a whole repository, from whatever folder thingc was started in."""

from __future__ import annotations

import os


def repository(folder: str) -> str:
    """The absolute path of the nearest folder from `folder` upwards that holds `.git`, else of `folder` itself."""
    start = os.path.abspath(folder)
    above = start
    while not os.path.exists(os.path.join(above, ".git")):
        parent = os.path.dirname(above)
        if parent == above:
            return start
        above = parent
    return above


def within(file: str, base: str) -> str | None:
    """An absolute `file` relative to the folder `base`, with `/` between its words; None where it lies elsewhere."""
    try:
        relative = os.path.relpath(file, base)
    except ValueError:  # another drive
        return None
    words = relative.split(os.sep)
    return None if words[0] == os.pardir else "/".join(words)

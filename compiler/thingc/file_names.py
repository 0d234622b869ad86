"""Which texts files may have for names of things, whatever the language calls those."""

from __future__ import annotations

LONGEST = 200
"""Characters of a name."""

TAKEN: dict[str, tuple[str, ...]] = {"components": ("world",), "mounts": ("world",), "joints": ("root",)}
"""By kind, names that files have in any case: of the world, and of the joint of a free base."""


def is_file_name(text: str) -> bool:
    """Whether it is one line without spaces around it, of bounded length."""
    return 0 < len(text) <= LONGEST and text == text.strip() and text.isprintable()

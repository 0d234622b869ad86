"""Numbers that a text will be filled in with later."""

from __future__ import annotations


class Recorded:
    """A number that is not known yet. `word` is what stands for it in a text, until it is."""

    __slots__ = ()

    def word(self, form: str) -> str:
        """A word that nothing else in the text is; `form` is how the number is to be written there: `json` or `csv`."""
        raise NotImplementedError

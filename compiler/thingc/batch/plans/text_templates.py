"""Texts with slots, into which numbers are inserted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from thingc.base.numeric import FORMATTERS
from thingc.batch.plans.tape import SLOT, Tape, Traced
from thingc.batch.plans.trace_compilation import NotTraceable


class TextTemplate:
    """A text that contains slots. `slots` contains the distinct names of these slots."""

    def __init__(self, text: str) -> None:
        self._pieces = SLOT.split(text)
        self.slots = list(dict.fromkeys(self._pieces[1::2]))

    def fill(self, words: Mapping[str, str]) -> str:
        """Return the text with a word in place of each slot. `words` maps the names of slots to words."""
        pieces = self._pieces.copy()
        pieces[1::2] = [words[name] for name in pieces[1::2]]
        return "".join(pieces)


class NumberSlots:
    """The slots for traced numbers in one or more texts.

    `outputs` contains the traced numbers of these slots, in the order of `names`. Raises `NotTraceable` if a name does not belong to a slot
    for a number.
    """

    def __init__(self, tape: Tape, names: Iterable[str]) -> None:
        self.names = list(dict.fromkeys(names))
        self.outputs: list[Traced] = []
        self._formatters = []
        for name in self.names:
            line, _, form = name.partition(":")
            if not line.isdecimal() or int(line) >= len(tape.lines) or not (form in FORMATTERS or form.startswith(":")):
                raise NotTraceable("a string looks like a placeholder of a number")
            self.outputs.append(Traced(tape, int(line), tape.values[int(line)]))
            self._formatters.append(FORMATTERS.get(form, f"{{{form}}}".format))

    def words(self, values: Sequence[float]) -> dict[str, str]:
        """Format a value for each number in `outputs`. Return the formatted words by the names of their slots."""
        return {name: write(value) for name, write, value in zip(self.names, self._formatters, values, strict=True)}

"""Texts with slots into which numbers can be inserted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from thingc.base.numeric import FORMATTERS
from thingc.batch.plans.tape import SLOT, Tape, Traced
from thingc.batch.plans.trace_compilation import NotTraceable


class TextTemplate:
    """A text with slots, which are replaced by other texts. `slots` contains the distinct names of the slots."""

    def __init__(self, text: str) -> None:
        self._pieces = SLOT.split(text)
        self.slots = list(dict.fromkeys(self._pieces[1::2]))

    def fill(self, texts: Mapping[str, str]) -> str:
        """Replace each slot by the text with the name of the slot in `texts`, and return the result."""
        pieces = self._pieces.copy()
        pieces[1::2] = [texts[name] for name in pieces[1::2]]
        return "".join(pieces)


class NumberSlots:
    """The slots for traced numbers in one or more texts. `names` contains the names of the slots, with duplicates.

    `outputs` contains the traced number for each distinct name. Raises `NotTraceable` if a name does not refer to a line of the tape.
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

    def format_values(self, values: Sequence[float]) -> dict[str, str]:
        """Format the value of each number in `outputs`. Return a mapping from slot names to texts, as `TextTemplate.fill` requires."""
        return {name: write(value) for name, write, value in zip(self.names, self._formatters, values, strict=True)}

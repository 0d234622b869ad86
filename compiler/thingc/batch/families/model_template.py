"""The text of a model with gaps for the numbers of a tape."""

from __future__ import annotations

import re
from collections.abc import Sequence

from thingc.batch.plans.tape import Traced
from thingc.batch.plans.trace_compilation import TraceResult
from thingc.targets.xml_writer import number as number_text


def plain_text(rehearsal: TraceResult) -> str:
    """The text of the model with the numbers of the rehearsal."""
    return ModelTemplate(rehearsal).text(tuple(rehearsal.tape.values[line] for line in rehearsal.tape.written.values()))


class ModelTemplate:
    """The text of a model with gaps. `outputs` are the numbers for them, in the order in which `text` takes their values; `why` it is not
    `Arrays`. Where parts are exchanged there are gaps for the names of their `meshes`, too, which change from model to model. `tokened` is
    the text with a word in every gap, and `places` says which of the values it is for."""

    def __init__(self, rehearsal: TraceResult, why: str = "", meshes: Sequence[str] = ()) -> None:
        tape = rehearsal.tape
        self.why = why
        self.outputs = [Traced(tape, line, tape.values[line]) for line in tape.written.values()]
        self.tokened = rehearsal.made.text
        self.places = places = {word: k for k, word in enumerate((*tape.written, *meshes))}
        words = [re.escape(token) for token in tape.written]
        words += [rf'(?<="){re.escape(name)}(?=(?:\.obj)?")' for name in meshes]
        pieces = re.split(f"({'|'.join(words)})", rehearsal.made.text) if words else [rehearsal.made.text]
        self._pieces: list[str | int] = [places.get(piece, piece) if k % 2 else piece for k, piece in enumerate(pieces)]

    def text(self, values: Sequence[float], meshes: Sequence[str] = ()) -> str:
        """The text with these values, written as the compiler writes numbers, and these names."""
        words = [*map(number_text, values), *meshes]
        return "".join(piece if isinstance(piece, str) else words[piece] for piece in self._pieces)

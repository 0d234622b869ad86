"""The text of a model with slots for the numbers of a tape."""

from __future__ import annotations

import re
from collections.abc import Sequence

from thingc.batch.plans.tape import slot
from thingc.batch.plans.text_template import NumberSlots, TextTemplate
from thingc.batch.plans.trace_compilation import TraceResult


class ModelTemplate:
    """The text of a model with slots. `outputs` are the numbers for them, in the order in which `text` takes their values; `why` it is not
    `Arrays`. Where parts are exchanged there are slots for the names of their `meshes`, too, which change from model to model. `slotted` is
    the text with the slots, and `places` says which of the values one is for; `plain` is the text with the numbers of the rehearsal."""

    def __init__(self, rehearsal: TraceResult, why: str = "", meshes: Sequence[str] = ()) -> None:
        self.why = why
        self.slotted: str = rehearsal.made.text
        self._meshes = {name: f"mesh:{place}" for place, name in enumerate(meshes)}
        if meshes:
            named = rf'(?<=")({"|".join(map(re.escape, meshes))})(?=(?:\.obj)?")'
            self.slotted = re.sub(named, lambda name: slot(self._meshes[name[1]]), self.slotted)
        self._template = TextTemplate(self.slotted)
        self._numbers = NumberSlots(rehearsal.tape, (name for name in self._template.slots if name not in self._meshes.values()))
        self.outputs = self._numbers.outputs
        self.places = {slot(name): place for place, name in enumerate(self._numbers.names)}
        self.plain = self.text([number.value for number in self.outputs], meshes)

    def text(self, values: Sequence[float], meshes: Sequence[str] = ()) -> str:
        """The text with these values, written as the compiler writes numbers, and these names."""
        return self._template.fill({**self._numbers.words(values), **dict(zip(self._meshes.values(), meshes, strict=True))})

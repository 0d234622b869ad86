"""A model whose arrays are written anew for every variant."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from thingc.families.inertial import BOXES, Bodies, Worked
from thingc.families.places import INERT, Entry, places
from thingc.families.statistics import Statistics
from thingc.plans.rehearsal import Rehearsal
from thingc.plans.tape import Traced

if TYPE_CHECKING:
    import mujoco
    import numpy as np

    Array = np.ndarray[Any, np.dtype[Any]]

TOGETHER = 128
"""How many variants are worked out at once, where there are so many."""

INERTIAL = ("body_mass", "body_ipos", "body_inertia", "body_iquat")
"""The fields of a body's mass properties."""

Compile = Callable[[str], "mujoco.MjModel"]


class Arrays:
    """The model of one structure, and what of its arrays follows from the variables. `compile` makes a model of a text. Raises
    `NotInArrays` where a number does not stand in an array as it is written."""

    def __init__(self, rehearsal: Rehearsal, assets: Mapping[str, bytes], compile: Compile) -> None:
        import mujoco
        import numpy as np

        tape, tokens = rehearsal.tape, rehearsal.tape.written
        self._text = plain_text(rehearsal)
        self._assets = assets
        self.model = compile(self._text)
        found, inertials = places(rehearsal.made.text, tokens, self.model)
        columns: dict[int, int] = {}
        outputs: list[Any] = []

        def column(line: int) -> int:
            if line not in columns:
                columns[line] = len(outputs)
                outputs.append(Traced(tape, line, tape.values[line]))
            return columns[line]

        self.written = frozenset(place.field for _, place in found) | (frozenset(INERTIAL) if inertials else frozenset())
        by_field: dict[str, list[tuple[int, Entry]]] = {}
        for line, place in found:
            by_field.setdefault(place.field, []).append((column(line), place))
        self._writes: list[tuple[Array, Array, Array, Array]] = []
        self._options: list[tuple[str, int]] = []
        for field, entries in sorted(by_field.items()):
            group, _, name = field.rpartition(".")
            target = getattr(getattr(self.model, group) if group else self.model, name)
            if not isinstance(target, np.ndarray):
                self._options.append((name, entries[-1][0]))
                continue
            self._writes.append((
                target.reshape(-1), np.array([place.index for _, place in entries]), np.array([one for one, _ in entries]),
                np.array([place.sign for _, place in entries]),
            ))
        self._bodies = [self.model.body(name).id for name in inertials]
        self._names = list(inertials)
        self._inertials: list[list[int | float]] = [
            [column(tokens[word]) if word in tokens else float(word) for words in said for word in words] for said in inertials.values()
        ]
        self._traced = np.array([[word in tokens for words in said for word in words] for said in inertials.values()], dtype=bool)
        self._constants = not self._bodies and self.written <= INERT
        self._data = mujoco.MjData(self.model)
        self._statistics = Statistics(self.model, self._data)
        self._small: dict[int, Bodies] = {}
        self._geoms = [self._colliding(body) for body in self._bodies]
        self._rows = np.array(self._bodies, dtype=int)
        self._masses = [getattr(self.model, name) for name in INERTIAL]
        self._boxes = [[getattr(self.model, name)[self._span(body)] for name in BOXES] for body in self._bodies]
        self.outputs = outputs

    def _colliding(self, body: int) -> Array:
        """The geoms of a body that collide; behind them, where -1 leads, -1."""
        import numpy as np

        m = self.model
        geoms = range(int(m.body_geomadr[body]), int(m.body_geomadr[body]) + int(m.body_geomnum[body]))
        colliding = [g for g in geoms if m.geom_contype[g] or m.geom_conaffinity[g]]
        return np.array([*colliding, -1] if colliding else [], dtype=int)

    def _span(self, body: int) -> slice:
        """The rows of the boxes of a body."""
        first, count = int(self.model.body_bvhadr[body]), int(self.model.body_bvhnum[body])
        return slice(first, first + count) if count else slice(0)

    def prepare(self, values: Sequence[tuple[float, ...]]) -> Prepared:
        """What is worked out of many variants together, of what `run` gave for each. Raises `ValueError` where MuJoCo refuses one."""
        import numpy as np

        numbers = np.array(values, dtype=float).reshape(len(values), -1)
        worked = None
        if self._bodies:
            copies = 1 if len(values) == 1 else TOGETHER
            small = self._small.get(copies)
            if small is None:
                small = self._small[copies] = Bodies(self._text, self._assets, self._names, copies)
            inertials = np.empty((len(values), len(self._bodies), 10))
            for b, entries in enumerate(self._inertials):
                for k, entry in enumerate(entries):
                    inertials[:, b, k] = numbers[:, int(entry)] if self._traced[b, k] else entry
            worked = small.work_out(inertials)
            return Prepared(numbers, [numbers[:, columns] * signs for _, _, columns, signs in self._writes], inertials, worked)
        return Prepared(numbers, [numbers[:, columns] * signs for _, _, columns, signs in self._writes], None, None)

    def put(self, prepared: Prepared, index: int) -> None:
        """Make `model` that of a variant."""
        import mujoco

        model = self.model
        for (target, entries, _, _), block in zip(self._writes, prepared.blocks):
            target[entries] = block[index]
        for name, column in self._options:
            setattr(model.opt, name, float(prepared.numbers[index, column]))
        worked, inertials = prepared.worked, prepared.inertials
        if worked is not None and inertials is not None:
            for target, values in zip(self._masses, (inertials[index, :, 0], inertials[index, :, 1:4], *worked.of(index))):
                target[self._rows] = values
            for boxes, views, geoms in zip(worked.boxes, self._boxes, self._geoms):
                if len(geoms):
                    for name, view in zip(BOXES, views):
                        view[:] = boxes[name][index]
                    views[-1][:] = geoms[boxes["bvh_nodeid"][index]]
        if not self._constants:
            mujoco.mj_setConst(model, self._data)
            self._statistics.write()


class Prepared:
    """Variants that are worked out and not written yet."""

    __slots__ = ("blocks", "inertials", "numbers", "worked")

    def __init__(self, numbers: Array, blocks: list[Array], inertials: Array | None, worked: Worked | None) -> None:
        self.numbers = numbers
        self.blocks = blocks
        self.inertials = inertials
        self.worked = worked


def plain_text(rehearsal: Rehearsal) -> str:
    """The text of the model with the numbers of the rehearsal."""
    return TextTemplate(rehearsal).text(tuple(rehearsal.tape.values[line] for line in rehearsal.tape.written.values()))


class TextTemplate:
    """The text of a model with gaps. `outputs` are the numbers for them, in the order in which `text` takes their values; `why` it is not
    `Arrays`. Where parts are exchanged there are gaps for the names of their `meshes`, too, which change from model to model."""

    def __init__(self, rehearsal: Rehearsal, why: str = "", meshes: Sequence[str] = ()) -> None:
        import re

        tape = rehearsal.tape
        self.why = why
        self.outputs = [Traced(tape, line, tape.values[line]) for line in tape.written.values()]
        places = {word: k for k, word in enumerate((*tape.written, *meshes))}
        words = [re.escape(token) for token in tape.written]
        words += [rf'(?<="){re.escape(name)}(?=(?:\.obj)?")' for name in meshes]
        pieces = re.split(f"({'|'.join(words)})", rehearsal.made.text) if words else [rehearsal.made.text]
        self._pieces: list[str | int] = [places.get(piece, piece) if k % 2 else piece for k, piece in enumerate(pieces)]

    def text(self, values: Sequence[float], meshes: Sequence[str] = ()) -> str:
        """The text with these values, written as the compiler writes numbers, and these names."""
        from thingc.emit import number_text

        words = [*map(number_text, values), *meshes]
        return "".join(piece if isinstance(piece, str) else words[piece] for piece in self._pieces)

"""A model whose arrays are written anew for every other set of numbers in its text."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from thingc.patching.exact import restore
from thingc.patching.inertial import BOXES, Bodies, Worked
from thingc.patching.places import INERT, TENSED, Entry, places
from thingc.patching.statistics import Statistics

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
    """The model of one structure, and what of its arrays follows from numbers that differ. In `text` a word stands for each of these, in
    `tokens` with which number it is; `plain` is the text with numbers in it, `assets` the meshes by file. `compile` makes a model of a
    text. `lines` says which numbers `prepare` takes, in their order. Raises `NotInArrays` where a number does not stand in an array as it
    is written."""

    def __init__(self, text: str, tokens: Mapping[str, int], plain: str, assets: Mapping[str, bytes], compile: Compile) -> None:
        import mujoco
        import numpy as np

        self._text = plain
        self._assets = assets
        self.model = compile(self._text)
        root = ElementTree.fromstring(text)
        placed, inertials = places(root, tokens, self.model)
        columns: dict[int, int] = {}
        self.lines: list[int] = []

        def column(line: int) -> int:
            if line not in columns:
                columns[line] = len(self.lines)
                self.lines.append(line)
            return columns[line]

        self.written = frozenset(place.field for _, place in placed) | (frozenset(INERTIAL) if inertials else frozenset())
        by_field: dict[str, list[tuple[int, Entry]]] = {}
        for line, place in placed:
            by_field.setdefault(place.field, []).append((column(line), place))
        self._writes: list[tuple[Array, Array, Array, Array]] = []
        self._options: list[tuple[Any, str, int]] = []
        for field, entries in sorted(by_field.items()):
            self._take(field, entries)
        self._bodies = [self.model.body(name).id for name in inertials]
        self._names = list(inertials)
        self._inertials: list[list[int | float]] = [
            [column(tokens[word]) if word in tokens else float(word) for words in said for word in words] for said in inertials.values()
        ]
        self._traced = np.array([[word in tokens for words in said for word in words] for said in inertials.values()], dtype=bool)
        self._resting = [  # tendons whose springs rest where those of the joints do
            self.model.tendon(tendon.get("name", "")).id for tendon in root.iterfind("tendon/*") if "springlength" not in tendon.attrib
        ]
        self._constants = not self._bodies and self.written <= (INERT - TENSED if self.model.ntendon else INERT)
        self._data = mujoco.MjData(self.model)
        stated = {name for element in root.iter("statistic") for name in element.attrib}
        self._statistics = Statistics(self.model, self._data, stated)
        self._first: mujoco.MjModel | None = None
        self._is_lent = False
        self._small: dict[int, Bodies] = {}
        self._geoms = [self._colliding(body) for body in self._bodies]
        self._rows = np.array(self._bodies, dtype=int)
        self._masses = [getattr(self.model, name) for name in INERTIAL]
        self._boxes = [[getattr(self.model, name)[self._span(body)] for name in BOXES] for body in self._bodies]

    def lend(self) -> mujoco.MjModel:
        """The model, to somebody who may write into it."""
        if self._first is None:
            self._first = copy.copy(self.model)
        self._is_lent = True
        return self.model

    def take_back(self) -> None:
        """Undo what others have written into the model: `put` makes it that of a variant again, and of nothing else."""
        if self._is_lent and self._first is not None:
            restore(self.model, self._first)
        self._is_lent = False

    def _take(self, field: str, entries: list[tuple[int, Entry]]) -> None:
        """Note where the numbers of a field are written, each by its column: into an array, or an option of the model."""
        import numpy as np

        group, _, name = field.rpartition(".")
        owner = getattr(self.model, group) if group else self.model
        target = getattr(owner, name)
        if isinstance(target, np.ndarray):
            self._writes.append((
                target.reshape(-1), np.array([place.index for _, place in entries]), np.array([one for one, _ in entries]),
                np.array([place.sign for _, place in entries]),
            ))
        else:
            self._options.append((owner, name, entries[-1][0]))

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
        """What is worked out of many variants together, of the numbers of each. Raises `ValueError` where MuJoCo refuses one."""
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
        import numpy as np

        model = self.model
        for (target, entries, _, _), block in zip(self._writes, prepared.blocks):
            target[entries] = block[index]
        for owner, name, column in self._options:
            setattr(owner, name, float(prepared.numbers[index, column]))
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
            mujoco.mj_setConst(model, self._data)  # which leaves it where the springs of its joints rest
            model.tendon_lengthspring[self._resting] = self._data.ten_length[self._resting, None]
            if not np.array_equal(self._data.qpos, model.qpos0):
                self._data.qpos[:] = model.qpos0
                mujoco.mj_kinematics(model, self._data)
            self._statistics.write()


class Prepared:
    """Variants that are worked out and not written yet."""

    __slots__ = ("blocks", "inertials", "numbers", "worked")

    def __init__(self, numbers: Array, blocks: list[Array], inertials: Array | None, worked: Worked | None) -> None:
        self.numbers = numbers
        self.blocks = blocks
        self.inertials = inertials
        self.worked = worked

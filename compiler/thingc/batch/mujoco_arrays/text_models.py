"""Create MuJoCo models from many XML texts.

For texts that differ only in numbers, only one model is compiled. All other models are created by writing numbers into the arrays of the
compiled model.
"""

from __future__ import annotations

import copy
import re
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING

from thingc.base.frozen_struct import FrozenStruct
from thingc.batch.mujoco_arrays.arrays import TOGETHER, Arrays, Prepared
from thingc.batch.mujoco_arrays.entries import NotAnArrayEntry
from thingc.batch.mujoco_arrays.equality import different_fields

if TYPE_CHECKING:
    import mujoco

ENOUGH = 3
"""Number of models of a kind that are compiled before arrays are prepared for this kind.

Preparing the arrays takes as long as several compilations.
"""
KINDS, SHAPES = 32, 100_000
"""Maximum number of cached kinds of models, and maximum number of cached results of the check whether attribute values are numbers."""

_NUMBERS = re.compile(r"[-+0-9.e ]*[0-9][-+0-9.e ]*")


class ModelText(FrozenStruct, eq=False):
    """The XML text of a MuJoCo model without includes, with functions that read its meshes and compile its text.

    `meshes` identifies the mesh files. Equal values of `meshes` mean equal files. The function `assets` returns the contents of the mesh
    files by name. The function `compiled` compiles the XML text.
    """

    text: str
    meshes: Hashable
    assets: Callable[[], Mapping[str, bytes]]
    compiled: Callable[[], mujoco.MjModel]


class TextModels:
    """Creates MuJoCo models from many XML texts.

    Some of the models that are created without compilation are compared with a compiled model: the first, second, fourth, eighth ... of
    each kind. If a model differs from its compiled model, all later models of this kind are compiled. This class is not thread-safe.
    """

    def __init__(self) -> None:
        self._kinds: OrderedDict[Hashable, _Kind] = OrderedDict()
        self._shapes: dict[str, str | int] = {}

    def each(self, many: Iterable[ModelText], *, share: bool) -> Iterator[mujoco.MjModel]:
        """Yield the MuJoCo model of each XML text, in order. At most 128 texts are read ahead.

        With `share`, several yielded models can be the same object. With `share`, a model is valid only until the next model is requested.
        """
        texts = iter(many)
        while chunk := list(islice(texts, TOGETHER)):
            pieces = [model_text.text.split('"') for model_text in chunk]
            groups: dict[_Kind, list[int]] = {}
            for index, model_text in enumerate(chunk):
                groups.setdefault(self._kind(model_text, pieces[index]), []).append(index)
            ready = {
                index: (kind, prepared, k) for kind, members in groups.items()
                if (prepared := kind.prepare([pieces[index] for index in members])) is not None for k, index in enumerate(members)
            }
            for index, model_text in enumerate(chunk):
                model = ready[index][0].put(model_text, *ready[index][1:], share=share) if index in ready else None
                yield model_text.compiled() if model is None else model if share else copy.copy(model)

    def _kind(self, model_text: ModelText, pieces: Sequence[str]) -> _Kind:
        """Return the kind to which a model belongs. Two models of the same kind differ only in numbers."""
        if len(self._shapes) > SHAPES:
            self._shapes.clear()
        shapes = self._shapes
        for piece in pieces[1::2]:
            if piece not in shapes:
                shapes[piece] = len(piece.split()) if _NUMBERS.fullmatch(piece) else piece
        key = (model_text.meshes, *pieces[::2], *(shapes[piece] for piece in pieces[1::2]))
        kind = self._kinds.get(key)
        if kind is None:
            kind = self._kinds[key] = _Kind(model_text, pieces)
            if len(self._kinds) > KINDS:
                self._kinds.popitem(last=False)
        self._kinds.move_to_end(key)
        return kind


class _Kind:
    """A group of models that differ from the model `first` only in numbers.

    `pieces` contains the parts of the first XML text between quotation marks.
    """

    def __init__(self, first: ModelText, pieces: Sequence[str]) -> None:
        self._first = first
        self._pieces = list(pieces)
        self._gaps: list[int] = []
        self._arrays: Arrays | None = None
        self._slow = False
        self._seen = self._computed = 0

    def prepare(self, texts: Sequence[Sequence[str]]) -> Prepared | None:
        """Compute the array elements of several models of this kind. Return None if these models must be compiled."""
        self._seen += len(texts)
        if self._slow or self._seen <= ENOUGH:
            return None
        first = self._pieces
        others = {k for pieces in texts for k in range(1, len(first), 2) if pieces[k] != first[k]}.difference(self._gaps)
        try:
            if others or self._arrays is None:
                self._arrays = self._with_attributes(others)
            return self._arrays.prepare([self._numbers(pieces) for pieces in texts])
        except NotAnArrayEntry:
            self._slow = True
        except ValueError:  # MuJoCo rejects one of the models: compile each to find out which
            pass
        return None

    def put(self, model_text: ModelText, prepared: Prepared, index: int, *, share: bool) -> mujoco.MjModel | None:
        """Return the model with the given index in `prepared`, or None if this model must be compiled.

        With `share`, the returned model is shared. Without `share`, the caller must copy the returned model.
        """
        if self._slow or self._arrays is None:
            return None
        self._computed += 1
        is_due = self._computed & (self._computed - 1) == 0
        model = self._arrays.put(prepared, index, share=share, exact=is_due)
        if is_due and different_fields(model, model_text.compiled()):
            self._slow = True
            return None
        return model

    def _with_attributes(self, others: Iterable[int]) -> Arrays:
        """Return an `Arrays` object for which further attributes of the XML can have different numbers."""
        self._gaps = sorted((*self._gaps, *others))
        tokens: dict[str, int] = {}
        tokened = self._pieces.copy()
        for k in self._gaps:
            tokens_of_attribute = {f"#{len(tokens) + w}": len(tokens) + w for w in range(len(tokened[k].split()))}
            tokens |= tokens_of_attribute
            tokened[k] = " ".join(tokens_of_attribute)
        first = self._first
        return Arrays('"'.join(tokened), tokens, first.text, first.assets(), lambda text: first.compiled())

    def _numbers(self, pieces: Sequence[str]) -> tuple[float, ...]:
        """Return the numbers in the XML text of a model, in the order of their tokens."""
        return tuple(float(number) for k in self._gaps for number in pieces[k].split())

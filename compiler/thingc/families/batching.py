"""Many settings as a few models and arrays: for simulators that step many worlds of one model at once."""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from thingc.brief import Brief
from thingc.families.results import NoModel
from thingc.frozen import dataclass
from thingc.variants.in_place import LEADING, NUMBERS, OPTIONS, SHORTCUTS

if TYPE_CHECKING:
    import mujoco
    import numpy as np

    Array = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batched(Brief):
    """Settings that one model stands for. `fields` are the arrays in which they differ, by the name of the field of `MjModel` (`body_mass`;
    `opt.gravity` for an option), each (settings, *shape of the field), as `thingc.variants.apply` takes them; of `bvh_aabb` and its like
    the rows of bodies. `indices` are their places in what was given. `model` is that of the first."""

    model: mujoco.MjModel
    fields: Mapping[str, Array]
    indices: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Batches(Brief):
    """What became of a list of settings: the groups that one model stands for, in the order of their first settings, and by their places
    those that are refused."""

    groups: tuple[Batched, ...]
    refused: Mapping[int, NoModel]


def batched(models: Iterable[mujoco.MjModel | NoModel]) -> Batches:
    """The models of settings, which may be lent, as groups. Models are of one group where they differ in nothing but numbers that a
    simulation reads afresh (`thingc.variants.in_place`): the same elements and meshes, limited and touching alike."""
    groups: dict[bytes, _Group] = {}
    refused: dict[int, NoModel] = {}
    last: tuple[Any, _Group] | None = None
    for index, model in enumerate(models):
        if isinstance(model, NoModel):
            refused[index] = model
            continue
        if last is None or last[0] is not model:
            kind = _kind(model)
            if kind not in groups:
                groups[kind] = _Group(model)
            last = model, groups[kind]
        last[1].add(index, model)
    return Batches(groups=tuple(group.done() for group in groups.values()), refused=refused)


class _Group:
    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = copy.copy(model)
        self.indices: list[int] = []
        self.names = [name for name in (*sorted(NUMBERS | SHORTCUTS), *OPTIONS) if _field(model, name) is not None]
        self.bodies = int((model.body_bvhadr + model.body_bvhnum).max(initial=0))
        self.first = self._values(model)
        self.rows: dict[str, dict[int, Array]] = {}

    def _values(self, model: mujoco.MjModel) -> list[bytes]:
        return [self._value(model, name).tobytes() for name in self.names]

    def _value(self, model: mujoco.MjModel, name: str) -> Array:
        import numpy as np

        value = np.asarray(_field(model, name))
        return value[: self.bodies] if name in LEADING else value

    def add(self, index: int, model: mujoco.MjModel) -> None:
        for name, first in zip(self.names, self.first):
            value = self._value(model, name)
            if value.tobytes() != first:
                self.rows.setdefault(name, {})[len(self.indices)] = value.copy()
        self.indices.append(index)

    def done(self) -> Batched:
        import numpy as np

        fields = {}
        for name in self.names:
            if name in self.rows:
                own = self._value(self.model, name)
                made = fields[name] = np.empty((len(self.indices), *own.shape), own.dtype)
                made[:] = own
                for row, value in self.rows[name].items():
                    made[row] = value
        return Batched(model=self.model, fields=fields, indices=tuple(self.indices))


def _field(model: Any, name: str) -> Any:
    owner, _, field = name.rpartition(".")
    return getattr(getattr(model, owner) if owner else model, field, None)


def _kind(model: mujoco.MjModel) -> bytes:
    """A digest of all that makes models of different groups: sizes, names, and arrays that are no numbers."""
    from thingc.families.exact import content, names

    digest = hashlib.sha256()
    for name in names(model):
        if name in NUMBERS or name in SHORTCUTS or name in OPTIONS or name.startswith("stat."):
            continue
        digest.update(name.encode())
        digest.update(content(model, name))
    return digest.digest()

"""Convert many settings to a few MuJoCo models and arrays, for simulators that step many worlds with one model at once."""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.batch.families.merged_mesh_model import ModelSource, likeness, united
from thingc.batch.families.results import NoModel
from thingc.batch.mujoco_arrays.equality import content, names, owner_of
from thingc.batch.shared_model import LEADING, changeable_fields

if TYPE_CHECKING:
    import mujoco
    import numpy as np

    Array = np.ndarray[Any, np.dtype[Any]]


class Batched(OneLineRepr, FrozenStruct, eq=False):
    """A group of settings that share one MuJoCo model, and the arrays with the values that differ between these settings.

    `fields` maps the name of a field of `MjModel` (`body_mass`; `opt.gravity` for an option) to an array for `thingc.batch.apply`. The
    shape of an array is (settings, *shape of the field). Arrays of the fields in `LEADING` contain only the rows of bodies. `indices`
    contains the indices of the settings of this group in the input. `model` is the MuJoCo model of the first settings in this group. If the
    settings have different meshes, the shared model contains all meshes, and `geom_dataid` selects the mesh of each geom.
    """

    model: mujoco.MjModel
    fields: Mapping[str, Array]
    indices: tuple[int, ...]


class Batches(OneLineRepr, FrozenStruct):
    """The groups into which a list of settings was divided.

    `groups` contains groups of settings that share a model, and `refused` maps indices to settings without a model. The groups are ordered
    by the index of the first settings in each group.
    """

    groups: tuple[Batched, ...]
    refused: Mapping[int, NoModel]


def batched(models: Iterable[mujoco.MjModel | NoModel], source: Callable[[int], ModelSource] | None) -> Batches:
    """Group the models of many settings, so that all settings of a group can share a model.

    The models of a group differ only in numbers that a simulation reads at every step (see `thingc.batch.shared_model`). If `source` is
    given, the models of a group can also differ in meshes, but must have the same elements, limits and contacts. The callback `source`
    returns the XML and the meshes of the model with a given index. `models` can contain the same model object several times.
    """
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
    alike: dict[bytes, list[_Group]] = {}
    for kind, group in groups.items():
        alike.setdefault(likeness(group.model) if source is not None else kind, []).append(group)
    made: list[Batched] = []
    for some in alike.values():
        whole = _united(some, source) if source is not None and len(some) > 1 else None
        made += [whole] if whole is not None else [_stacked([group], group.model, {}) for group in some]
    return Batches(groups=tuple(sorted(made, key=lambda one: one.indices[0])), refused=refused)


class _Group:
    """A group of models that differ only in numbers.
"""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = copy.copy(model)
        self.indices: list[int] = []
        self.bodies = int((model.body_bvhadr + model.body_bvhnum).max(initial=0))
        self.first = {name: self.value(model, name).copy() for name in changeable_fields()}
        self._bytes = {name: value.tobytes() for name, value in self.first.items()}
        self.rows: dict[str, dict[int, Array]] = {}

    def value(self, model: mujoco.MjModel, name: str) -> Array:
        """Return the value of a field of a MuJoCo model. For fields in `LEADING`, return only the rows that belong to bodies."""
        import numpy as np

        value = np.asarray(getattr(*owner_of(model, name)))
        return value[: self.bodies] if name in LEADING else value

    def add(self, index: int, model: mujoco.MjModel) -> None:
        """Add the model of the settings with this index to the group."""
        for name, first in self._bytes.items():
            value = self.value(model, name)
            if value.tobytes() != first:
                self.rows.setdefault(name, {})[len(self.indices)] = value.copy()
        self.indices.append(index)

    def stack(self, name: str) -> Array:
        """Return the values of a field in all models of the group, as an array with shape (models, *shape of the field)."""
        import numpy as np

        first = self.first[name]
        made = np.empty((len(self.indices), *first.shape), first.dtype)
        made[:] = first
        for row, value in self.rows.get(name, {}).items():
            made[row] = value
        return made


def _stacked(groups: Sequence[_Group], model: mujoco.MjModel, more: Mapping[str, Array]) -> Batched:
    """Combine the settings of several groups in one `Batched` object. `more` contains arrays for additional fields."""
    import numpy as np

    first = groups[0]
    differing = [
        name for name in first.first
        if any(name in one.rows or one.first[name].tobytes() != first.first[name].tobytes() for one in groups)
    ]
    indices = np.concatenate([group.indices for group in groups])
    order = np.argsort(indices)
    fields = {name: np.concatenate([group.stack(name) for group in groups])[order] for name in differing}
    fields |= {name: value[order] for name, value in more.items()}
    return Batched(model=model, fields=fields, indices=tuple(indices[order].tolist()))


def _united(groups: Sequence[_Group], source: Callable[[int], ModelSource]) -> Batched | None:
    """Combine groups whose models have different meshes. Return None if the models of the groups cannot be merged."""
    import numpy as np

    together = united([source(group.indices[0]) for group in groups], [group.model for group in groups])
    if together is None or len({group.bodies for group in groups}) > 1:
        return None
    model, chosen = together
    meshes = np.concatenate([np.tile(np.array(one, dtype=np.int32), (len(group.indices), 1)) for one, group in zip(chosen, groups)])
    return _stacked(groups, model, {"geom_dataid": meshes})


def _kind(model: mujoco.MjModel) -> bytes:
    """Return a digest of all values in which the models of a group must be equal: sizes, names, and arrays that cannot be changed."""
    digest = hashlib.sha256()
    for name in names(model):
        if name not in changeable_fields():
            digest.update(name.encode() + content(model, name))
    return digest.digest()

"""Convert many settings to a few MuJoCo models and arrays, for simulators that step many worlds with one model at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.base.one_line_repr import OneLineStruct
from thingc.batch.families.merged_mesh_model import ModelSource, likeness, merge_models
from thingc.batch.families.results import NoModel
from thingc.batch.mujoco_arrays.equality import digest
from thingc.batch.shared_model import ModelGroup, changeable_fields

if TYPE_CHECKING:
    import mujoco

    from thingc.batch.shared_model import Array


class Batched(OneLineStruct, eq=False):
    """A group of settings that share one MuJoCo model, and the arrays with the values that differ between these settings.

    `fields` maps the name of a field of `MjModel` (`body_mass`; `opt.gravity` for an option) to an array for `thingc.batch.apply`. The
    shape of an array is (settings, *shape of the field). Arrays of the fields in `LEADING` contain only the rows of bodies. `indices`
    contains the indices of the settings of this group in the input. `model` is the MuJoCo model of the first settings in this group. If the
    settings have different meshes, the shared model contains all meshes, and `geom_dataid` selects the mesh of each geom.
    """

    model: mujoco.MjModel
    fields: Mapping[str, Array]
    indices: tuple[int, ...]

    def warp(self) -> Any:
        """Return a `mujoco_warp.Model` with one world for each of the settings, in the order of `indices`.

        Raises `FamilyError` if MuJoCo Warp cannot simulate these settings with one model.
        """
        from thingc.batch.families.warp_model import put_warp

        return put_warp(self.model, self.fields)


class Batches(OneLineStruct):
    """The groups into which a list of settings was divided.

    `groups` contains groups of settings that share a model, and `refused` maps indices to settings without a model. The groups are ordered
    by the index of the first settings in each group.
    """

    groups: tuple[Batched, ...]
    refused: Mapping[int, NoModel]


def make_batches(models: Iterable[mujoco.MjModel | NoModel], source: Callable[[int], ModelSource] | None) -> Batches:
    """Group the models of many settings, so that all settings of a group can share a model.

    The models of a group differ only in numbers that a simulation reads at every step (see `thingc.batch.shared_model`). If `source` is
    given, the models of a group can also differ in meshes, but must have the same elements, limits and contacts. The callback `source`
    returns the XML and the meshes of the model with a given index. `models` can contain the same model object several times.
    """
    groups: dict[bytes, ModelGroup] = {}
    refused: dict[int, NoModel] = {}
    last: tuple[Any, ModelGroup] | None = None
    for index, model in enumerate(models):
        if isinstance(model, NoModel):
            refused[index] = model
            continue
        if last is None or last[0] is not model:
            kind = digest(model, lambda name: name not in changeable_fields())
            if kind not in groups:
                groups[kind] = ModelGroup(model)
            last = model, groups[kind]
        last[1].add(index, model)
    mergeable: dict[bytes, list[ModelGroup]] = {}
    for kind, group in groups.items():
        mergeable.setdefault(likeness(group.model) if source is not None else kind, []).append(group)
    batches: list[Batched] = []
    for similar in mergeable.values():
        merged = _merge_groups(similar, source) if source is not None and len(similar) > 1 else None
        batches += [merged] if merged is not None else [_stack([group], group.model, {}) for group in similar]
    return Batches(groups=tuple(sorted(batches, key=lambda one: one.indices[0])), refused=refused)


def _stack(groups: Sequence[ModelGroup], model: mujoco.MjModel, added_fields: Mapping[str, Array]) -> Batched:
    """Combine the settings of several groups in one `Batched` object. `added_fields` maps names of further fields to arrays."""
    first = groups[0]
    differing = [
        name for name in first.first
        if any(name in one.rows or one.first[name].tobytes() != first.first[name].tobytes() for one in groups)
    ]
    indices = np.concatenate([group.indices for group in groups])
    order = np.argsort(indices)
    fields = {name: np.concatenate([group.stack(name) for group in groups])[order] for name in differing}
    fields |= {name: value[order] for name, value in added_fields.items()}
    return Batched(model=model, fields=fields, indices=tuple(indices[order].tolist()))


def _merge_groups(groups: Sequence[ModelGroup], source: Callable[[int], ModelSource]) -> Batched | None:
    """Combine groups whose models have different meshes. Return None if the models of the groups cannot be merged."""
    merged = merge_models([source(group.indices[0]) for group in groups], [group.model for group in groups])
    if merged is None or len({group.bodies for group in groups}) > 1:
        return None
    model, chosen = merged
    mesh_ids = np.concatenate([np.tile(np.array(meshes, dtype=np.int32), (len(group.indices), 1)) for meshes, group in zip(chosen, groups)])
    return _stack(groups, model, {"geom_dataid": mesh_ids})

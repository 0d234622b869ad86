"""Create one MuJoCo model for all variants of a batch, and arrays with the values that differ between variants.

    model, fields = thingc.batch.fields("build/leg_sweep", "standing")
    thingc.batch.apply(model, fields, 7)         # now it is the model of variant 7

Variants can share a model if they differ only in numbers, such as masses, frames, gains, limits and poses. To check this condition, all
arrays of the compiled models are compared.
"""

from __future__ import annotations

import copy
import functools
import io
import os
import sys
from collections.abc import KeysView, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.base.diagnostics import shown_path
from thingc.base.one_line_repr import format_count
from thingc.batch.mujoco_arrays.equality import different_fields, names, owner_of
from thingc.batch.results import BatchResults, BuiltVariant, FamilyError, load
from thingc.batch.run_options import is_whole

if TYPE_CHECKING:
    import mujoco
    Array = np.ndarray[Any, np.dtype[Any]]
    Fields = dict[str, Array]


SHORTCUTS = frozenset(("body_sameframe", "geom_sameframe", "site_sameframe", "bvh_aabb", "bvh_child", "bvh_depth", "bvh_nodeid"))
"""Names of arrays that depend on frames and affect only the speed of MuJoCo."""

LEADING = frozenset(("bvh_aabb", "bvh_child", "bvh_depth", "bvh_nodeid"))
"""Names of arrays in which the first rows belong to bodies. Later rows of these arrays belong to meshes, never change, and are omitted."""

SHAPES = ("flex", "hfield_", "mesh_", "oct_", "skin_", "tuple_")
"""Prefixes of the names of arrays that contain shapes."""

BUFFERS = frozenset(("actuator_delay", "sensor_delay", "sensor_interval"))
"""Names of arrays that determine the sizes of buffers."""

_FOLLOW = frozenset(("narena", "nbuffer", "nnames_map", "signature"))
"""Names of sizes in a MuJoCo model that depend on other sizes."""

_KINDS = {
    "body": ("body", "body", "nbody"), "jnt": ("joint", "joint", "njnt"), "geom": ("geom", "geom", "ngeom"),
    "site": ("site", "site", "nsite"), "cam": ("camera", "cam", "ncam"), "light": ("light", "light", "nlight"),
    "mesh": ("mesh", "mesh", "nmesh"), "mat": ("material", "mat", "nmat"), "pair": ("pair", "pair", "npair"),
    "eq": ("equality", "eq", "neq"), "tendon": ("tendon", "tendon", "ntendon"), "actuator": ("actuator", "actuator", "nu"),
    "sensor": ("sensor", "sensor", "nsensor"), "key": ("keyframe", "key", "nkey"),
}
"""For each prefix of array names: the kind of element in the rows, the accessor of `MjModel`, and the size that counts the elements."""


@functools.cache
def changeable_fields() -> KeysView[str]:
    """Return the names of the fields of `MjModel` in which the variants of a batch may differ.

    The fields are arrays and options of floating-point numbers that a simulation reads at every step, and dependent arrays (`SHORTCUTS`).
    The fields in `SHAPES` and `BUFFERS` and all visual settings are excluded.
    """
    import mujoco
    model = mujoco.MjSpec().compile()
    candidates = (name for name in names(model) if name not in BUFFERS and not name.startswith((*SHAPES, "vis.")))
    return {name: None for name in candidates if name in SHORTCUTS or np.asarray(getattr(*owner_of(model, name))).dtype.kind == "f"}.keys()


class StructuresDiffer(FamilyError):
    """Raised if variants cannot share a MuJoCo model. `field` is the first field that differs between variants and cannot be changed."""

    def __init__(self, field: str, message: str) -> None:
        super().__init__(message, "use separate models with `thingc.batch.load`")
        self.field = field


def fields(source: str | os.PathLike[str] | BatchResults, mode: str | None = None, *, scene: bool = False) -> tuple[mujoco.MjModel, Fields]:
    """Return the MuJoCo model of the first variant of a batch, and an array for each field in which variants differ.

    The keys of the arrays are names of fields of `MjModel` (`body_mass`; `opt.gravity` for an option). The shape of an array is (variants,
    *shape of the field). `source` is the folder of a batch, or the result of `load`. `mode` and `scene` have the same meaning as in the
    method `BuiltVariant.model`. Only a few compiled models are in memory at a time. Raises `StructuresDiffer` if variants differ in other
    fields, and `FamilyError` for a batch without variants.
    """
    family = _family(source)
    models = family.models(mode=mode, scene=scene, share=True)
    last = next(models)
    group = ModelGroup(last)
    group.add(0, last)
    for index, (variant, other) in enumerate(zip(family[1:], models, strict=True), start=1):
        if other is not last:
            _same_structure(group.model, other, family[0], variant)
            last = other
        group.add(index, other)
    stacked = {name: group.stack(name) for name in group.first if name in group.rows}
    return group.model, {name: _leading(value) if name in LEADING else value for name, value in stacked.items()}


class ModelGroup:
    """A group of models that differ only in numbers.

    `model` is a copy of the first model. `indices` contains the indices of all models. `first` maps the names of all fields that may differ
    to their values in the first model, and `rows` maps the names of the fields that differ to the values in other models, by position in
    `indices`.
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
        value = np.asarray(getattr(*owner_of(model, name)))
        return value[: self.bodies] if name in LEADING else value

    def add(self, index: int, model: mujoco.MjModel) -> None:
        """Add the model with this index to the group."""
        for name, first in self._bytes.items():
            value = self.value(model, name)
            if value.tobytes() != first:  # NaN equals NaN, and 0 differs from -0
                self.rows.setdefault(name, {})[len(self.indices)] = value.copy()
        self.indices.append(index)

    def stack(self, name: str) -> Array:
        """Return the values of a field in all models of the group, as an array with shape (models, *shape of the field)."""
        first = self.first[name]
        stacked = np.empty((len(self.indices), *first.shape), first.dtype)
        stacked[:] = first
        for row, value in self.rows.get(name, {}).items():
            stacked[row] = value
        return stacked


def apply(model: mujoco.MjModel, fields: Mapping[str, Any], index: int) -> None:
    """Write the field values of one variant into a MuJoCo model. `index` is the index of the variant in the arrays `fields`.

    An existing `MjData` of the model remains valid. If the index is invalid or the fields belong to another model, raise `FamilyError`
    without changing the model.
    """
    count = min(map(len, fields.values()), default=sys.maxsize)
    if not is_whole(index, 0) or index >= count:
        raise FamilyError(f"index {index} is out of range for fields of {format_count(count, 'variant')}")
    for name, values in fields.items():
        target = getattr(*owner_of(model, name), None)
        rows = values.shape[1:2] if name in LEADING else ()
        if target is None or values.shape[1:] != (*rows, *getattr(target, "shape", ())[len(rows):]):
            raise FamilyError(f"the field `{name}` and the model belong to different batches")
    for name, values in fields.items():
        owner, field = owner_of(model, name)
        target = getattr(owner, field)
        if getattr(target, "ndim", 0) == 0:
            setattr(owner, field, values[index].item())
        elif name in LEADING:
            target[: values.shape[1]] = values[index]
        else:
            target[:] = values[index]


def write(
    source: str | os.PathLike[str] | BatchResults, path: str | os.PathLike[str], mode: str | None = None, *, scene: bool = False,
) -> str:
    """Save the arrays of a batch to the file `path`, and save the model with its meshes to a second file in the same folder.

    Return the path of the second file. For example, `legs.npz` contains an array for each field, and an array `id` with the ids of the
    variants. In this example, the second file `legs.mjz` contains the model. The files of the same batch always have the same bytes. Raises
    the same errors as `fields`, and `OSError` if writing fails.
    """
    from thingc.base.zip_files import MODEL, make_zip

    target = os.fsdecode(path)
    if not target.endswith(".npz"):
        raise FamilyError(f"expected a file that ends in `.npz`, found `{shown_path(target)}`")
    family = _family(source)
    _, differing = fields(family, mode, scene=scene)
    text, files = family[0].sources(mode, scene=scene)
    robot = f"{family.robot}_{family.choose_mode(mode)}.xml"
    contents = {MODEL: text, **{name if name == robot else f"assets/{name}": data for name, data in files.items()}}
    arrays: dict[str, bytes] = {}
    for name, array in {"id": np.array([variant.id for variant in family]), **differing}.items():
        stream = io.BytesIO()
        np.lib.format.write_array(stream, np.ascontiguousarray(array), allow_pickle=False)
        arrays[f"{name}.npy"] = stream.getvalue()
    model = f"{target.removesuffix('.npz')}.mjz"
    for place, entries in ((model, contents), (target, arrays)):
        with open(f"{place}.new", "wb") as file:
            file.write(make_zip(entries))
    os.replace(f"{model}.new", model)
    os.replace(f"{target}.new", target)
    return model


def _family(source: str | os.PathLike[str] | BatchResults) -> BatchResults:
    family = source if isinstance(source, BatchResults) else load(source)
    if not len(family):
        raise FamilyError(f"batch `{family.name}` has no built variant")
    return family


def _leading(values: Any) -> Any:
    """Return the first rows of an array that contains all variants, up to the last row that differs between variants."""
    changes = (values != values[:1]).reshape(*values.shape[:2], -1).any(axis=(0, 2))
    return values[:, : int(changes.nonzero()[0].max()) + 1]


def _same_structure(model: Any, other: Any, first: BuiltVariant, second: BuiltVariant) -> None:
    """Raise `StructuresDiffer` if the MuJoCo models of two variants differ in a field that `changeable_fields` does not contain."""
    variants = f"in `{first.name}` and `{second.name}`"
    elements, other_elements = element_names(model), element_names(other)
    for kind, _, count in _KINDS.values():
        if elements[kind] != other_elements[kind]:
            unmatched = {*elements[kind]} ^ {*other_elements[kind]}
            only = [name for name in (*elements[kind], *other_elements[kind]) if name in unmatched]
            which = f"`{only[0]}` exists in only one of the two models" if only else "their order differs"
            raise StructuresDiffer(count, f"the elements of kind `{kind}` differ {variants}: {which}")
    differing = [name for name in different_fields(model, other) if name not in changeable_fields() and name not in _FOLLOW]
    if any(name.startswith("mesh_") for name in differing):
        _raise_of_meshes(model, other, variants)
    sizes = [name for name in differing if isinstance(getattr(model, name, None), int | bytes)]
    for name in (*sizes, *differing):
        a, b = getattr(model, name, None), getattr(other, name, None)
        if isinstance(a, np.ndarray):
            raise StructuresDiffer(name, f"`{name}` differs {variants}{_where(model, name, a, b)} and cannot be changed in place")
        if isinstance(a, int | bytes):
            raise StructuresDiffer(name, f"`{name}` differs {variants}{f': {a} and {b}' if isinstance(a, int) else ''}")
        if name.startswith("opt."):
            option = name.removeprefix("opt.")
            raise StructuresDiffer(name, f"the option `{option}` differs {variants} and cannot be changed in place")


def _raise_of_meshes(model: Any, other: Any, both: str) -> None:
    """Raise `StructuresDiffer` for two MuJoCo models with different meshes.

    The error message contains the name of the first mesh that differs.
    """
    for k in range(model.nmesh):
        slices = [slice(one.mesh_vertadr[k], one.mesh_vertadr[k] + one.mesh_vertnum[k]) for one in (model, other)]
        if not np.array_equal(model.mesh_vert[slices[0]], other.mesh_vert[slices[1]]):
            message = f"the mesh `{model.mesh(k).name}` differs {both} and cannot be changed in place"
            raise StructuresDiffer("mesh_vert", message)
    raise StructuresDiffer("mesh_face", f"meshes differ {both} and cannot be changed in place")


def element_names(model: Any) -> dict[str, list[str]]:
    """Return a mapping from each kind of element, such as bodies and joints, to the names of all such elements in a MuJoCo model."""
    return {word: [getattr(model, accessor)(k).name for k in range(getattr(model, count))] for word, accessor, count in _KINDS.values()}


def _where(model: Any, name: str, a: Any, b: Any) -> str:
    """Describe the first difference between the arrays `a` and `b` of two models by the name of the element and both values.

    Return an empty string if the rows of the arrays do not belong to named elements.
    """
    kind = name.partition("_")[0]
    if a.shape != b.shape or not (kind == "dof" or kind in _KINDS):
        return ""
    row = int(np.argwhere(np.asarray(a != b).reshape(len(a), -1).any(axis=1))[0][0])
    owner = int(model.dof_jntid[row]) if kind == "dof" else row
    word, accessor, _ = _KINDS["jnt" if kind == "dof" else kind]
    return f" ({word} `{getattr(model, accessor)(owner).name}`: {a[row]} and {b[row]})"

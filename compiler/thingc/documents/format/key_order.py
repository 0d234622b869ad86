"""The canonical order of keys: that of the document models; the keys that a person chooses stay as they are."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel

from thingc.documents.spec.annotation_types import FieldType, branch_of, model_keys, shape_of
from thingc.documents.spec.assembly import AssemblySpec, AtSpec, ComponentSpec, JointSpec
from thingc.documents.spec.modes import HoldSpec, ModeSpec, WorldAtSpec
from thingc.documents.spec.validation import model_of

FIRST: dict[type[BaseModel], tuple[str, ...]] = {
    ComponentSpec: (
        "repeat", "part", "file", "unit", "assembly", "link", "frame", "params", "parameters", "material", "mass", "com", "inertia",
        "shapes", "attach", "at", "mounts", "mirror", "collision", "visual", "process", "bom",
    ),
    JointSpec: (
        "repeat", "type", "parent", "child", "axis", "loop", "turn", "gap", "offset", "limit", "dynamics", "mimic", "drive",
    ),
    AtSpec: ("in",), WorldAtSpec: ("on",), HoldSpec: ("at",), ModeSpec: ("extends",),
    AssemblySpec: (
        "name", "description", "parameters", "materials", "defaults", "components", "joints", "tendons", "links", "mounts", "poses",
        "modes", "sensors", "names",
    ),
}
"""Models whose keys do not stand as a person reads them (those of defaults and poses come before their own): these keys first, the
others behind them in the model's order."""

FREE = ("$schema", "thingc")
"""Keys that stand above all others of a document."""


@functools.cache
def _keys(model: type[BaseModel]) -> tuple[dict[str, int], dict[str, FieldType]]:
    """The rank and the shape of every key of a model."""
    keys = model_keys(model)
    first = [key for key in FIRST.get(model, ()) if key in keys]
    names = [*first, *(key for key in keys if key not in first)]
    if "thingc" in keys:
        names = [*FREE, *(name for name in names if name != "thingc")]
    return {name: rank for rank, name in enumerate(names)}, {key: shape for key, (shape, _) in keys.items()}


def root_shape(kind: str | None) -> FieldType | None:
    """The shape of a document of a kind; None where no model is known."""
    model = model_of(kind or "")
    return None if model is None else shape_of(model)


def shape_for(shape: FieldType | None, value: Any) -> FieldType | None:
    """The shape of what is written: of a union the branch that was meant. `value` needs the right type and keys only."""
    if shape is None or shape.kind != "union":
        return shape
    return branch_of(shape, value)


def shape_below(shape: FieldType | None, key: str | None) -> FieldType | None:
    """The shape of an entry (or, without a key, of an item) of a value of this shape, if it is known."""
    if shape is None:
        return None
    if shape.model is not None and shape.kind == "model":
        return None if key is None else _keys(shape.model)[1].get(key)
    if (shape.kind == "dict") == (key is not None) and shape.kind in ("dict", "list"):
        return _member(shape.members[0])
    return None


@functools.lru_cache(maxsize=256)
def _member(annotation: Any) -> FieldType:
    return shape_of(annotation)


def ordered(names: Sequence[str], shape: FieldType | None) -> list[int]:
    """The canonical order of the keys of a mapping, as indices into `names`.

    A key that the model does not know stays behind the key that it stands behind.
    """
    if shape is None or shape.kind != "model" or shape.model is None:
        return list(range(len(names)))
    ranks = _keys(shape.model)[0]
    places: list[tuple[int, int]] = []
    rank = -1
    for at, name in enumerate(names):
        rank = ranks.get(name, rank)
        places.append((rank, at))
    return [at for _, at in sorted(places)]

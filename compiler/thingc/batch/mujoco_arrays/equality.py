"""Compare two MuJoCo models bit by bit."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import mujoco

GROUPS = ("opt", "stat", "vis", "vis.global_", "vis.quality", "vis.headlight", "vis.map", "vis.scale", "vis.rgba")
"""The names of the structures of a model that contain further numbers."""


def different_fields(first: mujoco.MjModel, second: mujoco.MjModel) -> list[str]:
    """Compare two MuJoCo models, and return the names of all fields that differ.

    The function compares arrays, sizes, names, options, statistics and visual settings. The field `signature` is not compared, because it
    depends on the file.
    """
    return [name for name in names(first) if content(first, name) != content(second, name)]


def restore(model: mujoco.MjModel, first: mujoco.MjModel) -> None:
    """Reset `model`, a modified copy of `first`, by copying all values of `first` to `model`."""
    for name in different_fields(model, first):
        owner, field = owner_of(model, name)
        value = getattr(*owner_of(first, name))
        if isinstance(value, np.ndarray):
            getattr(owner, field)[...] = value
        else:
            setattr(owner, field, value)


def names(model: mujoco.MjModel) -> Iterator[str]:
    """Yield the names of all compared fields of a model, such as `body_mass`, `opt.gravity` or `vis.map.znear`."""
    for prefix in ("", *(f"{group}." for group in GROUPS)):
        owner, _ = owner_of(model, prefix)
        for name in dir(owner):
            if not name.startswith("_") and name != "signature" and isinstance(getattr(owner, name), (int, float, bytes, np.ndarray)):
                yield prefix + name


def owner_of(model: Any, name: str) -> tuple[Any, str]:
    """Return the object that has the field as an attribute, and the name of this attribute.

    For example, the field `vis.map.znear` has the object `model.vis.map` and the attribute name `znear`.
    """
    if "." not in name:  # the most common case
        return model, name
    *groups, field = name.split(".")
    for group in groups:
        model = getattr(model, group)
    return model, field


def digest(model: mujoco.MjModel, chosen: Callable[[str], bool]) -> bytes:
    """Return a digest of the fields of a model for whose names `chosen` returns True."""
    hasher = hashlib.sha256()
    for name in filter(chosen, names(model)):
        hasher.update(name.encode() + content(model, name))
    return hasher.digest()


def content(model: Any, name: str) -> bytes:
    """Return the shape and the value of a field as bytes that can be compared."""
    value = np.asarray(getattr(*owner_of(model, name), None))
    return str(value.shape).encode() + value.tobytes()

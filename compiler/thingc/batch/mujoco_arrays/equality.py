"""Compare two MuJoCo models bit by bit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import mujoco

GROUPS = ("opt", "stat", "vis", "vis.global_", "vis.quality", "vis.headlight", "vis.map", "vis.scale", "vis.rgba")
"""The structures of a model that contain further numbers."""


def different_fields(first: mujoco.MjModel, second: mujoco.MjModel) -> list[str]:
    """Compare two MuJoCo models, and return the names of all fields that differ.

    Arrays, sizes, names, options, statistics and visual settings are compared. `signature` is not compared, because it depends on the file.
    """
    return [name for name in names(first) if content(first, name) != content(second, name)]


def restore(model: mujoco.MjModel, first: mujoco.MjModel) -> None:
    """Reset `model`, a modified copy of `first`: copy all values of `first` to it."""
    import numpy as np

    for name in different_fields(model, first):
        owner, field = owner_of(model, name)
        value = getattr(*owner_of(first, name))
        if isinstance(value, np.ndarray):
            getattr(owner, field)[...] = value
        else:
            setattr(owner, field, value)


def names(model: mujoco.MjModel) -> Iterator[str]:
    """Yield the names of all fields of a model that are compared, such as `body_mass`, `opt.gravity` or `vis.map.znear`."""
    import numpy as np

    for prefix in ("", *(f"{group}." for group in GROUPS)):
        owner, _ = owner_of(model, prefix)
        for name in dir(owner):
            if not name.startswith("_") and name != "signature" and isinstance(getattr(owner, name), (int, float, bytes, np.ndarray)):
                yield prefix + name


def owner_of(model: Any, name: str) -> tuple[Any, str]:
    """Return the object that has a field as its attribute, and the name of the attribute.

    For the field `vis.map.znear`, these are `model.vis.map` and `znear`.
    """
    if "." not in name:  # the most common case
        return model, name
    *groups, field = name.split(".")
    for group in groups:
        model = getattr(model, group)
    return model, field


def content(model: Any, name: str) -> bytes:
    """Return the shape and the value of a field as bytes, for comparisons."""
    import numpy as np

    value = np.asarray(getattr(*owner_of(model, name), None))
    return str(value.shape).encode() + value.tobytes()

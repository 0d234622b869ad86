"""Whether two of MuJoCo's models are the same, to the last bit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import mujoco

GROUPS = ("opt", "stat", "vis", "vis.global_", "vis.quality", "vis.headlight", "vis.map", "vis.scale", "vis.rgba")
"""The structures of a model that hold numbers besides its arrays."""


def different_fields(first: mujoco.MjModel, second: mujoco.MjModel) -> list[str]:
    """The names of all fields in which two models differ: arrays, sizes and names, and numbers of `opt`, `stat` and `vis`; none where they
    are the same. `signature` is left out: it is of the file."""
    return [name for name in names(first) if content(first, name) != content(second, name)]


def restore(model: mujoco.MjModel, first: mujoco.MjModel) -> None:
    """Make a model the same as `first`, of which it was a copy, whatever has been written into it."""
    import numpy as np

    for name in different_fields(model, first):
        owner, field = owner_of(model, name)
        value = getattr(*owner_of(first, name))
        if isinstance(value, np.ndarray):
            getattr(owner, field)[...] = value
        else:
            setattr(owner, field, value)


def names(model: mujoco.MjModel) -> Iterator[str]:
    """What a model is compared by: `body_mass`, `opt.gravity`, `vis.map.znear`."""
    import numpy as np

    for prefix in ("", *(f"{group}." for group in GROUPS)):
        owner, _ = owner_of(model, prefix)
        for name in dir(owner):
            if not name.startswith("_") and name != "signature" and isinstance(getattr(owner, name), (int, float, bytes, np.ndarray)):
                yield prefix + name


def owner_of(model: Any, name: str) -> tuple[Any, str]:
    """The structure that has a field (`model.vis.map` of `vis.map.znear`), and the name of the field there."""
    if "." not in name:  # nearly all, and each model of a batch asks for each
        return model, name
    *groups, field = name.split(".")
    for group in groups:
        model = getattr(model, group)
    return model, field


def content(model: Any, name: str) -> bytes:
    """The shape and the bytes of a field."""
    import numpy as np

    value = np.asarray(getattr(*owner_of(model, name), None))
    return str(value.shape).encode() + value.tobytes()

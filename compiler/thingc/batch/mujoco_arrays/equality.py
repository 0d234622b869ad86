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
        group, _, field = name.rpartition(".")
        value = getattr(_owner(first, group), field)
        if isinstance(value, np.ndarray):
            getattr(_owner(model, group), field)[...] = value
        else:
            setattr(_owner(model, group), field, value)


def names(model: mujoco.MjModel) -> Iterator[str]:
    """What a model is compared by: `body_mass`, `opt.gravity`, `vis.map.znear`."""
    import numpy as np

    for group in ("", *GROUPS):
        owner = _owner(model, group)
        if owner is None:
            continue
        for name in dir(owner):
            if name.startswith("_") or name == "signature":
                continue
            value = getattr(owner, name)
            if isinstance(value, (int, float, bytes, np.ndarray)):
                yield f"{group}.{name}" if group else name


def _owner(model: Any, group: str) -> Any:
    owner = model
    for word in filter(None, group.split(".")):
        owner = getattr(owner, word, None)
    return owner


def content(model: Any, name: str) -> bytes:
    """The shape and the bytes of a field."""
    import numpy as np

    group, _, field = name.rpartition(".")
    value = np.asarray(getattr(_owner(model, group), field, None))
    return str(value.shape).encode() + value.tobytes()

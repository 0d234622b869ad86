"""The state of a robot in a mode, independent of a simulator. `RobotState` maps joint paths to values, and `State` contains arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from thingc.base.one_line_repr import OneLineRepr
from thingc.modes.errors import ModesError
from thingc.modes.frames import Array

Values = TypeVar("Values")


class State(NamedTuple, Generic[Values]):
    """The state of a robot as arrays of numpy or JAX. The arrays have the same shapes in every mode.

    Attributes:
        base: The pose (4, 4) of the root link in the world.
        twist: The twist (6,) of the root link: the velocity [m/s] of the link frame's origin in world axes, then the angular velocity
            [rad/s] in link axes.
        q: The joint coordinates [rad or m] in the order of `Mode.coordinates`. Coordinates of joints that the mode cuts are ignored.
        v: The joint velocities [rad/s or m/s] in the same order.
    """

    base: Values
    twist: Values
    q: Values
    v: Values


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class RobotState(OneLineRepr):
    """The state of a robot in the mode `mode`: the pose and twist of its root link, and the coordinate and velocity of every joint.

    The arrays are copies and cannot be modified. Raises `ModesError` for arrays with a wrong shape, and for NaN or infinite numbers.

    Attributes:
        base_pose: The pose (4, 4) of the root link in the world.
        base_twist: The twist (6,) of the root link: the velocity [m/s] of the link frame's origin in world axes, then the angular velocity
            [rad/s] in link axes.
        q: The joint coordinates [rad or m] by joint path.
        v: The joint velocities [rad/s or m/s] by joint path.
    """

    mode: str
    base_pose: Array
    base_twist: Array
    q: Mapping[str, float]
    v: Mapping[str, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "base_pose", _checked_array("base_pose", self.base_pose, (4, 4)))
        object.__setattr__(self, "base_twist", _checked_array("base_twist", self.base_twist, (6,)))
        for name in ("q", "v"):
            values = {path: float(value) for path, value in getattr(self, name).items()}
            _checked_array(name, list(values.values()), (len(values),))
            object.__setattr__(self, name, MappingProxyType(values))


def _checked_array(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = np.array(values, dtype=float)
    if array.shape != shape:
        raise ModesError(f"expected `{name}` of shape {shape}, found {array.shape}")
    if not np.isfinite(array).all():
        raise ModesError(f"`{name}` has numbers that are not finite")
    array.setflags(write=False)
    return array

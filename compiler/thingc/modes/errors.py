"""The exceptions that the package `thingc.modes` raises."""

from __future__ import annotations

import numpy as np

from thingc.base.exceptions import PicklableError
from thingc.modes.frames import Array


class ModesError(PicklableError, ValueError):
    """The base class of all exceptions of the package `thingc.modes`."""


class UnknownMode(ModesError, KeyError):
    """Raised if the robot does not have a mode with the requested name."""

    def __str__(self) -> str:
        return ValueError.__str__(self)  # KeyError would show the repr


class WrongData(ModesError):
    """Raised if a `mujoco.MjData` belongs to the model of a different mode, or of a different variant of the robot."""


class BaseMoves(ModesError):
    """Raised if a mode switch requires that a link is at rest, but the link is moving.

    `twist` (6,) is the velocity of the link [m/s, rad/s].
    """

    def __init__(self, mode: str, link: str, twist: Array) -> None:
        linear, angular = float(np.linalg.norm(twist[:3])), float(np.linalg.norm(twist[3:]))
        super().__init__(
            f"link `{link}` must not move in mode `{mode}`, found {linear:.3g} m/s and {angular:.3g} rad/s: use "
            "on_motion=\"drop\" or on_motion=\"impact\""
        )
        self.twist = twist


class BaseElsewhere(ModesError):
    """Raised if a mode has a fixed base, but its root link is not at the pose that the mode specifies.

    `distance` [m] and `angle` [rad] are the deviation of the link from the specified pose.
    """

    def __init__(self, mode: str, link: str, distance: float, angle: float, tolerance: float) -> None:
        super().__init__(
            f"link `{link}` is {distance:.3g} m and {angle:.3g} rad away from its fixed pose in mode `{mode}` "
            f"(tolerance: {tolerance:.3g}): move the link, or use `base: held`"
        )
        self.distance = distance
        self.angle = angle

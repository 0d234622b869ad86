"""The exceptions that the package `thingc.modes` raises."""

from __future__ import annotations

import numpy as np

from thingc.modes.frames import Array


class ModesError(ValueError):
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
            f"mode `{mode}` holds `{link}` at rest, but this link moves at {linear:.3g} m/s and {angular:.3g} rad/s: choose "
            "on_motion=\"drop\" (the joints' velocities stay as they are) or on_motion=\"impact\" (a perfectly inelastic catch)"
        )
        self.twist = twist


class BaseElsewhere(ModesError):
    """Raised if a mode has a fixed base, but its root link is not at the pose that the mode specifies.

    `distance` [m] and `angle` [rad] are the deviation of the link from the specified pose.
    """

    def __init__(self, mode: str, link: str, distance: float, angle: float, tolerance: float) -> None:
        super().__init__(
            f"mode `{mode}` fixes `{link}` to the world, but this link is {distance:.3g} m and {angle:.3g} rad away from its fixed pose "
            f"(tolerance {tolerance:.3g}): move the link to this pose first, or use `base: held` for the mode"
        )
        self.distance = distance
        self.angle = angle

"""What can be wrong with a switch, in words and in numbers."""

from __future__ import annotations

import numpy as np

from thingc.modes.frames import Array


class ModesError(ValueError):
    """Any of the faults of this package."""


class UnknownMode(ModesError, KeyError):
    """A mode that the robot does not have."""

    def __str__(self) -> str:
        return ValueError.__str__(self)  # a KeyError would show the repr


class WrongData(ModesError):
    """A `mujoco.MjData` that is not of the mode that it was given for."""


class BaseMoves(ModesError):
    """A base that is to be held still, while its link moves. `twist` (6,) is its motion [m/s, rad/s]."""

    def __init__(self, mode: str, link: str, twist: Array) -> None:
        linear, angular = float(np.linalg.norm(twist[:3])), float(np.linalg.norm(twist[3:]))
        super().__init__(
            f"mode `{mode}` holds `{link}` still, and it moves at {linear:.3g} m/s and {angular:.3g} rad/s: choose "
            "on_motion=\"drop\" (the joints' velocities stay as they are) or on_motion=\"impact\" (a perfectly inelastic catch)"
        )
        self.twist = twist


class BaseElsewhere(ModesError):
    """A bolted base whose link is not where the mode has it. `distance` [m] and `angle` [rad] say how far away it is."""

    def __init__(self, mode: str, link: str, distance: float, angle: float, tolerance: float) -> None:
        super().__init__(
            f"mode `{mode}` has `{link}` bolted to the world, and it is {distance:.3g} m and {angle:.3g} rad away from there "
            f"(tolerance {tolerance:.3g}): bring it there first, or give the mode `base: held`, which stands anywhere"
        )
        self.distance = distance
        self.angle = angle

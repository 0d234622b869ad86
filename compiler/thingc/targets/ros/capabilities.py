"""The features of a robot that a ROS 2 package can express, in its URDF or in its other files."""

from __future__ import annotations

from typing import Never

from thingc.targets.capabilities import Capabilities, Omitted, Supported
from thingc.targets.urdf.capabilities import BALL_DRIVE, CAPABILITIES as URDF, JointForm, ShapeForm

_CONTROL = Supported(None, "ros2_control")

CAPABILITIES: Capabilities[JointForm, None, Never, ShapeForm, Never] = {
    **URDF,
    "drives": {"position": _CONTROL, "velocity": _CONTROL, "motor": _CONTROL, "universal": _CONTROL, "ball": BALL_DRIVE},
    "modes": {
        **URDF["modes"], "gravity": Omitted(": not supported by URDF"),
        "poses": Supported(None, "written as group states in the SRDF file"),
        "exclude": Supported(None, "written as disabled collisions in the SRDF file"),
    },
}

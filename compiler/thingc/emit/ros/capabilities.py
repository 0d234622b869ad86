"""What a ROS 2 package can say of a robot: what URDF can, and what stands beside it there."""

from __future__ import annotations

from thingc.emit.capabilities import Capabilities, Says
from thingc.emit.urdf.capabilities import CAPABILITIES as URDF

_CONTROL = Says("ros2_control")

CAPABILITIES: Capabilities = {
    **URDF,
    "drives": {"position": _CONTROL, "velocity": _CONTROL, "motor": _CONTROL, "universal": _CONTROL, "ball": URDF["drives"]["ball"]},
    "modes": {**URDF["modes"], "poses": Says("group states of the SRDF"), "exclude": Says("disabled collisions of the SRDF")},
}

"""What SDFormat can say of a robot."""

from __future__ import annotations

from typing import Literal

from thingc.targets.capabilities import OMITTED, SAYS, Capabilities, Loses, Omits, Says, all_sensors

JointForm = Literal["each", "universal", "ball"]
"""How a joint is written: one of SDF's for each coordinate, one with two axes, or one without any."""

DriveForm = Literal["position controller", "velocity controller", "force"]
"""Which system of Gazebo's drives a joint."""

LoopForm = Literal["joint"]

SensorForm = Literal["imu", "force_torque", "camera", "magnetometer", "gpu_lidar", "contact"]
"""The type of a sensor."""

_EACH: Says[JointForm] = Says("each")
_CHAIN: Loses[JointForm] = Loses("each", "approximated", " as one joint's: its coordinates are joints here, with links of 1e-9 kg between")
_LOOP: Says[LoopForm] = Says("joint", "a joint, in models whose zero is a pose that closes it")
_PLUGIN = ", which Gazebo alone reads"
_LIGHT = Loses(None, "approximated", ": a link weighs 1e-9 kg here")
_SMALL = Loses(None, "approximated", ": its moments of inertia are 1e-12 kg m^2 here")

CAPABILITIES: Capabilities[JointForm, DriveForm, LoopForm, None, SensorForm] = {
    "joints": {
        "revolute": _EACH, "continuous": _EACH, "prismatic": _EACH, "cylindrical": _CHAIN, "universal": Says("universal"),
        "planar": _CHAIN, "screw": _EACH, "ball": Says("ball"),
    },
    "of_joints": {
        "cone": OMITTED, "velocity": SAYS, "damping": SAYS, "friction": SAYS, "armature": OMITTED, "stiffness": SAYS,
        "mimic": Says(None, "from SDFormat 1.11 on"),
        "polynomial": Loses(None, "approximated", ": straight, as it is near q = 0 of that one"), "tendon": OMITTED,
    },
    "drives": {
        "position": Loses("position controller", "carried as custom data", _PLUGIN),
        "velocity": Loses("velocity controller", "carried as custom data", _PLUGIN),
        "motor": Loses("force", "carried as custom data", _PLUGIN), "universal": OMITTED, "ball": OMITTED,
    },
    "loops": {
        "hold": Says("joint", "a fixed joint to the world"), "weld": _LOOP, "ball": _LOOP, "hinge": _LOOP, "slide": _LOOP, "screw": _LOOP,
        "universal": _LOOP, "several": _LOOP,
    },
    "bases": {
        "held": Loses(None, "approximated", ": it is fixed here"), "free": SAYS, "start": SAYS,
        "planar": Loses(None, _CHAIN.how, _CHAIN.words), "ball": SAYS,
    },
    "modes": {
        "gravity": Loses(None, "carried as custom data", ", which stands in the file of the world alone"),
        "poses": Omits(": SDF has none"), "exclude": OMITTED, "timestep": Says(None, "in the world"), "simulation": OMITTED,
    },
    "links": {
        "frames": Says(None, "`<frame>`"), "colours": SAYS, "friction": SAYS, "rolling": OMITTED, "adhesion": OMITTED, "weightless": _LIGHT,
        "weightless_base": _LIGHT, "point": _SMALL, "line": _SMALL,
    },
    "shapes": {
        "box": SAYS, "cylinder": SAYS, "capsule": SAYS, "sphere": SAYS, "ellipsoid": SAYS, "plane": SAYS, "hull": SAYS, "mesh": SAYS,
    },
    "sensors": {
        **all_sensors(OMITTED),
        "imu": Says("imu"), "force": Says("force_torque"), "joint": Omits(": SDF has none of a joint's state"), "camera": Says("camera"),
        "accelerometer": Says("imu", "an `imu`"), "gyro": Says("imu", "an `imu`"), "magnetometer": Says("magnetometer"),
        "rangefinder": Says("gpu_lidar", "a `gpu_lidar` of one ray"), "contact": Says("contact"),
    },
    "of_sensors": {"noise": OMITTED, "cutoff": OMITTED},
}

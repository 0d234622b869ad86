"""The features of a robot that SDFormat can express."""

from __future__ import annotations

from typing import Literal

from thingc.targets.capabilities import FULL, OMITTED, Capabilities, Lossy, Omitted, Supported, all_of

JointForm = Literal["each", "universal", "ball", "free"]
"""How a joint is written: as one SDF joint for each coordinate, as an SDF joint with two axes, or as an SDF joint without axes."""

DriveForm = Literal["position controller", "velocity controller", "force"]
"""The Gazebo system that drives a joint."""

SensorForm = Literal["imu", "force_torque", "camera", "magnetometer", "gpu_lidar", "contact"]
"""The type of a sensor in SDF."""

_EACH: Supported[JointForm] = Supported("each")
_CHAIN: Lossy[JointForm] = Lossy("each", "approximated", ": a joint for each coordinate, with links of 1e-9 kg between the joints")
_LOOP: Supported[None] = Supported(None, "written as a joint; the loop is closed if all joints of the model are at 0")
_PLUGIN = ": only read by Gazebo"
_LIGHT = Lossy(None, "approximated", ": the link has a mass of 1e-9 kg in the file")
_SMALL = Lossy(None, "approximated", ": the moments of inertia are 1e-12 kg m^2 in the file")

CAPABILITIES: Capabilities[JointForm, DriveForm, None, None, SensorForm] = {
    "joints": {
        "single": _EACH, "several": _CHAIN, "universal": Supported("universal"), "screw": _EACH, "ball": Supported("ball"),
        "free": Supported("free", "written as a link without a joint"),
    },
    "of_joints": {
        "cone": OMITTED, "velocity": FULL, "damping": FULL, "friction": FULL, "armature": OMITTED, "stiffness": FULL,
        "mimic": Supported(None, "requires SDFormat 1.11 or later"),
        "polynomial": Lossy(None, "approximated", ": linearized at position 0 of the followed joint"), "tendon": OMITTED,
        "differential": OMITTED, "backlash": OMITTED, "delay": OMITTED, "effects": OMITTED,
    },
    "drives": {
        "position": Lossy("position controller", "carried as custom data", _PLUGIN),
        "velocity": Lossy("velocity controller", "carried as custom data", _PLUGIN),
        "motor": Lossy("force", "carried as custom data", _PLUGIN), "universal": OMITTED, "ball": OMITTED,
    },
    "loops": {**all_of("loops", _LOOP), "hold": Supported(None, "written as a fixed joint to the world")},
    "bases": {
        "held": Lossy(None, "approximated", ": the base is fixed in the file"), "free": FULL, "start": FULL,
        "planar": Lossy(None, _CHAIN.how, _CHAIN.words), "ball": FULL,
    },
    "modes": {
        "gravity": Lossy(None, "carried as custom data", ": only written to the world file"),
        "poses": Omitted(": not supported by SDF"), "exclude": OMITTED, "pairs": OMITTED, "groups": OMITTED,
        "timestep": Supported(None, "written only to the world file"), "simulation": OMITTED,
    },
    "links": {
        "frames": Supported(None, "`<frame>`"), "colours": FULL, "friction": FULL, "rolling": OMITTED, "adhesion": OMITTED,
        "weightless": _LIGHT, "weightless_base": _LIGHT, "point": _SMALL, "line": _SMALL,
    },
    "shapes": {
        "box": FULL, "cylinder": FULL, "capsule": FULL, "sphere": FULL, "ellipsoid": FULL, "plane": FULL, "hull": FULL, "mesh": FULL,
    },
    "sensors": {
        **all_of("sensors", OMITTED),
        "imu": Supported("imu"), "force": Supported("force_torque"), "camera": Supported("camera"),
        "joint": Omitted(": SDF has no joint sensor"),
        "accelerometer": Supported("imu", "an `imu`"), "gyro": Supported("imu", "an `imu`"), "magnetometer": Supported("magnetometer"),
        "rangefinder": Supported("gpu_lidar", "written as a `gpu_lidar` with one ray"), "contact": Supported("contact"),
    },
    "of_sensors": all_of("of_sensors", OMITTED),
}

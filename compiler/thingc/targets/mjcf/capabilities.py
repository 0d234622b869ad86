"""The features of a robot that MJCF and MuJoCo can express."""

from __future__ import annotations

from typing import Literal

from thingc.targets.capabilities import SAYS, Capabilities, Lossy, Omitted, Supported, all_of

JointForm = Literal["each", "threaded", "ball", "free"]
"""How a joint is written: as a hinge or a slide for each coordinate, as a coupled hinge and slide, as a ball, or as a free joint."""

DriveForm = Literal["joint", "ball"]
"""The element that an actuator drives. The element is either a joint, or a ball joint about one axis."""

LoopForm = Literal["weld", "connect", "two connects", "connect and tendon", "weld or connect"]
"""The equality constraints that close a loop."""

SensorForm = Literal["elements", "camera"]
"""How a sensor is written: as an element for each of its readings, or as a camera."""

_EACH: Supported[JointForm] = Supported("each")
_EACH_OF_SEVERAL: Supported[JointForm] = Supported("each", "hinges and slides of one body")
_ELEMENTS: Supported[SensorForm] = Supported("elements")
_DRIVES: Supported[DriveForm] = Supported("joint")
_CUSTOM = Lossy[None](None, "carried as custom data")

CAPABILITIES: Capabilities[JointForm, DriveForm, LoopForm, None, SensorForm] = {
    "joints": {
        "single": _EACH, "several": _EACH_OF_SEVERAL, "universal": _EACH_OF_SEVERAL, "ball": Supported("ball"),
        "free": Supported("free", "a `freejoint` of a body in the world"),
        "screw": Lossy(
            "threaded", "approximated", ": a hinge and a slide in MuJoCo, coupled by an equality, which is slightly soft",
        ),
    },
    "of_joints": {
        "cone": SAYS, "velocity": _CUSTOM, "damping": SAYS, "friction": SAYS, "armature": SAYS,
        "stiffness": SAYS, "mimic": Supported(None, "an equality"), "polynomial": SAYS, "tendon": SAYS,
        "differential": Supported(None, "fixed tendons"), "backlash": _CUSTOM, "delay": SAYS, "effects": _CUSTOM,
    },
    "drives": {"position": _DRIVES, "velocity": _DRIVES, "motor": _DRIVES, "universal": _DRIVES, "ball": Supported("ball")},
    "loops": {
        "hold": Supported("weld or connect", "`weld` or `connect`"), "weld": Supported("weld"), "ball": Supported("connect", "`connect`"),
        "hinge": Supported("two connects", "two `connect`"),
        "slide": Omitted(": MuJoCo has no equality for slides"),
        "screw": Omitted(": MuJoCo has no equality for screws"),
        "universal": Supported("connect and tendon", "`connect`, and a tendon of constant length"),
        "several": Omitted(": MuJoCo has no equality for joints with several coordinates"),
    },
    "bases": {"held": Supported(None, "a mocap body"), "free": SAYS, "start": SAYS, "planar": SAYS, "ball": SAYS},
    "modes": {
        "gravity": SAYS, "poses": Supported(None, "keyframes"), "exclude": SAYS, "pairs": SAYS, "groups": SAYS, "timestep": SAYS,
        "simulation": SAYS,
    },
    "links": {
        "frames": Supported(None, "sites"), "colours": SAYS, "friction": SAYS, "rolling": SAYS, "adhesion": Supported(None, "an actuator"),
        "weightless": Supported(None, "several joints on one body"),
        "weightless_base": SAYS, "point": SAYS, "line": Lossy(None, "approximated", ": the inertia is 0 in the file, as for a point mass"),
    },
    "shapes": {
        "box": SAYS, "cylinder": SAYS, "capsule": SAYS, "sphere": SAYS, "ellipsoid": SAYS, "plane": SAYS, "hull": SAYS,
        "mesh": Lossy(None, "approximated", ": MuJoCo uses the convex hull of a mesh"),
    },
    "sensors": {**all_of("sensors", _ELEMENTS), "camera": Supported("camera")},
    "of_sensors": {"noise": SAYS, "cutoff": SAYS},
}

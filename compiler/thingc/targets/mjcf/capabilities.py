"""The features of a robot that MJCF and MuJoCo can express."""

from __future__ import annotations

from typing import Literal

from thingc.targets.capabilities import FULL, Capabilities, Lossy, Omitted, Supported, all_of

JointForm = Literal["each", "threaded", "ball", "free"]
"""How a joint is written: as a hinge or a slide for each coordinate, as a coupled hinge and slide, as a ball, or as a free joint."""

LoopForm = Literal["weld", "connect", "two connects", "connect and tendon", "weld or connect"]
"""The equality constraints that close a loop."""

_EACH: Supported[JointForm] = Supported("each")
_EACH_OF_SEVERAL: Supported[JointForm] = Supported("each", "written as several hinges and slides of one body")
_CUSTOM = Lossy[None](None, "carried as custom data")

CAPABILITIES: Capabilities[JointForm, None, LoopForm, None, None] = {
    "joints": {
        "single": _EACH, "several": _EACH_OF_SEVERAL, "universal": _EACH_OF_SEVERAL, "ball": Supported("ball"),
        "free": Supported("free", "written as a `freejoint` of a child body of the world"),
        "screw": Lossy(
            "threaded", "approximated", ": a hinge and a slide, coupled by a slightly soft equality",
        ),
    },
    "of_joints": {
        "cone": FULL, "velocity": _CUSTOM, "damping": FULL, "friction": FULL, "armature": FULL,
        "stiffness": FULL, "mimic": Supported(None, "an equality"), "polynomial": FULL, "tendon": FULL,
        "differential": Supported(None, "fixed tendons"), "backlash": _CUSTOM, "delay": FULL, "effects": _CUSTOM,
    },
    "drives": {"position": FULL, "velocity": FULL, "motor": FULL, "universal": FULL, "ball": FULL},
    "loops": {
        "hold": Supported("weld or connect", "written as `weld` or `connect`"), "weld": Supported("weld"),
        "ball": Supported("connect", "`connect`"), "hinge": Supported("two connects", "two `connect`"),
        "slide": Omitted(": MuJoCo has no equality for slides"),
        "screw": Omitted(": MuJoCo has no equality for screws"),
        "universal": Supported("connect and tendon", "written as `connect` and a tendon of constant length"),
        "several": Omitted(": MuJoCo has no equality for joints with several coordinates"),
    },
    "bases": {"held": Supported(None, "written as a mocap body"), "free": FULL, "start": FULL, "planar": FULL, "ball": FULL},
    "modes": {
        "gravity": FULL, "poses": Supported(None, "keyframes"), "exclude": FULL, "pairs": FULL, "groups": FULL, "timestep": FULL,
        "simulation": FULL,
    },
    "links": {
        "frames": Supported(None, "sites"), "colours": FULL, "friction": FULL, "rolling": FULL, "adhesion": Supported(None, "an actuator"),
        "weightless": Supported(None, "joints on both sides of the link are joints of one body"),
        "weightless_base": FULL, "point": FULL, "line": Lossy(None, "approximated", ": the inertia is 0 in the file, as for a point mass"),
    },
    "shapes": {
        "box": FULL, "cylinder": FULL, "capsule": FULL, "sphere": FULL, "ellipsoid": FULL, "plane": FULL, "hull": FULL,
        "mesh": Lossy(None, "approximated", ": MuJoCo uses the convex hull of a mesh"),
    },
    "sensors": all_of("sensors", FULL),
    "of_sensors": {"noise": FULL, "cutoff": FULL},
}

"""The features of a robot that MJCF and MuJoCo can express."""

from __future__ import annotations

from typing import Literal

from thingc.targets.capabilities import SAYS, Capabilities, Lossy, Omitted, Supported, all_of

JointForm = Literal["each", "threaded", "ball", "free"]
"""How a joint is written: as a hinge or a slide for each coordinate, as a coupled hinge and slide, as a ball, or as a free joint."""

LoopForm = Literal["weld", "connect", "two connects", "connect and tendon", "weld or connect"]
"""The equality constraints that close a loop."""

_EACH: Supported[JointForm] = Supported("each")
_EACH_OF_SEVERAL: Supported[JointForm] = Supported("each", "hinges and slides of one body")
_CUSTOM = Lossy[None](None, "carried as custom data")

CAPABILITIES: Capabilities[JointForm, None, LoopForm, None, None] = {
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
    "drives": {"position": SAYS, "velocity": SAYS, "motor": SAYS, "universal": SAYS, "ball": SAYS},
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
    "sensors": all_of("sensors", SAYS),
    "of_sensors": {"noise": SAYS, "cutoff": SAYS},
}

"""The features of a robot that URDF 1.0 can express."""

from __future__ import annotations

from typing import Literal, Never

from thingc.targets.capabilities import COMPANION, FULL, OMITTED, Capabilities, Lossy, Omitted, Supported, all_of

JointForm = Literal["each", "threaded", "floating"]
"""How a joint is written. A coordinate becomes a rotation or a slide, and a screw becomes a rotation and a slide that mimics the
rotation.
"""

ShapeForm = Literal["itself", "cylinder and balls"]

_EACH: Supported[JointForm] = Supported("each")
_CHAIN: Lossy[JointForm] = Lossy("each", "approximated", ": a joint for each coordinate, with links of 1e-9 kg between the joints")
_BALL: Lossy[JointForm] = Lossy("each", "approximated", ": three hinges in series, with different coordinates")
_LOOP = Omitted(": URDF supports only trees")
_GAINS = Lossy(None, "approximated", ": a transmission without gains")
_NONE = Omitted(": not supported by URDF")
_ITSELF: Supported[ShapeForm] = Supported("itself")
BALL_DRIVE = Omitted(": no joint in the file has this axis")

CAPABILITIES: Capabilities[JointForm, None, Never, ShapeForm, Never] = {
    "joints": {
        "single": _EACH, "several": _CHAIN, "universal": _CHAIN,
        "screw": Lossy("threaded", "approximated", ": a prismatic joint that mimics the rotation"),
        "ball": _BALL, "free": Supported("floating", "written as a `floating` joint"),
    },
    "of_joints": {
        "cone": OMITTED, "velocity": FULL, "damping": FULL, "friction": FULL, "armature": OMITTED, "stiffness": OMITTED, "mimic": FULL,
        "polynomial": Lossy(None, "approximated", ": linearized at position 0 of the followed joint"), "tendon": OMITTED,
        "differential": Supported(None, "`<transmission>`"), "backlash": OMITTED,
        "delay": OMITTED, "effects": OMITTED,
    },
    "drives": {
        "position": _GAINS, "velocity": _GAINS, "motor": Supported(None, "`<transmission>`"), "universal": _GAINS,
        "ball": BALL_DRIVE,
    },
    "loops": {**all_of("loops", _LOOP), "hold": OMITTED},
    "bases": {
        "held": Lossy(None, "approximated", ": the base is fixed in the file"),
        "free": Supported(None, "the file has no link `world`, and `<static>` is false"),
        "start": Omitted(": set by the program that loads the file"), "planar": Lossy(None, _CHAIN.how, _CHAIN.words),
        "ball": Lossy(None, _BALL.how, _BALL.words),
    },
    "modes": {
        "gravity": Lossy(None, "carried as custom data", ": only read by MuJoCo"), "poses": _NONE, "exclude": OMITTED,
        "pairs": OMITTED, "groups": OMITTED, "timestep": OMITTED, "simulation": OMITTED,
    },
    "links": {
        "frames": Supported(None, "massless links"), "colours": FULL, "friction": OMITTED, "rolling": OMITTED, "adhesion": OMITTED,
        "weightless": Lossy(None, "approximated", ": a moving link has a mass of 1e-9 kg in the file"), "weightless_base": FULL,
        "point": FULL, "line": Lossy(None, "approximated", ": the inertia is 0 in the file, as for a point mass"),
    },
    "shapes": {
        **all_of("shapes", _ITSELF), "capsule": Supported("cylinder and balls", "written as a cylinder between two spheres"),
        "ellipsoid": _NONE, "plane": _NONE,
    },
    "sensors": all_of("sensors", _NONE),
    "of_sensors": all_of("of_sensors", COMPANION),
}

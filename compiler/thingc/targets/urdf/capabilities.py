"""What URDF 1.0 can express of a robot."""

from __future__ import annotations

from typing import Literal, Never

from thingc.targets.capabilities import BESIDE, OMITTED, SAYS, Capabilities, Lossy, Omitted, Supported, all_sensors

JointForm = Literal["each", "threaded"]
"""How a joint is written: a rotation or a slide for each coordinate, or a rotation and a slide that mimics it."""

DriveForm = Literal["transmission"]

ShapeForm = Literal["itself", "cylinder and balls"]

_EACH: Supported[JointForm] = Supported("each")
_CHAIN: Lossy[JointForm] = Lossy("each", "approximated", " as one joint's: its coordinates are joints here, with links of 1e-9 kg between")
_BALL: Lossy[JointForm] = Lossy(
    "each", "approximated", " as a ball's: three turns here, one after the other, whose angles are no coordinates of it",
)
_LOOP = Omitted(", which stays open here: URDF has trees alone")
_GAINS: Lossy[DriveForm] = Lossy("transmission", "approximated", ": a transmission without gains")
_NONE = Omitted(": URDF has none")
_ITSELF: Supported[ShapeForm] = Supported("itself")
BALL_DRIVE = Omitted(": its axis is none of a joint's here")

CAPABILITIES: Capabilities[JointForm, DriveForm, Never, ShapeForm, Never] = {
    "joints": {
        "single": _EACH, "several": _CHAIN, "universal": _CHAIN,
        "screw": Lossy("threaded", "approximated", ": a slide mimics the turn, and readers without mimics leave it loose"), "ball": _BALL,
    },
    "of_joints": {
        "cone": OMITTED, "velocity": SAYS, "damping": SAYS, "friction": SAYS, "armature": OMITTED, "stiffness": OMITTED, "mimic": SAYS,
        "polynomial": Lossy(None, "approximated", ": straight, as it is near q = 0 of that one"), "tendon": OMITTED,
    },
    "drives": {
        "position": _GAINS, "velocity": _GAINS, "motor": Supported("transmission", "`<transmission>`"), "universal": _GAINS,
        "ball": BALL_DRIVE,
    },
    "loops": {
        "hold": OMITTED, "weld": _LOOP, "ball": _LOOP, "hinge": _LOOP, "slide": _LOOP, "screw": _LOOP,
        "universal": _LOOP, "several": _LOOP,
    },
    "bases": {
        "held": Lossy(None, "approximated", ": it is fixed here"), "free": Supported(None, "no link `world`, `<static>` false"),
        "start": Omitted(": a free base begins wherever a reader puts it"), "planar": Lossy(None, _CHAIN.how, _CHAIN.words),
        "ball": Lossy(None, _BALL.how, _BALL.words),
    },
    "modes": {
        "gravity": Lossy(None, "carried as custom data", ", which MuJoCo alone reads"), "poses": _NONE, "exclude": OMITTED,
        "timestep": OMITTED, "simulation": OMITTED,
    },
    "links": {
        "frames": Supported(None, "massless links"), "colours": SAYS, "friction": OMITTED, "rolling": OMITTED, "adhesion": OMITTED,
        "weightless": Lossy(None, "approximated", ": what moves weighs 1e-9 kg here"), "weightless_base": SAYS,
        "point": SAYS, "line": Lossy(None, "approximated", ": it has none here, as a point"),
    },
    "shapes": {
        "box": _ITSELF, "cylinder": _ITSELF, "capsule": Supported("cylinder and balls", "a cylinder between two balls"), "sphere": _ITSELF,
        "ellipsoid": Omitted(": URDF has none"), "plane": Omitted(": URDF has none"), "hull": _ITSELF, "mesh": _ITSELF,
    },
    "sensors": all_sensors(_NONE),
    "of_sensors": {"noise": BESIDE, "cutoff": BESIDE},
}

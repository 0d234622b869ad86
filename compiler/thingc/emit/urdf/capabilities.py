"""What URDF 1.0 can say of a robot."""

from __future__ import annotations

from thingc.emit.capabilities import OMITTED, SAYS, Capabilities, Loses, Says

_CHAIN = Loses("approximated", " as one joint's: its coordinates are joints here, with links of 1e-9 kg between")
_BALL = Loses("approximated", " as a ball's: three turns here, one after the other, whose angles are no coordinates of it")
_LOOP = Loses("omitted", ", which stays open here: URDF has trees alone")
_GAINS = Loses("approximated", ": a transmission without gains")
_NONE = Loses("omitted", ": URDF has none")

CAPABILITIES: Capabilities = {
    "joints": {
        "revolute": SAYS, "continuous": SAYS, "prismatic": SAYS, "cylindrical": _CHAIN, "universal": _CHAIN, "planar": _CHAIN,
        "screw": Loses("approximated", ": a slide mimics the turn, and readers without mimics leave it loose"), "ball": _BALL,
    },
    "of_joints": {
        "cone": OMITTED, "velocity": SAYS, "damping": SAYS, "friction": SAYS, "armature": OMITTED, "stiffness": OMITTED, "mimic": SAYS,
    },
    "drives": {
        "position": _GAINS, "velocity": _GAINS, "motor": Says("`<transmission>`"), "universal": _GAINS,
        "ball": Loses("omitted", ": its axis is none of a joint's here"),
    },
    "loops": {
        "hold": OMITTED, "weld": _LOOP, "ball": _LOOP, "hinge": _LOOP, "slide": _LOOP, "screw": _LOOP, "several": _LOOP,
    },
    "bases": {
        "held": Loses("approximated", ": it is fixed here"), "free": Says("no link `world`"),
        "start": Loses("omitted", ": a free base begins wherever a reader puts it"), "planar": _CHAIN, "ball": _BALL,
    },
    "modes": {
        "gravity": Loses("carried as custom data", ", which MuJoCo alone reads"), "poses": _NONE, "exclude": OMITTED, "timestep": OMITTED,
        "simulation": OMITTED,
    },
    "links": {
        "frames": Says("massless links"), "colours": SAYS, "friction": OMITTED, "rolling": OMITTED, "adhesion": OMITTED,
        "weightless": Loses("approximated", ": what moves weighs 1e-9 kg here"), "weightless_base": SAYS,
        "point": SAYS, "line": Loses("approximated", ": it has none here, as a point"),
    },
    "shapes": {
        "box": SAYS, "cylinder": SAYS, "capsule": Says("a cylinder between two balls"), "sphere": SAYS, "hull": SAYS, "mesh": SAYS,
    },
    "sensors": {"imu": _NONE, "force": _NONE, "joint": _NONE, "camera": _NONE},
}

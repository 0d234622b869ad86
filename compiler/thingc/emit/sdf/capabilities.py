"""What SDFormat can say of a robot."""

from __future__ import annotations

from thingc.emit.capabilities import OMITTED, SAYS, Capabilities, Loses, Says

_CHAIN = Loses("approximated", " as one joint's: its coordinates are joints here, with links of 1e-9 kg between")
_LOOP = Says("a joint, in models whose zero is a pose that closes it")
_PLUGIN = Loses("carried as custom data", ", which Gazebo alone reads")
_LIGHT = Loses("approximated", ": a link weighs 1e-9 kg here")
_SMALL = Loses("approximated", ": its moments of inertia are 1e-12 kg m^2 here")

CAPABILITIES: Capabilities = {
    "joints": {
        "revolute": SAYS, "continuous": SAYS, "prismatic": SAYS, "cylindrical": _CHAIN, "universal": SAYS, "planar": _CHAIN, "screw": SAYS,
        "ball": SAYS,
    },
    "of_joints": {
        "cone": OMITTED, "velocity": SAYS, "damping": SAYS, "friction": SAYS, "armature": OMITTED, "stiffness": SAYS,
        "mimic": Says("from SDFormat 1.11 on"),
    },
    "drives": {"position": _PLUGIN, "velocity": _PLUGIN, "motor": _PLUGIN, "universal": OMITTED, "ball": OMITTED},
    "loops": {
        "hold": Says("a fixed joint to the world"), "weld": _LOOP, "ball": _LOOP, "hinge": _LOOP, "slide": _LOOP, "screw": _LOOP,
        "several": _LOOP,
    },
    "bases": {
        "held": Loses("approximated", ": it is fixed here"), "free": SAYS, "start": SAYS, "planar": _CHAIN, "ball": SAYS,
    },
    "modes": {
        "gravity": Loses("carried as custom data", ", which stands in the file of the world alone"),
        "poses": Loses("omitted", ": SDF has none"), "exclude": OMITTED, "timestep": Says("in the world"), "simulation": OMITTED,
    },
    "links": {
        "frames": Says("`<frame>`"), "colours": SAYS, "friction": SAYS, "rolling": OMITTED, "adhesion": OMITTED, "weightless": _LIGHT,
        "weightless_base": _LIGHT, "point": _SMALL, "line": _SMALL,
    },
    "shapes": {"box": SAYS, "cylinder": SAYS, "capsule": SAYS, "sphere": SAYS, "hull": SAYS, "mesh": SAYS},
    "sensors": {"imu": SAYS, "force": SAYS, "joint": Loses("omitted", ": SDF has none of a joint's state"), "camera": SAYS},
}

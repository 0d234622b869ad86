"""What MJCF can say of a robot, and MuJoCo does."""

from __future__ import annotations

from thingc.emit.capabilities import SAYS, Capabilities, Loses, Says

_SLIDES = "hinges and slides of one body"

CAPABILITIES: Capabilities = {
    "joints": {
        "revolute": SAYS, "continuous": SAYS, "prismatic": SAYS, "cylindrical": Says(_SLIDES), "universal": Says(_SLIDES),
        "planar": Says(_SLIDES), "ball": SAYS,
        "screw": Loses("approximated", ": MuJoCo turns and slides it, and ties the two by an equality, which gives way by a little"),
    },
    "of_joints": {
        "cone": SAYS, "velocity": Loses("carried as custom data"), "damping": SAYS, "friction": SAYS, "armature": SAYS, "stiffness": SAYS,
        "mimic": Says("an equality"),
    },
    "drives": {"position": SAYS, "velocity": SAYS, "motor": SAYS, "universal": SAYS, "ball": SAYS},
    "loops": {
        "hold": Says("`weld` or `connect`"), "weld": SAYS, "ball": Says("`connect`"), "hinge": Says("two `connect`"),
        "slide": Loses("omitted", ": MuJoCo has no equality that slides"),
        "screw": Loses("omitted", ": MuJoCo has no equality that screws"),
        "several": Loses("omitted", ": MuJoCo has no equality that moves in several coordinates"),
    },
    "bases": {"held": Says("a mocap body"), "free": SAYS, "start": SAYS, "planar": SAYS, "ball": SAYS},
    "modes": {"gravity": SAYS, "poses": Says("keyframes"), "exclude": SAYS, "timestep": SAYS, "simulation": SAYS},
    "links": {
        "frames": Says("sites"), "colours": SAYS, "friction": SAYS, "rolling": SAYS, "adhesion": Says("an actuator"), "weightless": SAYS,
        "weightless_base": SAYS, "point": SAYS, "line": Loses("approximated", ": it has none here, as a point"),
    },
    "shapes": {
        "box": SAYS, "cylinder": SAYS, "capsule": SAYS, "sphere": SAYS, "hull": SAYS,
        "mesh": Loses("approximated", ": MuJoCo touches the convex hull of a mesh"),
    },
    "sensors": {"imu": SAYS, "force": SAYS, "joint": SAYS, "camera": SAYS},
}

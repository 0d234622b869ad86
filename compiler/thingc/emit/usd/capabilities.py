"""What USD can say of a robot, by UsdPhysics and, for who reads them, Newton's and PhysX's schemas."""

from __future__ import annotations

from thingc.emit.capabilities import OMITTED, SAYS, Capabilities, Loses, Says

_GENERIC = Says("a generic joint (D6)")
_EXCLUDED = Says("a joint that is excluded from the articulation")
_CUSTOM = Loses("carried as custom data", ", which Newton and, but of balls, PhysX read, and of no generic joint")
_LIGHT = Loses("approximated", ": a link weighs 1e-9 kg here")
_SMALL = Loses("approximated", ": its moments of inertia are 1e-12 kg m^2 here")
_NONE = Loses("omitted", ": UsdPhysics has none")

CAPABILITIES: Capabilities = {
    "joints": {
        "revolute": SAYS, "continuous": SAYS, "prismatic": SAYS, "cylindrical": _GENERIC, "planar": _GENERIC, "ball": SAYS,
        "universal": Loses("approximated", ": X turns first and then Y, which is Newton's order, and UsdPhysics has none"),
        "screw": Loses("approximated", ": it turns and slides, each by itself"),
    },
    "of_joints": {
        "cone": Loses("approximated", ": here it bounds how far an axis leans, not how far the ball turns about it"),
        "velocity": _CUSTOM, "damping": _CUSTOM, "friction": _CUSTOM, "armature": _CUSTOM, "stiffness": OMITTED,
        "mimic": Loses("carried as custom data", ", which Newton and, of turns with limits, PhysX read, where both turn or both slide"),
    },
    "drives": {"position": SAYS, "velocity": SAYS, "motor": SAYS, "universal": SAYS, "ball": OMITTED},
    "loops": {
        "hold": _EXCLUDED, "weld": _EXCLUDED, "ball": _EXCLUDED, "hinge": _EXCLUDED, "slide": _EXCLUDED,
        "screw": Loses("approximated", ", which turns and slides there, each by itself"), "several": _EXCLUDED,
    },
    "bases": {"held": Loses("approximated", ": it is fixed here"), "free": SAYS, "start": SAYS, "planar": _GENERIC, "ball": SAYS},
    "modes": {"gravity": SAYS, "poses": _NONE, "exclude": Says("filtered pairs"), "timestep": OMITTED, "simulation": OMITTED},
    "links": {
        "frames": Says("`Xform`"), "colours": SAYS, "friction": SAYS,
        "rolling": Loses("carried as custom data", ", which Newton alone reads"), "adhesion": OMITTED, "weightless": _LIGHT,
        "weightless_base": _LIGHT, "point": _SMALL, "line": _SMALL,
    },
    "shapes": {
        "box": SAYS, "cylinder": SAYS, "capsule": SAYS, "sphere": SAYS, "hull": SAYS,
        "mesh": Loses("approximated", ": its convex hull touches"),
    },
    "sensors": {"imu": _NONE, "force": _NONE, "joint": _NONE, "camera": _NONE},
}

"""What MJCF can say of a robot, and MuJoCo does."""

from __future__ import annotations

from typing import Literal

from thingc.targets.capabilities import SAYS, Capabilities, Loses, Omits, Says, all_sensors

JointForm = Literal["each", "threaded", "ball"]
"""How a joint is written: a hinge or a slide for each coordinate, a hinge and a slide that are tied together, or a ball."""

DriveForm = Literal["joint", "ball"]
"""What an actuator drives: a joint, or a ball about an axis."""

LoopForm = Literal["weld", "connect", "two connects", "connect and tendon", "weld or connect"]
"""By which equalities a loop is closed."""

SensorForm = Literal["elements", "camera"]
"""How a sensor is written: an element for each of its readings, or a camera."""

_EACH: Says[JointForm] = Says("each")
_EACH_OF_SEVERAL: Says[JointForm] = Says("each", "hinges and slides of one body")
_ELEMENTS: Says[SensorForm] = Says("elements")
_DRIVES: Says[DriveForm] = Says("joint")

CAPABILITIES: Capabilities[JointForm, DriveForm, LoopForm, None, SensorForm] = {
    "joints": {
        "revolute": _EACH, "continuous": _EACH, "prismatic": _EACH, "cylindrical": _EACH_OF_SEVERAL, "universal": _EACH_OF_SEVERAL,
        "planar": _EACH_OF_SEVERAL, "ball": Says("ball"),
        "screw": Loses(
            "threaded", "approximated", ": MuJoCo turns and slides it, and ties the two by an equality, which gives way by a little",
        ),
    },
    "of_joints": {
        "cone": SAYS, "velocity": Loses(None, "carried as custom data"), "damping": SAYS, "friction": SAYS, "armature": SAYS,
        "stiffness": SAYS, "mimic": Says(None, "an equality"), "polynomial": SAYS, "tendon": SAYS,
    },
    "drives": {"position": _DRIVES, "velocity": _DRIVES, "motor": _DRIVES, "universal": _DRIVES, "ball": Says("ball")},
    "loops": {
        "hold": Says("weld or connect", "`weld` or `connect`"), "weld": Says("weld"), "ball": Says("connect", "`connect`"),
        "hinge": Says("two connects", "two `connect`"),
        "slide": Omits(": MuJoCo has no equality that slides"),
        "screw": Omits(": MuJoCo has no equality that screws"),
        "universal": Says("connect and tendon", "`connect`, and a tendon of constant length"),
        "several": Omits(": MuJoCo has no equality that moves in several coordinates"),
    },
    "bases": {"held": Says(None, "a mocap body"), "free": SAYS, "start": SAYS, "planar": SAYS, "ball": SAYS},
    "modes": {"gravity": SAYS, "poses": Says(None, "keyframes"), "exclude": SAYS, "timestep": SAYS, "simulation": SAYS},
    "links": {
        "frames": Says(None, "sites"), "colours": SAYS, "friction": SAYS, "rolling": SAYS, "adhesion": Says(None, "an actuator"),
        "weightless": Says(None, "several joints on one body"),
        "weightless_base": SAYS, "point": SAYS, "line": Loses(None, "approximated", ": it has none here, as a point"),
    },
    "shapes": {
        "box": SAYS, "cylinder": SAYS, "capsule": SAYS, "sphere": SAYS, "ellipsoid": SAYS, "plane": SAYS, "hull": SAYS,
        "mesh": Loses(None, "approximated", ": MuJoCo touches the convex hull of a mesh"),
    },
    "sensors": {**all_sensors(_ELEMENTS), "camera": Says("camera")},
    "of_sensors": {"noise": SAYS, "cutoff": SAYS},
}

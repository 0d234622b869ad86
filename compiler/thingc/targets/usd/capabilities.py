"""The features of a robot that USD can express, with UsdPhysics and the additional schemas of Newton and PhysX."""

from __future__ import annotations

from typing import Literal, Never

from thingc.targets.capabilities import COMPANION, FULL, OMITTED, Capabilities, Lossy, Omitted, Supported, all_of

JointForm = Literal["single", "generic", "spherical", "free"]
"""How a joint is written: as `PhysicsRevoluteJoint` or `PhysicsPrismaticJoint`, as `PhysicsJoint`, or as `PhysicsSphericalJoint`."""

ShapeForm = Literal["Cube", "Cylinder", "Capsule", "Sphere", "Plane", "Mesh"]
"""The type of the prim that represents a shape."""

_SINGLE: Supported[JointForm] = Supported("single")
_GENERIC: Supported[JointForm] = Supported("generic", "written as a generic joint (D6)")
_EXCLUDED: Supported[None] = Supported(None, "written as a joint that is excluded from the articulation")
_CUSTOM = Lossy(None, "carried as custom data", ": read by Newton and partly by PhysX")
_LIGHT = Lossy(None, "approximated", ": the link has a mass of 1e-9 kg in the file")
_SMALL = Lossy(None, "approximated", ": the moments of inertia are 1e-12 kg m^2 in the file")
_NONE = Omitted(": not supported by UsdPhysics")

CAPABILITIES: Capabilities[JointForm, None, None, ShapeForm, Never] = {
    "joints": {
        "single": _SINGLE, "several": _GENERIC, "ball": Supported("spherical"),
        "free": Supported("free", "written as a rigid body without a joint"),
        "universal": Lossy("generic", "approximated", ": the order of the rotations is not defined by UsdPhysics"),
        "screw": Lossy("generic", "approximated", ": rotation and translation are independent"),
    },
    "of_joints": {
        "cone": Lossy(None, "approximated", ": the rotation about the axis is not limited in the file"),
        "velocity": _CUSTOM, "damping": _CUSTOM, "friction": _CUSTOM, "armature": _CUSTOM, "stiffness": OMITTED,
        "mimic": Lossy(None, "carried as custom data", ": read by Newton and partly by PhysX"),
        "polynomial": Lossy(None, "approximated", ": linearized at position 0 of the followed joint"), "tendon": OMITTED,
        "differential": OMITTED, "backlash": OMITTED, "delay": OMITTED, "effects": OMITTED,
    },
    "drives": {"position": FULL, "velocity": FULL, "motor": FULL, "universal": FULL, "ball": OMITTED},
    "loops": {
        **all_of("loops", _EXCLUDED), "screw": Lossy(None, "approximated", ": rotation and translation are independent"),
    },
    "bases": {
        "held": Lossy(None, "approximated", ": the base is fixed in the file"),
        "free": FULL, "start": FULL, "planar": Supported(None, _GENERIC.how),
        "ball": FULL,
    },
    "modes": {
        "gravity": FULL, "poses": _NONE, "exclude": Supported(None, "filtered pairs"), "pairs": OMITTED, "groups": OMITTED,
        "timestep": OMITTED, "simulation": OMITTED,
    },
    "links": {
        "frames": Supported(None, "`Xform`"), "colours": FULL, "friction": FULL,
        "rolling": Lossy(None, "carried as custom data", ": only read by Newton"), "adhesion": OMITTED, "weightless": _LIGHT,
        "weightless_base": _LIGHT, "point": _SMALL, "line": _SMALL,
    },
    "shapes": {
        "box": Supported("Cube"), "cylinder": Supported("Cylinder"), "capsule": Supported("Capsule"), "sphere": Supported("Sphere"),
        "ellipsoid": Supported("Sphere", "written as a scaled sphere"), "plane": Supported("Plane"), "hull": Supported("Mesh"),
        "mesh": Lossy("Mesh", "approximated", ": the convex hull of the mesh is used"),
    },
    "sensors": all_of("sensors", _NONE),
    "of_sensors": all_of("of_sensors", COMPANION),
}

"""Write limits, drives and other properties of joints in the units of UsdPhysics. Angles are in degrees, and gains are per degree.

Properties that UsdPhysics does not support are written with the schemas of Newton and PhysX (Isaac Sim). Other readers ignore these
schemas. Both schemas only describe joints with one axis. Therefore, PhysX properties are not written for balls, and generic joints use
neither schema.
"""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base import numeric
from thingc.model.robot.types import Robot
from thingc.targets.capabilities import drive_cell, is_written
from thingc.targets.usd.capabilities import CAPABILITIES
from thingc.targets.usd.chain import Freedom, MimicJoint, UsdJoint
from thingc.targets.usd.usda import Prim

LOCKED = (1.0, -1.0)
"""The limits of a motion that is locked. According to UsdPhysics (`PhysicsLimitAPI`), the lower limit of such a motion is larger than the
upper limit.
"""

GENERIC = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")
"""Names of the motions of a generic joint. Each of these motions is either free or locked."""


def ends(freedom: Freedom) -> tuple[float, float]:
    """Return the lower and upper limit of a motion of a USD joint [deg or m]."""
    limit, infinite = freedom.joint.limit, numeric.inf * freedom.ratio
    low = -infinite if limit.lower is None else limit.lower * freedom.ratio
    high = infinite if limit.upper is None else limit.upper * freedom.ratio
    values = sorted((low, high))
    return (numeric.degrees(values[0]), numeric.degrees(values[1])) if freedom.turns else (values[0], values[1])


def limits(joint: UsdJoint, follower: MimicJoint | None) -> tuple[float, float]:
    """Return the lower and upper limit of a joint with one axis [deg or m].

    PhysX requires limits for rotations that mimic another joint. If such a joint has no limits, they are computed from the limits of its
    leader.
    """
    from_document = ends(joint.freedoms[0])
    if follower is None or follower.reach is None or from_document != (-numeric.inf, numeric.inf):
        return from_document
    unit = numeric.degrees(1.0) if follower.turns else 1.0
    return follower.reach[0] * unit, follower.reach[1] * unit


def equip(prim: Prim, joint: UsdJoint, robot: Robot, follower: MimicJoint | None) -> None:
    """Add the limits and drives of a joint to its USD prim. Limits of joints with one axis are written even if infinite."""
    if joint.type == "D6":
        free = {freedom.name: ends(freedom) for freedom in joint.freedoms}
        for name in GENERIC:
            low, high = free.get(name, LOCKED)
            prim.schemas.append(f"PhysicsLimitAPI:{name}")
            prim.fill({f"float limit:{name}:physics:low": low, f"float limit:{name}:physics:high": high})
    elif joint.single is not None:
        low, high = limits(joint, follower)
        prim.fill({"float physics:lowerLimit": low, "float physics:upperLimit": high})
    elif joint.freedoms and joint.freedoms[0].joint.limit.cone is not None:
        cone = numeric.degrees(joint.freedoms[0].joint.limit.cone)
        prim.fill({"float physics:coneAngle0Limit": cone, "float physics:coneAngle1Limit": cone})
    for freedom in joint.freedoms:
        if freedom.joint.path in robot.present and freedom.ratio == 1.0:
            _drive(prim, freedom)


def _drive(prim: Prim, freedom: Freedom) -> None:
    """Add the drive of a motion, with its gains, to the USD prim of a joint.

    A motor is written without gains, because the simulator sets its force. For any other drive, the target is q = 0, or the nearest value
    within the limits.
    """
    drive = freedom.joint.actuator
    if drive is None or not is_written(CAPABILITIES["drives"][drive_cell(freedom.joint, drive)]):
        return
    gain_factor = numeric.pi / 180.0 if freedom.turns else 1.0
    low, high = ends(freedom)
    prim.schemas.append(f"PhysicsDriveAPI:{freedom.name}")
    name = f"drive:{freedom.name}:physics"
    prim.fill({
        f"uniform token {name}:type": '"force"',
        f"float {name}:maxForce": freedom.joint.limit.effort if freedom.joint.limit.effort is not None else drive.effort,
        f"float {name}:stiffness": (drive.kp or 0.0) * gain_factor if drive.kind == "position" else 0.0,
        f"float {name}:damping": (drive.kv or 0.0) * gain_factor if drive.kind != "motor" else 0.0,
        f"float {name}:targetPosition": numeric.minimum(numeric.maximum(0.0, low), high) if drive.kind == "position" else None,
        f"float {name}:targetVelocity": 0.0 if drive.kind == "velocity" else None,
    })


def passive(joint: UsdJoint) -> dict[str, float]:
    """Return the armature, damping, friction and velocity limit of a joint by their names in Newton's schema.

    Newton's schema has only one value for all coordinates of a joint. For a rotation or a ball joint, damping and velocity limit are in
    degrees. Values of zero are omitted.
    """
    if joint.type not in ("Revolute", "Prismatic", "Spherical") or not joint.freedoms:
        return {}
    dynamics, limit = joint.freedoms[0].joint.dynamics, joint.freedoms[0].joint.limit
    degrees = 1.0 if joint.type == "Prismatic" else numeric.degrees(1.0)
    velocity = limit.velocity if joint.single is not None else None
    values = {
        "armature": dynamics.armature, "damping": None if dynamics.damping is None else dynamics.damping / degrees,
        "friction": dynamics.friction, "velocityLimit": None if velocity is None else velocity * degrees,
    }
    return {name: value for name, value in values.items() if value}


PHYSX_NAMES: Mapping[str, tuple[str, ...]] = {
    "armature": ("armature",), "velocityLimit": ("maxJointVelocity",), "friction": ("staticFrictionEffort", "dynamicFrictionEffort"),
    "damping": ("viscousFrictionCoefficient",),
}
"""The attributes of PhysX for each property of a joint."""

PHYSX_JOINT = frozenset({"armature", "maxJointVelocity"})
"""The attributes of PhysX that also exist for a whole joint."""

AXIS = "rotZ"
"""PhysX's name of the coordinate in a mimic constraint, for a rotation about z or a slide along z."""


def articulation(prim: Prim) -> None:
    """Add the PhysX properties of an articulation to its root prim.

    The links of an articulation collide with each other, except for pairs that are filtered.
    """
    prim.schemas.append("PhysxArticulationAPI")
    prim.set("bool physxArticulation:enabledSelfCollisions", "1")


def dynamics(prim: Prim, joint: UsdJoint, *, in_tree: bool) -> None:
    """Add the armature, damping, friction and velocity limit of a joint to its USD prim.

    PhysX supports these properties only for the joints of an articulation. The armature and the velocity limit apply to the whole joint.
    Since Isaac Sim 5, all four properties can also be set for each axis. Values of axes take precedence. The older property `jointFriction`
    of PhysX is not used. `jointFriction` is not a torque, but a factor of the load of the joint.
    """
    values = passive(joint)
    _apply(prim, "NewtonJointAPI", "newton", values)
    if joint.single is None or not in_tree:
        return
    attributes = [(attribute, value) for name, value in values.items() for attribute in PHYSX_NAMES[name]]
    _apply(prim, "PhysxJointAPI", "physxJoint", {attribute: value for attribute, value in attributes if attribute in PHYSX_JOINT})
    axis = joint.freedoms[0].name
    _apply(prim, f"PhysxJointAxisAPI:{axis}", f"physxJointAxis:{axis}", dict(attributes))


def _apply(prim: Prim, schema: str, namespace: str, values: Mapping[str, float]) -> None:
    """Apply a schema, and set its attributes in a namespace. Without values, the schema is not applied."""
    if values:
        prim.schemas.append(schema)
        prim.fill({f"float {namespace}:{name}": value for name, value in values.items()})


def follow(prim: Prim, joint: UsdJoint, follower: MimicJoint, leader: str) -> None:
    """Make a joint mimic the joint at the path `leader`. For a rotation, the values are in degrees.

    PhysX requires limits for rotations (see `limits`). PhysX uses the opposite sign of the gearing: q + gearing * q(leader) + offset = 0.
    """
    offset, bounds = follower.offset * (numeric.degrees(1.0) if follower.turns else 1.0), limits(joint, follower)
    prim.schemas.append("NewtonMimicAPI")
    prim.fill({"rel newton:mimicJoint": f"<{leader}>", "float newton:mimicCoef0": offset, "float newton:mimicCoef1": follower.multiplier})
    if not follower.turns or follower.reach is not None and all(map(numeric.isfinite, bounds)):
        prim.schemas.append(f"PhysxMimicJointAPI:{AXIS}")
        name = f"physxMimicJoint:{AXIS}"
        prim.fill({
            f"rel {name}:referenceJoint": f"<{leader}>", f"uniform token {name}:referenceJointAxis": f'"{AXIS}"',
            f"float {name}:gearing": -follower.multiplier, f"float {name}:offset": -offset,
        })

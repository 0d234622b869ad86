"""Limits, drives and what else a joint has, in UsdPhysics's units: degrees, and gains per degree."""

from __future__ import annotations

from thingc.base import numeric
from thingc.model.robot.types import Robot
from thingc.targets.capabilities import drive_cell, written
from thingc.targets.usd.capabilities import CAPABILITIES
from thingc.targets.usd.chain import Freedom, UsdJoint
from thingc.targets.usd.usda import Prim

LOCKED = (1.0, -1.0)
"""The limits of what must not move: the lower above the upper (UsdPhysics, `PhysicsLimitAPI`)."""

GENERIC = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")
"""What of a generic joint may move, or be locked."""


def ends(freedom: Freedom) -> tuple[float, float]:
    """Between which values [deg or m] it stays."""
    limit, infinite = freedom.joint.limit, numeric.inf * freedom.ratio
    low = -infinite if limit.lower is None else limit.lower * freedom.ratio
    high = infinite if limit.upper is None else limit.upper * freedom.ratio
    both = sorted((low, high))
    return (numeric.degrees(both[0]), numeric.degrees(both[1])) if freedom.turns else (both[0], both[1])


def equip(prim: Prim, joint: UsdJoint, robot: Robot) -> None:
    """Limits and drives of a joint, and what of its dynamics Newton reads."""
    if joint.type == "D6":
        free = {freedom.name: ends(freedom) for freedom in joint.freedoms}
        for name in GENERIC:
            low, high = free.get(name, LOCKED)
            prim.schemas.append(f"PhysicsLimitAPI:{name}")
            prim.say(f"float limit:{name}:physics:low", low)
            prim.say(f"float limit:{name}:physics:high", high)
    elif joint.single is not None:
        for name, end in zip(("lower", "upper"), ends(joint.freedoms[0]), strict=True):
            if numeric.isfinite(end):
                prim.say(f"float physics:{name}Limit", end)
    elif joint.freedoms and joint.freedoms[0].joint.limit.cone is not None:
        cone = numeric.degrees(joint.freedoms[0].joint.limit.cone)
        prim.say("float physics:coneAngle0Limit", cone)
        prim.say("float physics:coneAngle1Limit", cone)
    for freedom in joint.freedoms:
        if freedom.joint.path in robot.present and freedom.ratio == 1.0:
            _drive(prim, freedom)


def _drive(prim: Prim, freedom: Freedom) -> None:
    """A drive with the gains of the joint's; a motor has none, and its force is what whoever simulates asks of it. Its target is q = 0, or
    the nearest to it that the limits allow."""
    drive = freedom.joint.actuator
    if drive is None or written(CAPABILITIES["drives"][drive_cell(freedom.joint, drive)]) is None:
        return
    per = numeric.pi / 180.0 if freedom.turns else 1.0
    name = freedom.name
    prim.schemas.append(f"PhysicsDriveAPI:{name}")
    prim.say(f"uniform token drive:{name}:physics:type", '"force"')
    effort = freedom.joint.limit.effort if freedom.joint.limit.effort is not None else drive.effort
    if effort is not None:
        prim.say(f"float drive:{name}:physics:maxForce", effort)
    prim.say(f"float drive:{name}:physics:stiffness", (drive.kp or 0.0) * per if drive.kind == "position" else 0.0)
    prim.say(f"float drive:{name}:physics:damping", (drive.kv or 0.0) * per if drive.kind != "motor" else 0.0)
    if drive.kind == "position":
        low, high = ends(freedom)
        prim.say(f"float drive:{name}:physics:targetPosition", numeric.minimum(numeric.maximum(0.0, low), high))
    elif drive.kind == "velocity":
        prim.say(f"float drive:{name}:physics:targetVelocity", 0.0)


def passive(joint: UsdJoint) -> dict[str, float]:
    """Armature, damping, friction and the velocity limit of a turn, a slide or a ball, by the names of Newton's schema, which has one value
    of each for all coordinates of a joint: in degrees where it turns, but for the armature and the friction; without those that are 0."""
    if joint.type not in ("Revolute", "Prismatic", "Spherical") or not joint.freedoms:
        return {}
    of, degrees = joint.freedoms[0].joint, 1.0 if joint.type == "Prismatic" else numeric.degrees(1.0)
    damping, velocity = of.dynamics.damping, of.limit.velocity if joint.single is not None else None
    values = {
        "armature": of.dynamics.armature, "damping": None if damping is None else damping / degrees, "friction": of.dynamics.friction,
        "velocityLimit": None if velocity is None else velocity * degrees,
    }
    return {name: value for name, value in values.items() if value}

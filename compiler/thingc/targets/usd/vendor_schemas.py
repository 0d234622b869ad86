"""What UsdPhysics has no words for, in the words of those who read more: Newton's schema, and PhysX's, which is that of Isaac Sim.

A reader that does not know the schemas leaves them alone. Both have one axis of a joint in mind: what PhysX has of balls, and both of
generic joints, is left out.
"""

from __future__ import annotations

from thingc.base import numeric
from thingc.targets.usd.chain import UsdJoint
from thingc.targets.usd.drives import ends, passive
from thingc.targets.usd.mimics import MimicJoint
from thingc.targets.usd.usda import Prim

AXIS = "rotZ"
"""What PhysX calls the coordinate of a turn or a slide about or along z where it mimics."""


def articulation(prim: Prim) -> None:
    """The root of the articulation: its links touch each other, but for those that are filtered."""
    prim.schemas.append("PhysxArticulationAPI")
    prim.say("bool physxArticulation:enabledSelfCollisions", "1")


def dynamics(prim: Prim, joint: UsdJoint, *, in_tree: bool) -> None:
    """Armature, damping, friction and the velocity limit of a joint. PhysX takes them of joints of its articulation alone: armature and
    limit of the whole joint, and since Isaac Sim 5 all of them by axis, which goes before. (Its `jointFriction` of old is no torque, but a
    share of what the joint carries.)"""
    values = passive(joint)
    if values:
        prim.schemas.append("NewtonJointAPI")
    for name, value in values.items():
        prim.say(f"float newton:{name}", value)
    if joint.single is None or not in_tree:
        return
    names: dict[str, tuple[str, ...]] = {"armature": ("armature",), "velocityLimit": ("maxJointVelocity",)}
    said = [(word, value) for name, value in values.items() for word in names.get(name, ())]
    if said:
        prim.schemas.append("PhysxJointAPI")
    for word, value in said:
        prim.say(f"float physxJoint:{word}", value)
    if values:
        names |= {"friction": ("staticFrictionEffort", "dynamicFrictionEffort"), "damping": ("viscousFrictionCoefficient",)}
        axis = joint.freedoms[0].name
        prim.schemas.append(f"PhysxJointAxisAPI:{axis}")
        for name, value in values.items():
            for word in names[name]:
                prim.say(f"float physxJointAxis:{axis}:{word}", value)


def follow(prim: Prim, joint: UsdJoint, follower: MimicJoint, leader: str) -> None:
    """What follows the joint at the path `leader`, in degrees where it turns. Without limits of its own it has those to which the leader's
    take it: PhysX takes no turn without, and counts the other way round: q + gearing * q(leader) + offset = 0."""
    unit = numeric.degrees(1.0) if follower.turns else 1.0
    offset, own = follower.offset * unit, ends(joint.freedoms[0])
    if follower.reach is not None and own == (-numeric.inf, numeric.inf):
        own = follower.reach[0] * unit, follower.reach[1] * unit
        prim.say("float physics:lowerLimit", own[0])
        prim.say("float physics:upperLimit", own[1])
    prim.schemas.append("NewtonMimicAPI")
    prim.say("rel newton:mimicJoint", f"<{leader}>")
    prim.say("float newton:mimicCoef0", offset)
    prim.say("float newton:mimicCoef1", follower.multiplier)
    if not follower.turns or follower.reach is not None and all(map(numeric.isfinite, own)):
        prim.schemas.append(f"PhysxMimicJointAPI:{AXIS}")
        prim.say(f"rel physxMimicJoint:{AXIS}:referenceJoint", f"<{leader}>")
        prim.say(f"uniform token physxMimicJoint:{AXIS}:referenceJointAxis", f'"{AXIS}"')
        prim.say(f"float physxMimicJoint:{AXIS}:gearing", -follower.multiplier)
        prim.say(f"float physxMimicJoint:{AXIS}:offset", -offset)

"""What follows another joint, and whether Newton's schema can say it: a turn another turn, a slide another slide."""

from __future__ import annotations

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Origin
from thingc.model.assembly.kinematics import joints_of, leaders
from thingc.model.resolve.coordinates import Limit
from thingc.model.robot.types import Robot
from thingc.targets.connections import connections
from thingc.targets.usd.capabilities import CAPABILITIES
from thingc.targets.usd.chain import chain


class MimicJoint(FrozenStruct):
    """A joint at `path` that follows the `leader`, which moves by itself: q = offset + multiplier q(leader) [rad or m]. `said`: both are
    joints of one coordinate and of one kind, as Newton's schema has them. `reach`: between which values the leader's limits take it, None
    where that has no two."""

    path: str
    leader: str
    multiplier: float
    offset: float
    turns: bool
    said: bool
    reach: tuple[float, float] | None
    origin: Origin


def followers(robot: Robot) -> dict[str, MimicJoint]:
    """Of every joint that follows another one, by path."""
    steps = [step for connection in connections(robot, CAPABILITIES["loops"]) for step in chain(connection)]
    single = {step.single.path: step.type for step in steps if step.single is not None}
    joints = {joint.path: joint for joint in joints_of(robot.assembly)}
    return {
        path: MimicJoint(
            path=path, leader=leader, multiplier=multiplier, offset=offset, turns=joints[path].twist.turns,
            said=path in single and single.get(leader) == single[path],
            reach=_reach(joints[leader].limit, multiplier, offset), origin=mimic.origin,
        )
        for path, (leader, multiplier, offset) in leaders(joints.values()).items() if (mimic := joints[path].mimic) is not None
    }


def _reach(limit: Limit, multiplier: float, offset: float) -> tuple[float, float] | None:
    if limit.lower is None or limit.upper is None:
        return None
    one, other = (offset + multiplier * end for end in (limit.lower, limit.upper))
    return min(one, other), max(one, other)

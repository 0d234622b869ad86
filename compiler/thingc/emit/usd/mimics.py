"""What follows another joint, and whether Newton's schema can say it: a turn another turn, a slide another slide."""

from __future__ import annotations

from thingc.emit.connections import connections
from thingc.emit.usd.chain import chain
from thingc.frozen import dataclass
from thingc.graph import joints_of, leaders
from thingc.robot.types import Robot
from thingc.source import Origin


@dataclass(frozen=True, slots=True, kw_only=True)
class Follower:
    """A joint at `path` that follows the `leader`, which moves by itself: q = offset + multiplier q(leader) [rad or m]. `said`: both are
    joints of one coordinate and of one kind, as Newton's schema has them; `bounded`: the leader has two limits."""

    path: str
    leader: str
    multiplier: float
    offset: float
    turns: bool
    said: bool
    bounded: bool
    origin: Origin


def followers(robot: Robot) -> dict[str, Follower]:
    """Of every joint that follows another one, by path."""
    steps = [step for connection in connections(robot) for step in chain(connection)]
    single = {step.single.path: step.type for step in steps if step.single is not None}
    joints = {joint.path: joint for joint in joints_of(robot.assembly)}
    return {
        path: Follower(
            path=path, leader=leader, multiplier=multiplier, offset=offset, turns=joints[path].twist.turns,
            said=path in single and single.get(leader) == single[path],
            bounded=None not in (joints[leader].limit.lower, joints[leader].limit.upper), origin=mimic.origin,
        )
        for path, (leader, multiplier, offset) in leaders(joints.values()).items() if (mimic := joints[path].mimic) is not None
    }

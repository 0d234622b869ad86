"""Collect the drives and the start positions of the joints of a robot in one mode, and report drives that a framework does not support."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.model.assembly.types import ActuatorModel
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets import Loss
from thingc.targets.capabilities import joint_cell

EFFECTS = {"delay": "the delay", "stall": "the torque-speed line", "deadband": "the deadband", "noise": "the noise"}
"""Descriptions of the properties of a drive that the configurations do not contain, by the names of attributes of `ActuatorModel`."""


class DrivenJoint(FrozenStruct):
    """A joint coordinate with a drive. `effort` and `velocity` are limits in SI units, or None."""

    name: str
    joint: TreeJoint
    drive: ActuatorModel
    effort: float | None
    velocity: float | None


def moving(robot: Robot, motions: frozenset[str]) -> list[TreeJoint]:
    """Return the joint coordinates in the tree of a mode, without those of the base.

    `motions` contains the types of motion of the joints (see `joint_cell`).
    """
    return [joint for body in robot.bodies for joint in body.joints if joint_cell(joint.kind) in motions]


def driven_joints(robot: Robot, name: Callable[[TreeJoint], str], motions: frozenset[str]) -> list[DrivenJoint]:
    """Return the joint coordinates with drives in a mode, in the order of the tree. `name` returns the name of a joint in files."""
    return [
        DrivenJoint(
            name=name(joint), joint=joint, drive=drive,
            effort=drive.effort if joint.limit.effort is None else joint.limit.effort,
            velocity=drive.velocity if joint.limit.velocity is None else joint.limit.velocity,
        )
        for joint in moving(robot, motions) if (drive := joint.actuator) is not None and joint.path in robot.present
    ]


def start(robot: Robot, joint: TreeJoint) -> float:
    """Return the position of a joint [rad or m] in the start pose of the mode."""
    return robot.start.q.get(joint.path, 0.0)


def by_pattern(values: Mapping[str, float], *, complete: bool) -> dict[str, float]:
    """Return values by regular expressions for the names. A pattern for all names is used if all values are 0.

    If `complete` is True, there are no other joints, so the pattern is also used for any other equal values.
    """
    different = {*values.values()}
    if not different - {0.0} or (complete and len(different) == 1):
        return {".*": next(iter(different), 0.0)}
    return {re.escape(name): value for name, value in values.items()}


def losses(robot: Robot, target: str, framework: str, motions: frozenset[str], *, delays: bool = False) -> Iterator[Loss]:
    """Yield an export loss for each joint with another type of motion, and for the drives of tendons and magnets.

    Also yield losses for the properties of drives in `EFFECTS`, except for delays if `delays` is True.
    """
    for one in driven_joints(robot, lambda joint: joint.path, motions):
        for key, what in EFFECTS.items():
            if getattr(one.drive, key) and not (delays and key == "delay"):
                yield Loss(target, None, one.joint.path, f"{what} of the drive", "omitted", one.drive.origin)
    for body in robot.bodies:
        if body.joints and joint_cell(body.joints[0].kind) not in motions:
            joint = body.joints[0]
            what = f"the configuration of the {joint.kind.name} joint: not supported by {framework}"
            yield Loss(target, None, robot.assembly.mates[joint.mate].name or joint.path, what, "omitted", joint.origin)
    for tendon in robot.assembly.tendons:
        if tendon.path in robot.pulled:
            yield Loss(target, None, tendon.path, "the configuration of the tendon drive", "omitted", tendon.origin)
    for magnet in robot.assembly.adhesions:
        origin = robot.assembly.occurrences[magnet.occurrence].origin
        yield Loss(target, None, magnet.path, "the configuration of the magnet", "omitted", origin)

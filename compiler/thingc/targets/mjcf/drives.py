"""Compute the ranges and gains of joints and their actuators, as attributes of MJCF elements."""

from __future__ import annotations

from thingc.base import numeric
from thingc.model.assembly.types import ActuatorModel, LinkedTendon
from thingc.model.resolve.coordinates import Limit
from thingc.model.robot.types import TreeJoint
from thingc.targets.xml_writer import XmlValue

UNBOUNDED = 1e6
"""Second bound [rad or m] in the `range` of a joint with only one limit, because MuJoCo requires two bounds."""

NOTHING = 1e-12
"""Bound [N, N m, rad/s or m/s] that is written instead of a bound of 0."""


def joint_range(limit: Limit) -> tuple[float, float] | None:
    """Return the lower and the upper limit of a joint [rad or m], or None if the joint has no limits."""
    if limit.lower is None and limit.upper is None:
        return None
    return (-UNBOUNDED if limit.lower is None else limit.lower, UNBOUNDED if limit.upper is None else limit.upper)


def drive_attributes(joint: TreeJoint | LinkedTendon, drive: ActuatorModel) -> dict[str, XmlValue]:
    """Return the gains and the range of a drive as attributes of an MJCF actuator.

    The range of a position drive is the range of its joint. The range of a velocity drive is the velocity limit, and the range of a
    motor is the effort limit. The effort limit of the joint takes precedence over the effort limit of the drive.
    """
    effort = joint.limit.effort if joint.limit.effort is not None else drive.effort
    velocity = joint.limit.velocity if joint.limit.velocity is not None else drive.velocity
    attributes: dict[str, XmlValue] = {}
    if drive.kind == "motor":
        attributes["gear"] = "1"
        if effort is not None:
            attributes["ctrlrange"] = both_ways(effort)
        return attributes
    if drive.kind == "position" and drive.kp is not None:
        attributes["kp"] = drive.kp
    if drive.kv is not None:
        attributes["kv"] = drive.kv
    bounds = joint_range(joint.limit)
    if drive.kind == "position" and bounds is not None:
        attributes["ctrlrange"] = bounds
    elif drive.kind == "velocity" and velocity is not None:
        attributes["ctrlrange"] = both_ways(velocity)
    if effort is not None:
        attributes["forcerange"] = both_ways(effort)
    return attributes


def both_ways(bound: float) -> tuple[float, float]:
    """Return the range from `-bound` to `bound`. A bound of 0 is replaced by a tiny bound, because in MuJoCo, the range `0 0` means that
    there is no limit.
    """
    wide = numeric.maximum(bound, NOTHING)
    return (-wide, wide)

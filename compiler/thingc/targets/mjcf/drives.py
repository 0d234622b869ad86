"""Compute the ranges and gains of joints and their actuators, as attributes of MJCF elements."""

from __future__ import annotations

from typing import Any, cast

from thingc.base import numeric
from thingc.model.assembly.types import ActuatorModel, LinkedTendon
from thingc.model.resolve.coordinates import Limit
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets.xml_writer import Element, XmlValue

TIMESTEP = 0.002
"""MuJoCo's default time step [s]."""

UNBOUNDED = 1e6
"""Second bound [rad or m] in the `range` of a joint with only one limit, because MuJoCo requires two bounds."""

NOTHING = 1e-12
"""Bound [N, N m, rad/s or m/s] that is written instead of a bound of 0."""


def joint_range(limit: Limit) -> tuple[float, float] | None:
    """Return the lower and the upper limit of a joint [rad or m], or None if the joint has no limits."""
    if limit.lower is None and limit.upper is None:
        return None
    return (-UNBOUNDED if limit.lower is None else limit.lower, UNBOUNDED if limit.upper is None else limit.upper)


def time_step(robot: Robot) -> float:
    """Return the time step [s] of a mode."""
    return cast("float", {**robot.assembly.definition.simulation, **robot.mode.simulation}.get("timestep", TIMESTEP))


def delay_steps(delay: float, step: float) -> int:
    """Return a delay as a number of time steps, rounded up, by bisection, because plans record each comparison."""
    below = 0
    for bit in range(23, -1, -1):
        below += 2**bit if (below + 2**bit) * step < delay * (1.0 - 1e-9) else 0
    return below + 1


def drive_attributes(joint: TreeJoint | LinkedTendon, drive: ActuatorModel, step: float) -> dict[str, XmlValue]:
    """Return the gains, the range and the delay of a drive as attributes of an MJCF actuator. `step` is the time step [s].

    The range of a position drive is the range of its joint. The range of a velocity drive is the velocity limit, and the range of a
    motor is the effort limit. The effort limit of the joint takes precedence over the effort limit of the drive. MuJoCo compares times with
    rounding errors. With as many samples as steps of the delay, the oldest sample always acts, so rounding errors have no effect.
    """
    effort = joint.limit.effort if joint.limit.effort is not None else drive.effort
    velocity = joint.limit.velocity if joint.limit.velocity is not None else drive.velocity
    attributes: dict[str, XmlValue] = {"delay": drive.delay, "nsample": str(delay_steps(drive.delay, step))} if drive.delay else {}
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


def add_custom_data(section: Element, driven: TreeJoint | LinkedTendon) -> None:
    """Add `numeric` elements for the values of a drive that MJCF cannot express. Their names begin with the name of the actuator."""
    for key in ("stall", "deadband", "noise"):
        if (drive := driven.actuator) is not None and (value := getattr(drive, key)):
            section.add("numeric", {"name": f"{drive.name or driven.path}:{key}", "data": value}, drive.origin)


def start_delays(model: Any, data: Any) -> None:
    """Let the current controls also be the controls before the start. MuJoCo resets the past controls of delayed drives to 0."""
    import mujoco

    for number, (count, _) in enumerate(model.actuator_history):
        if count:
            mujoco.mj_initCtrlHistory(model, data, number, None, [data.ctrl[number]] * count)


def both_ways(bound: float) -> tuple[float, float]:
    """Return the range from `-bound` to `bound`. A bound of 0 is replaced by a tiny bound, because in MuJoCo, the range `0 0` means that
    there is no limit.
    """
    upper = numeric.maximum(bound, NOTHING)
    return (-upper, upper)

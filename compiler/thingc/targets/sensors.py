"""Find the places of sensors in a robot, and the quantities that simulators measure there."""

from __future__ import annotations

from thingc.model.assembly.types import LinkedSensor
from thingc.model.robot.types import Robot


def body_of(robot: Robot, sensor: LinkedSensor) -> int:
    """Return the index of the body that contains the mount of a sensor."""
    return next(site.body for site in robot.sites if site.path == sensor.site)


def on_free_root(robot: Robot, sensor: LinkedSensor) -> bool:
    """Return whether a sensor is on the root link of a robot with a floating base."""
    return robot.base == "free" and body_of(robot, sensor) == 0


def describe_force_place(robot: Robot, sensor: LinkedSensor) -> str | None:
    """Describe the place at which simulators measure the force of a sensor.

    Return None if the force that they measure equals the force through the mount. Simulators measure the force between a body and its
    parent in the tree. This force equals the force through the mount if the mount belongs to the root, or to the joint that leads to the
    parent. The measured force also equals the force through the mount if no other body is attached to the body, because then only external
    forces act on the body.
    """
    index = body_of(robot, sensor)
    body = robot.bodies[index]
    at = None if sensor.at is None else (sensor.at.occurrence, sensor.at.mount)
    if body.mate is None:
        root = robot.mode.root
        if (root.occurrence, root.mount) == at:
            return None
        return f"between its link and the world at `{root.path}`"
    mate = robot.assembly.mates[body.mate]
    if at in ((mate.parent, mate.parent_mount), (mate.child, mate.child_mount)):
        return None
    if not any(other.parent == index for other in robot.bodies):
        return None
    return f"through joint `{mate.name}`"

"""What the package cannot say of a robot: what URDF cannot, but for what stands beside it there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from thingc.emit.artifact import Loss
from thingc.emit.urdf import losses as urdf
from thingc.robot.types import Robot


def losses(robot: Robot) -> Iterator[Loss]:
    """Of one mode. Poses, and links that never touch, are in the SRDF; drives in ros2_control, but for those of a ball, whose axes are no
    joints' there."""
    balls = {joint.path for body in robot.bodies for joint in body.joints if joint.kind.at_once}
    for loss in urdf.losses(robot):
        said = loss.what in (urdf.POSE, urdf.EXCLUDED) or (loss.what.startswith(urdf.DRIVE) and loss.path not in balls)
        if not said:
            yield replace(loss, target="ros")

"""What drives joints in Gazebo: SDF itself has limits of effort and velocity alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from thingc.model.assembly.types import ActuatorModel, JointEdge
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets.capabilities import drive_cell, written
from thingc.targets.sdf.capabilities import CAPABILITIES, DriveForm
from thingc.targets.sdf.chain import SdfJoint
from thingc.targets.sdf.zero_pose import ZeroState
from thingc.targets.xml_writer import Element

UNBOUNDED = 1e9
"""An effort [N m or N] where the drive has no limit: Gazebo's controllers have one of 1000."""

SYSTEMS: dict[DriveForm, tuple[str, str]] = {
    "position controller": ("joint-position-controller", "JointPositionController"),
    "velocity controller": ("joint-controller", "JointController"), "force": ("apply-joint-force", "ApplyJointForce"),
}
"""The file and the class of each of Gazebo's systems."""


def plugin(robot: Robot, zero: ZeroState, steps: Iterable[SdfJoint], names: Mapping[str, str]) -> Iterator[Element]:
    """The controllers of what is driven in this mode and has one axis: a PID with the drive's gains as forces, or for a motor what hands
    them on. `names` are those of joints, by path."""
    for step in steps:
        if len(step.axes) == 1 and step.axes[0].joint.path in robot.present:
            joint = step.axes[0].joint
            form = None if joint.actuator is None else written(CAPABILITIES["drives"][drive_cell(joint, joint.actuator)])
            if joint.actuator is not None and form is not None:
                yield _controller(robot, zero, names[step.path], joint, joint.actuator, form)


def _controller(
    robot: Robot, zero: ZeroState, name: str, joint: TreeJoint | JointEdge, drive: ActuatorModel, form: DriveForm,
) -> Element:
    file, system = SYSTEMS[form]
    element = Element(
        tag="plugin", attributes={"filename": f"gz-sim-{file}-system", "name": f"gz::sim::systems::{system}"}, origin=drive.origin,
    )
    element.say("joint_name", name)
    if form != "force":
        if form == "velocity controller":
            element.say("use_force_commands", "true")
        p, d = (drive.kp, drive.kv) if form == "position controller" else (drive.kv, None)
        effort = UNBOUNDED if joint.limit.effort is None else joint.limit.effort
        values = [("p_gain", p), ("i_gain", 0.0), ("d_gain", d), ("cmd_max", effort), ("cmd_min", -effort)]
        if form == "position controller":
            values += [("initial_position", frame.q[joint.path] - zero.q[joint.path]) for frame in robot.keyframes[:1]]
        for word, value in values:
            element.say(word, value or 0.0)
    return element

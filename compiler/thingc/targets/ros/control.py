"""Write the configuration of ros2_control: the command interfaces of mock hardware for the drives of a mode, and controllers for these
interfaces.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import formatter
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import ActuatorModel
from thingc.model.robot.types import Robot
from thingc.targets.ros.joints import MovingJoint, joints, values
from thingc.targets.urdf.transmissions import control_transmission, coupled_transmissions, simple_transmission
from thingc.targets.xml_writer import Element

PLUGIN = "mock_components/GenericSystem"
BROADCASTER = "joint_state_broadcaster"

CONTROLLERS = {
    "position": ("joint_trajectory_controller", "joint_trajectory_controller/JointTrajectoryController"),
    "velocity": ("velocity_controller", "forward_command_controller/ForwardCommandController"),
    "effort": ("effort_controller", "forward_command_controller/ForwardCommandController"),
}
"""The name and the type of the controller for each command interface."""

RATE = 100
"""Update rate of the controllers [Hz]."""


class Controller(FrozenStruct):
    """A controller for joints with the same command interface. `drives` maps the name of each joint to its drive."""

    name: str
    type: str
    interface: str
    drives: dict[str, ActuatorModel]


def ros2_control(robot: Robot) -> Element | None:
    """Create the `<ros2_control>` element for the URDF of a mode. Return None for a robot without moving joints.

    Every joint has state interfaces for its position and velocity. A joint with a drive has a command interface with its limits. The gains
    of a drive are written as parameters, for hardware that closes its own control loop. Controllers command joints; a `<transmission>`
    contains the ratio with which hardware converts these commands to commands of its actuators.
    """
    moving, initial = joints(robot), values(robot, robot.start.q)
    if not moving:
        return None
    block = Element(tag="ros2_control", attributes={"name": robot.assembly.name, "type": "system"}, origin=robot.mode.origin)
    hardware = block.add("hardware")
    hardware.add_text("plugin", PLUGIN)
    hardware.add_text("param", "true", {"name": "calculate_dynamics"})
    for joint in moving:
        element = block.add("joint", {"name": joint.name}, joint.move.joint.origin)
        if joint.drive is not None and joint.interface is not None:
            command = element.add("command_interface", {"name": joint.interface}, joint.drive.origin)
            for name, bound in zip(("min", "max"), _bounds(joint, joint.interface), strict=True):
                if bound is not None:
                    command.add_text("param", bound, {"name": name})
        element.add("state_interface", {"name": "position"}).add_text("param", initial[joint.name], {"name": "initial_value"})
        element.add("state_interface", {"name": "velocity"})
        if joint.interface == "effort":
            element.add("state_interface", {"name": "effort"})
        if joint.drive is not None:
            for name, gain in (("kp", joint.drive.kp), ("kv", joint.drive.kv)):
                if gain is not None:
                    element.add_text("param", gain, {"name": name})
    drives = [(joint.name, joint.drive) for joint in moving if joint.drive is not None and joint.drive.transmission is not None]
    transmissions = [simple_transmission(name, drive) for name, drive in drives]
    block.children += map(control_transmission, [*transmissions, *coupled_transmissions(robot)])
    return block


def controllers(robots: Sequence[Robot]) -> dict[str, tuple[Controller, ...]]:
    """Return the ROS 2 controllers of each mode, by the name of the mode.

    Modes that have the same drives share a controller. If there are several sets of drives, the name of each additional controller ends
    with the name of its first mode.
    """
    existing: dict[str, list[Controller]] = {interface: [] for interface in CONTROLLERS}
    of_mode: dict[str, tuple[Controller, ...]] = {}
    for robot in robots:
        in_mode: list[Controller] = []
        moving = {joint.move.joint.path: joint for joint in joints(robot) if joint.drive is not None}
        driven = [moving[joint.path] for joint in joints_of(robot.assembly) if joint.path in moving]
        for interface, (base, kind) in CONTROLLERS.items():
            drives = {joint.name: joint.drive for joint in driven if joint.drive is not None and joint.interface == interface}
            if not drives:
                continue
            controller = next((other for other in existing[interface] if other.drives == drives), None)
            if controller is None:
                name = f"{base}_{robot.mode.name}" if existing[interface] else base
                controller = Controller(name=name, type=kind, interface=interface, drives=drives)
                existing[interface].append(controller)
            in_mode.append(controller)
        of_mode[robot.mode.name] = tuple(in_mode)
    return of_mode


def controllers_yaml(of_mode: Mapping[str, Sequence[Controller]]) -> str:
    """Return the parameters of the controller manager and of all controllers as YAML. Floats have a decimal point, which ROS requires."""
    by_name = {controller.name: controller for in_mode in of_mode.values() for controller in in_mode}
    lines = ["controller_manager:", "  ros__parameters:", f"    update_rate: {RATE}", f"    {BROADCASTER}:"]
    lines.append("      type: joint_state_broadcaster/JointStateBroadcaster")
    for controller in by_name.values():
        lines += [f"    {controller.name}:", f"      type: {controller.type}"]
    for controller in by_name.values():
        lines += ["", f"{controller.name}:", "  ros__parameters:", *(f"    {line}" for line in _of_controller(controller))]
    return "\n".join(lines) + "\n"


def _of_controller(controller: Controller) -> Iterator[str]:
    yield f"joints: [{', '.join(map(_quote, controller.drives))}]"
    if controller.interface != "position":
        yield f"interface_name: {controller.interface}"
        return
    yield f"command_interfaces: [{controller.interface}]"
    yield "state_interfaces: [position, velocity]"
    gains = {
        name: [f"{key}: {_real(gain)}" for key, gain in (("p", drive.kp), ("d", drive.kv)) if gain is not None]
        for name, drive in controller.drives.items()
    }
    if any(gains.values()):
        yield "gains:  # of position and velocity drives [N m/rad, N m s/rad; N/m, N s/m], used only with an effort command interface"
        for name, entries in gains.items():
            if entries:
                yield f"  {_quote(name)}: {{{', '.join(entries)}}}"


def _bounds(joint: MovingJoint, interface: str) -> tuple[float | None, float | None]:
    """Return the lower and upper limit of the commands of a joint, for ros2_control."""
    limit = joint.move.joint.limit
    if interface == "position":
        return limit.lower, limit.upper
    bound = limit.velocity if interface == "velocity" else limit.effort
    return (None, None) if bound is None else (-bound, bound)


def _quote(name: str) -> str:
    """Format a name as a quoted YAML string. Without quotes, YAML parsers could read `y` or `null` as another type."""
    return f'"{name}"'


@formatter("yaml")
def _real(value: float) -> str:
    """Format a number so that every YAML parser reads it as a float, such as `20.0` or `1.0e-05`."""
    mantissa, e, exponent = repr(float(value)).partition("e")
    return f"{mantissa}{'' if '.' in mantissa else '.0'}{e}{exponent}"

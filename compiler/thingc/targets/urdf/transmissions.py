"""Write transmissions between actuators and joints: `<transmission>` elements of URDF and of ros2_control."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Origin
from thingc.geometry.record import DriveType
from thingc.model.assembly.types import ActuatorModel, LinkedTendon
from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.name_mangling import safe
from thingc.targets.xml_writer import Element

INTERFACES: Mapping[DriveType, str] = {
    "position": "PositionJointInterface", "velocity": "VelocityJointInterface", "motor": "EffortJointInterface",
}
"""ROS interface for each kind of drive."""
CLOSE = 1e-9
"""Relative difference below which the ratios of a differential count as equal."""


class RosTransmission(FrozenStruct, kw_only=False):
    """A transmission as ROS describes it: its plugin, and the reductions of its actuators and joints, by name and in order."""

    name: str
    plugin: str
    actuators: dict[str, float]
    joints: dict[str, float]
    kind: DriveType
    origin: Origin


def differentials(robot: Robot) -> dict[str, tuple[LinkedTendon, ...]]:
    """Return the drives of each differential that exists in a mode, by the path of the differential."""
    in_tree = {joint.path for body in robot.bodies for joint in body.joints}
    found: dict[str, tuple[LinkedTendon, ...]] = {}
    for tendon in robot.assembly.tendons:
        name = tendon.transmission
        if name is not None and tendon.path in robot.pulled and in_tree.issuperset(tendon.moves):
            found[name] = (*found.get(name, ()), tendon)
    return found


def simple_transmission(joint: str, drive: ActuatorModel) -> RosTransmission:
    """Return the transmission of the drive of a joint. Without a transmission in the document, the ratio is 1."""
    name = f"{joint}_transmission" if drive.transmission is None else safe(drive.transmission)
    return RosTransmission(name, "SimpleTransmission", {joint: 1.0}, {joint: drive.ratio or 1.0}, drive.kind, drive.origin)


def coupled_transmissions(robot: Robot) -> Iterator[RosTransmission]:
    """Yield the transmissions of the differentials of a mode. Differentials that ROS cannot describe are omitted.

    For the reductions a and j, the positions of the actuators are (a0 (j0 q0 + j1 q1), a1 (j0 q0 - j1 q1)) for a
    `DifferentialTransmission`, and (a0 j0 q0, a1 (q0 + j1 q1)) for a `FourBarLinkageTransmission`.
    """
    for name, rows in differentials(robot).items():
        drive = rows[0].actuator
        if drive is None or len(rows) != 2 or len(rows[0].moves) != 2:
            continue
        (a, b), (c, d) = (tuple(row.moves.values()) for row in rows)
        if a and b and abs(a * d + b * c) <= CLOSE * abs(a * d):
            plugin, last = "DifferentialTransmission", b / a
        elif c and not b:
            plugin, last = "FourBarLinkageTransmission", d / c
        else:
            continue
        first, second = (safe(path) for path in rows[0].moves)
        actuators = {safe(rows[0].path): a, safe(rows[1].path): c}
        yield RosTransmission(safe(name), plugin, actuators, {first: 1.0, second: last}, drive.kind, rows[0].origin)


def urdf_transmission(transmission: RosTransmission) -> Element:
    """Return the `<transmission>` element of a URDF file. Simple transmissions have their ratio at the actuator, as ROS 1 requires."""
    element = Element(tag="transmission", attributes={"name": transmission.name}, origin=transmission.origin)
    element.add_text("type", f"transmission_interface/{transmission.plugin}")
    alone = len(transmission.joints) == 1
    for k, (name, ratio) in enumerate(transmission.joints.items(), start=1):
        element.add("joint", {"name": name}).fill({
            "hardwareInterface": f"hardware_interface/{INTERFACES[transmission.kind]}", "role": None if alone else f"joint{k}",
            "mechanicalReduction": None if alone else ratio,
        })
    for k, (name, ratio) in enumerate(transmission.actuators.items(), start=1):
        element.add("actuator", {"name": name}).fill({
            "role": None if alone else f"actuator{k}", "mechanicalReduction": transmission.joints[name] if alone else ratio,
        })
    return element


def control_transmission(transmission: RosTransmission) -> Element:
    """Return the `<transmission>` element of a `<ros2_control>` element."""
    element = Element(tag="transmission", attributes={"name": transmission.name}, origin=transmission.origin)
    element.add_text("plugin", f"transmission_interface/{transmission.plugin}")
    for tag, reductions in (("actuator", transmission.actuators), ("joint", transmission.joints)):
        for k, (name, ratio) in enumerate(reductions.items(), start=1):
            element.add(tag, {"name": name, "role": f"{tag}{k}"}).add_text("mechanical_reduction", ratio)
    return element


def transmission_losses(target: str, robots: Sequence[Robot]) -> Iterator[Loss]:
    """Yield an export loss for each differential that no transmission type of ROS can represent."""
    for robot in robots:
        written = {transmission.name for transmission in coupled_transmissions(robot)}
        for name, rows in differentials(robot).items():
            if safe(name) not in written:
                what = "the transmission of the differential: ROS supports only two actuators and a symmetric matrix"
                yield Loss(target, robot.mode.name, name, what, "omitted", rows[0].origin)

"""What SDF cannot say of a robot."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from thingc.emit.artifact import Loss
from thingc.emit.sdf.chain import Connection, connections
from thingc.emit.sdf.zero import ZeroState
from thingc.emit.sensors import elsewhere, on_free_root
from thingc.graph.types import JointEdge
from thingc.inertia import physical_fault
from thingc.robot.types import CoreJoint, Robot
from thingc.source import Origin

GRAVITY = (0.0, 0.0, -9.81)
"""What needs no saying [m/s^2]."""


def losses(robot: Robot, zero: ZeroState) -> Iterator[Loss]:
    """Of one mode, whose file has the robot at `zero`; what is lost of every mode alike is of none."""
    lose = partial(_loss, robot.mode.name)
    for connection in connections(robot, zero):
        yield from _of_joint(connection)
    yield from _of_all_modes(robot)
    yield from _of_sensors(robot)
    mode = robot.mode
    if zero.pose is not None:
        what = f"what q its joints are at: here it counts from the pose `{zero.pose}`, in which loops and holds are closed"
        yield lose(mode.name, what, "approximated", mode.origin)
    for closure in robot.closures if not zero.closed else ():
        what = "that it is held where it is" if closure.hold else "its loop, which stays open here"
        yield lose(closure.path, f"{what}: no pose of the mode closes it", "omitted", closure.origin)
    for body in robot.bodies:
        link = robot.assembly.links[body.link]
        if not link.properties.mass:
            yield lose(link.name, "that it weighs nothing: a link weighs 1e-9 kg here", "approximated", link.origin)
        elif physical_fault(link.properties.inertia) is not None:
            yield lose(link.name, "its inertia, which no solid has: it is 1e-12 kg m^2 here", "approximated", link.origin)
    if robot.gravity != GRAVITY:
        yield lose(mode.name, "its gravity, which stands in the file of the world alone", "carried as custom data", mode.origin)
    if robot.base == "held":
        yield lose(mode.name, "that its base is held, and can be moved while it is: it is fixed here", "approximated", mode.origin)
    if robot.moves and not robot.moves[0].kind.at_once:
        yield lose(mode.name, f"the motion of its base {_chain(len(robot.moves))}", "approximated", mode.origin)
    if set(mode.simulation) - {"timestep"}:
        yield lose(mode.name, "how it is stepped (`simulation`), but for its timestep", "omitted", mode.origin)
    if mode.exclude:
        yield lose(mode.name, "which links never touch, besides neighbours", "omitted", mode.origin)


def _chain(count: int) -> str:
    """Of a motion of several coordinates."""
    return f"as one joint's: its {count} coordinates are joints here, with links of 1e-9 kg between"


def _of_joint(connection: Connection) -> Iterator[Loss]:
    """What a joint of the document loses, of which there is none in the base or a hold."""
    if len(connection.chain) > 1 and connection.joints:
        yield _loss(None, connection.path, f"its motion {_chain(len(connection.chain))}", "approximated", connection.origin)
        yield _loss(None, connection.path, "that what it connects never touches", "omitted", connection.origin)
    for number, joint in enumerate(connection.joints):
        ball = joint.kind.at_once
        path = connection.path if ball else joint.path
        for what in _of_dynamics(joint, ball=ball) if number == 0 or not ball else ():
            yield _loss(None, path, what, "omitted", joint.origin)
        if joint.actuator is not None:
            drive = joint.actuator
            gains = [f", {name} {value:.6g}" for name, value in (("kp", drive.kp), ("kv", drive.kv)) if value is not None]
            about = f" about {', '.join(f'{one:.6g}' for one in drive.axis)}" if drive.axis is not None else ""
            alone = connection.chain[0].type not in ("ball", "universal")
            what = f"its drive: {drive.kind}{about}{''.join(gains)}" + (", which Gazebo alone reads" if alone else "")
            yield _loss(None, joint.path, what, "carried as custom data" if alone else "omitted", drive.origin)


def _of_dynamics(joint: CoreJoint | JointEdge, *, ball: bool) -> Iterator[str]:
    turns, dynamics = joint.twist.turns, joint.dynamics
    if dynamics.armature:
        yield f"its armature of {dynamics.armature:.6g} {'kg m^2' if turns else 'kg'}"
    if not ball:
        return
    if joint.limit.cone is not None:
        yield f"its cone of {joint.limit.cone:.6g} rad"
    for name, value, unit in (
        ("damping", dynamics.damping, "N m s/rad"), ("friction", dynamics.friction, "N m"), ("stiffness", dynamics.stiffness, "N m/rad"),
    ):
        if value:
            yield f"its {name} of {value:.6g} {unit}: a ball of SDF has none"


def _of_all_modes(robot: Robot) -> Iterator[Loss]:
    assembly = robot.assembly
    for magnet in assembly.adhesions:
        yield _loss(None, magnet.path, f"its pull of {magnet.force:.6g} N", "omitted", assembly.occurrences[magnet.occurrence].origin)
    for pose in assembly.poses:
        yield _loss(None, pose.name, "this pose: SDF has none", "omitted", pose.origin)
    rolling = [one.material for one in assembly.occurrences if one.material is not None and one.material.roll is not None]
    for material in {material.name: material for material in rolling}.values():
        yield _loss(None, material.name, "its rolling friction", "omitted", material.origin)
    if set(assembly.definition.simulation) - {"timestep"}:
        origin = assembly.definition.step_origin or assembly.definition.origin
        yield _loss(None, assembly.name, "how it is stepped (`simulation`), but for its timestep", "omitted", origin)


def _of_sensors(robot: Robot) -> Iterator[Loss]:
    lose = partial(_loss, robot.mode.name)
    for sensor in robot.assembly.sensors:
        if sensor.kind == "joint":
            yield _loss(None, sensor.path, "this sensor: SDF has none of a joint's state", "omitted", sensor.origin)
        elif sensor.kind == "force" and on_free_root(robot, sensor):
            yield lose(sensor.path, "it: nothing carries the root of a free base", "omitted", sensor.origin)
        elif sensor.kind == "force" and (place := elsewhere(robot, sensor)) is not None:
            what = f"the force at its mount: it reads what passes {place}"
            yield lose(sensor.path, what, "approximated", sensor.origin)


def _loss(mode: str | None, path: str, what: str, how: str, origin: Origin) -> Loss:
    return Loss.of(origin, "sdf", mode, path, what, how)

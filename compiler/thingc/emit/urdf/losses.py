"""What URDF cannot say of a robot."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from thingc.emit.artifact import Loss
from thingc.joints import JointKind
from thingc.pose import NO_POSE
from thingc.robot.types import CoreJoint, Robot
from thingc.source import Origin

GRAVITY = (0.0, 0.0, -9.81)
"""What readers take [m/s^2]: URDF has none."""

SIMULATION = "how it is stepped (`simulation`)"
POSE = "this pose: URDF has none"
EXCLUDED = "which links never touch, besides neighbours"
DRIVE = "its drive: "
"""What a drive's loss begins with."""


def losses(robot: Robot) -> Iterator[Loss]:
    """Of one mode; what is lost of every mode alike is of none."""
    lose = partial(_loss, robot.mode.name)
    yield from _of_joints(robot)
    yield from _of_all_modes(robot)
    for closure in robot.closures:
        what = "that it is held where it is" if closure.hold else "its loop, which stays open here: URDF has trees alone"
        yield lose(closure.path, what, "omitted", closure.origin)
    for body in robot.bodies:
        link = robot.assembly.links[body.link]
        if not link.properties.mass and body.joints:
            yield lose(link.name, "that it weighs nothing: what moves weighs 1e-9 kg here", "approximated", link.origin)
    mode = robot.mode
    if robot.gravity != GRAVITY:
        yield lose(mode.name, "its gravity, which MuJoCo alone reads", "carried as custom data", mode.origin)
    if robot.base == "held":
        yield lose(mode.name, "that its base is held, and can be moved while it is: it is fixed here", "approximated", mode.origin)
    if robot.moves:
        yield lose(mode.name, _of_several(robot.moves[0].kind, "the motion of its base"), "approximated", mode.origin)
    if mode.simulation:
        yield lose(mode.name, SIMULATION, "omitted", mode.origin)
    if robot.base == "free" and robot.bodies[0].X_PL != NO_POSE:
        yield lose(mode.name, "where it begins: a free base begins wherever a reader puts it", "omitted", mode.origin)
    if mode.exclude:
        yield lose(mode.name, EXCLUDED, "omitted", mode.origin)


def _of_joints(robot: Robot) -> Iterator[Loss]:
    in_tree = {joint.path for body in robot.bodies for joint in body.joints}
    for body in robot.bodies:
        for place, joint in enumerate(body.joints):
            lose = partial(_loss, None, joint.path)
            if place == 0 and len(body.joints) > 1:
                path = robot.assembly.mates[joint.mate].name or joint.path
                yield _loss(None, path, _of_several(joint.kind, "its motion"), "approximated", joint.origin)
            if joint.twist.pitch:
                what = "its thread: a slide mimics the turn, and readers without mimics leave it loose"
                yield lose(what, "approximated", joint.origin)
            whole = robot.assembly.mates[joint.mate].name if body.at_once else joint.path
            for what in _of_joint(joint) if place == 0 or not body.at_once else ():
                yield _loss(None, whole or joint.path, what, "omitted", joint.origin)
            if joint.actuator is not None:
                drive = joint.actuator
                gains = [f", {name} {value:.6g}" for name, value in (("kp", drive.kp), ("kv", drive.kv)) if value is not None]
                about = f" about {', '.join(f'{one:.6g}' for one in drive.axis)}" if drive.axis is not None else ""
                yield lose(f"{DRIVE}{drive.kind}{about}{''.join(gains)}", "omitted", drive.origin)
            if joint.mimic is not None and joint.mimic.joint.path not in in_tree:
                what = f"that it follows `{joint.mimic.joint.path}`, at which a loop is cut"
                yield _loss(robot.mode.name, joint.path, what, "omitted", joint.mimic.origin)


def _of_several(kind: JointKind, motion: str) -> str:
    """Of what has several coordinates."""
    if kind.at_once:
        return f"{motion} as a ball's: three turns here, one after the other, whose angles are no coordinates of it"
    return f"{motion} as one joint's: its {len(kind.twists)} coordinates are joints here, with links of 1e-9 kg between"


def _of_joint(joint: CoreJoint) -> Iterator[str]:
    if joint.dynamics.armature:
        yield f"its armature of {joint.dynamics.armature:.6g} {'kg m^2' if joint.twist.turns else 'kg'}"
    if joint.dynamics.stiffness:
        yield f"its stiffness of {joint.dynamics.stiffness:.6g} {'N m/rad' if joint.twist.turns else 'N/m'}"
    if joint.limit.cone is not None:
        yield f"its cone of {joint.limit.cone:.6g} rad"


def _of_all_modes(robot: Robot) -> Iterator[Loss]:
    assembly = robot.assembly
    for magnet in assembly.adhesions:
        yield _loss(None, magnet.path, f"its pull of {magnet.force:.6g} N", "omitted", assembly.occurrences[magnet.occurrence].origin)
    for sensor in assembly.sensors:
        yield _loss(None, sensor.path, "this sensor: URDF has none", "omitted", sensor.origin)
    for pose in assembly.poses:
        yield _loss(None, pose.name, POSE, "omitted", pose.origin)
    rubbing = {one.material.name: one.material for one in assembly.occurrences if one.material is not None}
    for material in rubbing.values():
        if (material.slide, material.torsion, material.roll) != (None, None, None):
            yield _loss(None, material.name, "its friction", "omitted", material.origin)
    if assembly.definition.simulation:
        origin = assembly.definition.step_origin or assembly.definition.origin
        yield _loss(None, assembly.name, SIMULATION, "omitted", origin)



def _loss(mode: str | None, path: str, what: str, how: str, origin: Origin) -> Loss:
    return Loss.of(origin, "urdf", mode, path, what, how)

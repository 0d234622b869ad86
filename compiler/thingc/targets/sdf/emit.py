"""`sdf/<name>_<mode>/`: each chosen mode as a model folder for Gazebo, and `sdf/world_<mode>.sdf`, a world with that model."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.base.generated_header import heading
from thingc.base.source import Origin
from thingc.model.robot.types import Robot
from thingc.targets import raw
from thingc.targets.artifact import Artifacts, Content, How, Loss
from thingc.targets.capabilities import losses
from thingc.targets.connections import Connection, connections
from thingc.targets.geometry import solid_geometry
from thingc.targets.request import EmitRequest
from thingc.targets.sdf.capabilities import CAPABILITIES
from thingc.targets.sdf.chain import ZeroState, chain, zero_state
from thingc.targets.sdf.model_element import MESHES, model
from thingc.targets.sdf.world import config, world
from thingc.targets.sensors import elsewhere, on_free_root
from thingc.targets.xml_writer import write


def emit(request: EmitRequest) -> Artifacts:
    """Return a folder and a world for each chosen mode.

    Each folder contains its own meshes, as usual for Gazebo, so that a user can copy a single folder.
    """
    assembly = request.assembly
    shapes, flat = solid_geometry(assembly, "sdf", f"sdf/{assembly.name}_MODE/{MESHES}", request.report)
    meshes = {f"{MESHES}/{file}": stored for file, stored in shapes.assets.items()}
    files: dict[str, Content] = {}
    lost = dict.fromkeys((*flat, *losses("sdf", CAPABILITIES, assembly, request.robots, cut=True)))
    zeros = [zero_state(robot) for robot in request.robots]
    made = [model(robot, shapes, zero, request.report) for robot, zero in zip(request.robots, zeros, strict=True)]
    models = [written for written, _ in made]
    lost |= dict.fromkeys(loss for _, renamed in made for loss in renamed)
    raw.lay(assembly, request.robots, "sdf", models, request.report)
    for robot, zero, written in zip(request.robots, zeros, models, strict=True):
        name = f"{assembly.name}_{robot.mode.name}"
        said = heading(assembly.definition.document, robot.mode.name)
        files[f"sdf/{name}/model.sdf"] = write(written, said).text.encode()
        files[f"sdf/{name}/model.config"] = write(config(name, written.get("version"), said), said).text.encode()
        files[f"sdf/world_{robot.mode.name}.sdf"] = write(world(robot, name), said).text.encode()
        files |= {f"sdf/{name}/{path}": content for path, content in meshes.items()}
        lost |= dict.fromkeys(_losses_of_mode(robot, zero))
    return Artifacts(files=dict(sorted(files.items())), losses=tuple(lost))


def _losses_of_mode(robot: Robot, zero: ZeroState) -> Iterator[Loss]:
    """Yield the losses of one mode, whose zero state in the file is `zero`. Losses common to all modes have no mode."""
    mode = robot.mode
    for connection in connections(robot, CAPABILITIES["loops"], closed=zero.closed):
        yield from _of_joint(connection, len(chain(connection, zero.q)))
    yield from _of_sensors(robot)
    if zero.pose is not None:
        what = f"the zero of its joints: in the file it is the pose `{zero.pose}`, in which loops and holds are closed"
        yield _loss(mode.name, mode.name, what, "approximated", mode.origin)
    for closure in robot.closures if not zero.closed else ():
        what = "the hold in place" if closure.hold else "the loop through it"
        yield _loss(mode.name, closure.path, f"{what}: no pose of the mode closes it", "omitted", closure.origin)


def _of_joint(connection: Connection, number: int) -> Iterator[Loss]:
    """Yield the losses of a document's joint that is written as `number` joints. Joints of bases and holds have no losses."""
    if number > 1 and connection.joints:
        yield _loss(None, connection.path, "the excluded contact of the links that it connects", "omitted", connection.origin)
    for joint in (joint for joint in connection.joints[:1] if joint.kind.at_once):
        of = joint.dynamics
        for name, value, unit in (
            ("damping", of.damping, "N m s/rad"), ("friction", of.friction, "N m"), ("stiffness", of.stiffness, "N m/rad"),
        ):
            if value:
                what = f"its {name} of {value:.6g} {unit}: SDF has none for balls"
                yield _loss(None, connection.path, what, "omitted", joint.origin)


def _of_sensors(robot: Robot) -> Iterator[Loss]:
    mode = robot.mode.name
    for sensor in robot.assembly.sensors:
        if sensor.kind == "force" and on_free_root(robot, sensor):
            yield _loss(mode, sensor.path, "it: no link carries the root of a free base", "omitted", sensor.origin)
        elif sensor.kind == "force" and (place := elsewhere(robot, sensor)) is not None:
            what = f"the force at its mount: it measures the force {place}"
            yield _loss(mode, sensor.path, what, "approximated", sensor.origin)
        elif sensor.kind == "contact":
            links = [robot.assembly.links[link] for link in sensor.touching]
            if not any(robot.assembly.occurrences[member].touching for member in links[0].members):
                yield _loss(None, sensor.path, "this sensor: its link has no collision shapes", "omitted", sensor.origin)
            elif len(links) > 1:
                what = f"its limitation to contacts with `{links[1].name}`"
                yield _loss(None, sensor.path, what, "omitted", sensor.origin)


def _loss(mode: str | None, path: str, what: str, how: How, origin: Origin) -> Loss:
    return Loss.of(origin, "sdf", mode, path, what, how)

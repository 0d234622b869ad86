"""Write each chosen mode as a model folder `sdf/<name>_<mode>/` for Gazebo, and as a world `sdf/world_<mode>.sdf` that contains this
model.
"""

from __future__ import annotations

from collections.abc import Iterator

from thingc.base import numeric
from thingc.base.generated_header import heading
from thingc.model.robot.types import Robot
from thingc.targets import raw
from thingc.targets.artifact import Artifacts, Content, Loss
from thingc.targets.capabilities import losses, written_as
from thingc.targets.connections import Connection, connections
from thingc.targets.geometry import bounds, collect_geometry, placements
from thingc.targets.request import EmitRequest
from thingc.targets.sdf.capabilities import CAPABILITIES, SensorForm
from thingc.targets.sdf.chain import ZeroState, chain, zero_state
from thingc.targets.sdf.model_element import MESHES, PLAIN, gazebo_system, model
from thingc.targets.sensors import describe_force_place, on_free_root
from thingc.targets.xml_writer import Element, write


def emit(request: EmitRequest) -> Artifacts:
    """Write a model folder and a world file for each chosen mode.

    Each folder contains its own meshes, as is usual for Gazebo. Therefore, users can copy a single folder.
    """
    assembly = request.assembly
    shapes, flat = collect_geometry(assembly, "sdf", f"sdf/{assembly.name}_MODE/{MESHES}", request.report)
    meshes = {f"{MESHES}/{file}": stored for file, stored in shapes.assets.items()}
    files: dict[str, Content] = {}
    all_losses = dict.fromkeys((*flat, *losses("sdf", CAPABILITIES, assembly, request.robots, cut=True)))
    zeros = [zero_state(robot) for robot in request.robots]
    renamed: list[Loss] = []
    models = [
        model(robot, shapes.in_mode(robot.mode.name), zero, request.report, renamed)
        for robot, zero in zip(request.robots, zeros, strict=True)
    ]
    all_losses |= dict.fromkeys(renamed)
    raw.apply(assembly, request.robots, "sdf", models, request.report)
    for robot, zero, tree in zip(request.robots, zeros, models, strict=True):
        name = f"{assembly.name}_{robot.mode.name}"
        header = heading(assembly.definition.document, robot.mode.name)
        files[f"sdf/{name}/model.sdf"] = write(tree, header).text.encode()
        files[f"sdf/{name}/model.config"] = write(config(name, tree.get("version"), header), header).text.encode()
        files[f"sdf/world_{robot.mode.name}.sdf"] = write(world(robot, name), header).text.encode()
        files |= {f"sdf/{name}/{path}": content for path, content in meshes.items()}
        all_losses |= dict.fromkeys(_losses_of_mode(robot, zero))
    return Artifacts(files=dict(sorted(files.items())), losses=tuple(all_losses))


def _losses_of_mode(robot: Robot, zero: ZeroState) -> Iterator[Loss]:
    """Yield the export losses of one mode.

    `zero` is the state of the mode in which all joints of the SDF file are at 0. If an export loss is common to all modes, its `mode` is
    None.
    """
    mode = robot.mode
    for connection in connections(robot, CAPABILITIES["loops"], closed=zero.closed):
        yield from _joint_losses(connection, len(chain(connection, zero.q)))
    yield from _sensor_losses(robot)
    if zero.pose is not None:
        what = f"the zero pose: position 0 of each joint in the file corresponds to the pose `{zero.pose}`"
        yield Loss("sdf", mode.name, mode.name, what, "approximated", mode.origin)
    for closure in robot.closures if not zero.closed else ():
        what = "the hold of the mount" if closure.hold else "the loop through the joint"
        yield Loss("sdf", mode.name, closure.path, f"{what}: no pose of the mode closes the loops", "omitted", closure.origin)


def _joint_losses(connection: Connection, number: int) -> Iterator[Loss]:
    """Yield the export losses of a joint of the document that is written as `number` SDF joints.

    Joints that represent a base or a hold have no export losses.
    """
    if number > 1 and connection.joints:
        yield Loss("sdf", None, connection.path, "the excluded contact between the links of the joint", "omitted", connection.origin)
    for joint in (joint for joint in connection.joints[:1] if joint.kind.at_once):
        dynamics = joint.dynamics
        for name, value, unit in (
            ("damping", dynamics.damping, "N m s/rad"), ("friction", dynamics.friction, "N m"),
            ("stiffness", dynamics.stiffness, "N m/rad"),
        ):
            if value:
                what = f"the {name} of {value:.6g} {unit}: not supported by SDF for ball joints"
                yield Loss("sdf", None, connection.path, what, "omitted", joint.origin)


def _sensor_losses(robot: Robot) -> Iterator[Loss]:
    mode = robot.mode.name
    for sensor in robot.assembly.sensors:
        if sensor.kind == "force" and on_free_root(robot, sensor):
            yield Loss("sdf", mode, sensor.path, "the sensor: the root of a free base has no parent link", "omitted", sensor.origin)
        elif sensor.kind == "force" and (place := describe_force_place(robot, sensor)) is not None:
            what = f"the force at the mount: the sensor measures the force {place}"
            yield Loss("sdf", mode, sensor.path, what, "approximated", sensor.origin)
        elif sensor.kind == "contact":
            links = [robot.assembly.links[link] for link in sensor.touching]
            if not any(robot.assembly.occurrences[member].touching for member in links[0].members):
                what = "the sensor: the link of the sensor has no collision shapes"
                yield Loss("sdf", None, sensor.path, what, "omitted", sensor.origin)
            elif len(links) > 1:
                what = f"the limitation to contacts with `{links[1].name}`"
                yield Loss("sdf", None, sensor.path, what, "omitted", sensor.origin)



GRIP = 100.0
"""Coefficient of friction of the floor.

Gazebo uses the smaller friction of two surfaces. Because of this large value, the friction of the robot applies, as in MuJoCo.
"""

RENDERING = ("sensors", "Sensors")
"""The Gazebo system that a world with cameras or rays must contain."""

ALWAYS = (("physics", "Physics"), ("user-commands", "UserCommands"), ("scene-broadcaster", "SceneBroadcaster"))
"""The Gazebo systems of every world."""

SYSTEMS: dict[SensorForm, tuple[str, str]] = {
    "imu": ("imu", "Imu"), "force_torque": ("forcetorque", "ForceTorque"), "magnetometer": ("magnetometer", "Magnetometer"),
    "contact": ("contact", "Contact"), "camera": RENDERING, "gpu_lidar": RENDERING,
}
"""The Gazebo system that a world must contain for each type of sensor."""


def config(name: str, version: str, description: str) -> Element:
    """Return the root element of the file `model.config` for the SDF model `name`."""
    root = Element(tag="model")
    root.fill({"name": name, "version": "1.0"})
    root.children.append(Element(tag="sdf", attributes={"version": version}, text="model.sdf"))
    root.add_text("description", description)
    return root


def world(robot: Robot, folder: str) -> Element:
    """Return the SDF world of a mode. The world includes the model in the folder `folder`.

    The world defines gravity, a time step and a light, and contains a floor in the plane z = 0.
    """
    root = Element(tag="sdf", attributes={"version": PLAIN}, origin=robot.mode.origin)
    element = root.add("world", {"name": f"{robot.assembly.name}_{robot.mode.name}"}, robot.mode.origin)
    timestep = {**robot.assembly.definition.simulation, **robot.mode.simulation}.get("timestep")
    if timestep is not None:
        physics = element.add("physics", {"name": "stepped", "type": "ode"})
        physics.fill({"max_step_size": timestep, "real_time_factor": "1"})
    forms = {written_as(CAPABILITIES["sensors"][sensor.kind]) for sensor in robot.assembly.sensors}
    for system in dict.fromkeys((*ALWAYS, *(system for form, system in SYSTEMS.items() if form in forms))):
        plugin = element.add("plugin", gazebo_system(*system))
        if system == RENDERING:
            plugin.add_text("render_engine", "ogre2")
    element.add_text("gravity", robot.gravity)
    _light(element, "sun" if robot.assembly.name != "sun" else "light")
    _floor(element, "floor" if robot.assembly.name != "floor" else "ground")
    include = element.add("include")
    include.add_text("uri", f"model://{folder}")
    height = _start_height(robot)
    if height:
        include.add_text("pose", (0.0, 0.0, height, 0.0, 0.0, 0.0))
    return root


def _start_height(robot: Robot) -> float:
    """Return the height [m] at which a robot with a free base starts, so that no part is below the floor with all joints at 0."""
    box = bounds(*placements(robot)) if robot.base == "free" and not robot.closures else None
    return 0.0 if box is None else numeric.maximum(0.0, -box[0][2])


def _light(world: Element, name: str) -> None:
    world.add("light", {"name": name, "type": "directional"}).fill({
        "cast_shadows": "true", "pose": "0 0 10 0 0 0", "diffuse": "0.8 0.8 0.8 1", "specular": "0.2 0.2 0.2 1",
        "direction": "-0.5 0.1 -0.9",
    })


def _floor(world: Element, name: str) -> None:
    floor = world.add("model", {"name": name})
    floor.add_text("static", "true")
    link = floor.add("link", {"name": "link"})
    for tag in ("collision", "visual"):
        element = link.add(tag, {"name": tag})
        element.add("geometry").add("plane").fill({"normal": "0 0 1", "size": "100 100"})
        if tag == "collision":
            element.add("surface").add("friction").add("ode").fill({"mu": GRIP, "mu2": GRIP})
        else:
            element.add("material").fill({"ambient": "0.8 0.8 0.8 1", "diffuse": "0.8 0.8 0.8 1"})

"""Files that accompany a model: `model.config`, which Gazebo needs to find the model, and a world with a floor."""

from __future__ import annotations

from thingc.base import numeric
from thingc.model.robot.types import Robot
from thingc.targets.capabilities import written
from thingc.targets.geometry import bounds, placements
from thingc.targets.sdf.capabilities import CAPABILITIES, SensorForm
from thingc.targets.sdf.model_element import PLAIN
from thingc.targets.xml_writer import Element

GRIP = 100.0
"""Friction of the floor.

Gazebo uses the smaller friction of two surfaces. This large value selects the friction of the robot, as in MuJoCo.
"""

RENDERING = ("gz-sim-sensors-system", "gz::sim::systems::Sensors")
"""The Gazebo system that all cameras and rays need in the world."""

SYSTEMS: dict[SensorForm, tuple[str, str]] = {
    "imu": ("gz-sim-imu-system", "gz::sim::systems::Imu"), "force_torque": ("gz-sim-forcetorque-system", "gz::sim::systems::ForceTorque"),
    "magnetometer": ("gz-sim-magnetometer-system", "gz::sim::systems::Magnetometer"),
    "contact": ("gz-sim-contact-system", "gz::sim::systems::Contact"), "camera": RENDERING, "gpu_lidar": RENDERING,
}
"""The Gazebo system that each type of sensor needs in the world."""


def config(name: str, version: str, description: str) -> Element:
    """Return `model.config` of the model in a folder with this name."""
    root = Element(tag="model")
    root.say("name", name)
    root.say("version", "1.0")
    root.children.append(Element(tag="sdf", attributes={"version": version}, text="model.sdf"))
    root.say("description", description)
    return root


def world(robot: Robot, folder: str) -> Element:
    """Return the world of a mode with the model in `folder`: its gravity and time step, a light, and the plane z = 0 as floor."""
    root = Element(tag="sdf", attributes={"version": PLAIN}, origin=robot.mode.origin)
    element = root.add("world", {"name": f"{robot.assembly.name}_{robot.mode.name}"}, robot.mode.origin)
    timestep = {**robot.assembly.definition.simulation, **robot.mode.simulation}.get("timestep")
    if timestep is not None:
        physics = element.add("physics", {"name": "stepped", "type": "ode"})
        physics.say("max_step_size", timestep)
        physics.say("real_time_factor", "1")
    for name in ("physics", "user-commands", "scene-broadcaster"):
        system = "".join(word.capitalize() for word in name.split("-"))
        element.add("plugin", {"filename": f"gz-sim-{name}-system", "name": f"gz::sim::systems::{system}"})
    forms = {written(CAPABILITIES["sensors"][sensor.kind]) for sensor in robot.assembly.sensors}
    for filename, name in dict.fromkeys(system for form, system in SYSTEMS.items() if form in forms):
        plugin = element.add("plugin", {"filename": filename, "name": name})
        if (filename, name) == RENDERING:
            plugin.say("render_engine", "ogre2")
    element.say("gravity", robot.gravity)
    _light(element, "sun" if robot.assembly.name != "sun" else "light")
    _floor(element, "floor" if robot.assembly.name != "floor" else "ground")
    include = element.add("include")
    include.say("uri", f"model://{folder}")
    lift = _lift(robot)
    if lift:
        include.say("pose", (0.0, 0.0, lift, 0.0, 0.0, 0.0))
    return root


def _lift(robot: Robot) -> float:
    """Return the height [m] by which a floating robot must be lifted so that no part is below the floor with all joints at 0."""
    box = bounds(*placements(robot)) if robot.base == "free" and not robot.closures else None
    return 0.0 if box is None else numeric.maximum(0.0, -box[0][2])


def _light(world: Element, name: str) -> None:
    light = world.add("light", {"name": name, "type": "directional"})
    light.say("cast_shadows", "true")
    light.say("pose", "0 0 10 0 0 0")
    light.say("diffuse", "0.8 0.8 0.8 1")
    light.say("specular", "0.2 0.2 0.2 1")
    light.say("direction", "-0.5 0.1 -0.9")


def _floor(world: Element, name: str) -> None:
    floor = world.add("model", {"name": name})
    floor.say("static", "true")
    link = floor.add("link", {"name": "link"})
    for tag in ("collision", "visual"):
        element = link.add(tag, {"name": tag})
        plane = element.add("geometry").add("plane")
        plane.say("normal", "0 0 1")
        plane.say("size", "100 100")
        if tag == "collision":
            ode = element.add("surface").add("friction").add("ode")
            ode.say("mu", GRIP)
            ode.say("mu2", GRIP)
        else:
            material = element.add("material")
            for word in ("ambient", "diffuse"):
                material.say(word, "0.8 0.8 0.8 1")

"""Write sensors as MJCF elements. Each reading of a sensor becomes an element (`imu:gyro`), and each camera becomes a `camera`.

A sensor has the same elements with the same names in every mode that supports it. Therefore, a controller reads the same layout in all
modes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from thingc.base import numeric
from thingc.base.joints.kinds import stays
from thingc.base.pose import turned_y
from thingc.base.sensor_kinds import SENSORS, ReadingName, SensorType
from thingc.model.assembly.types import LinkedSensor
from thingc.model.robot.types import Robot
from thingc.targets.artifact import How, Loss
from thingc.targets.capabilities import is_written
from thingc.targets.mjcf import merged_joints, tendons
from thingc.targets.mjcf.capabilities import CAPABILITIES
from thingc.targets.mjcf.elements import pose_attributes
from thingc.targets.sensors import body_of, describe_force_place, on_free_root
from thingc.targets.xml_writer import Element, XmlValue

LOOKING = turned_y(numeric.pi)
"""Rotation from the camera of a document to the camera of MuJoCo. The camera of a document looks along the z axis of the mount, with y up.
The camera of MuJoCo looks along -z, with y up.
"""

ELEMENTS: Mapping[SensorType, Mapping[ReadingName, str]] = {
    "imu": {"accelerometer": "accelerometer", "gyro": "gyro", "quat": "framequat"},
    "force": {"force": "force", "torque": "torque"},
    "joint": {"position": "jointpos", "velocity": "jointvel", "effort": "jointactuatorfrc"},
    "camera": {},
    "accelerometer": {"accelerometer": "accelerometer"},
    "gyro": {"gyro": "gyro"},
    "magnetometer": {"magnetometer": "magnetometer"},
    "velocimeter": {"velocity": "velocimeter"},
    "rangefinder": {"distance": "rangefinder"},
    "touch": {"force": "touch"},
    "contact": {"contact": "contact"},
    "pose": {"position": "framepos", "quat": "framequat"},
    "twist": {"linear": "framelinvel", "angular": "frameangvel"},
    "centre": {"position": "subtreecom", "velocity": "subtreelinvel", "momentum": "subtreeangmom"},
    "tendon": {"length": "tendonpos", "velocity": "tendonvel", "effort": "tendonactuatorfrc"},
    "drive": {"position": "actuatorpos", "velocity": "actuatorvel", "effort": "actuatorfrc"},
    "clock": {"time": "clock"},
    "energy": {"potential": "e_potential", "kinetic": "e_kinetic"},
}
"""The MJCF element for each kind of sensor and for each of its readings."""


def cameras(robot: Robot, bodies: Mapping[int, Element]) -> None:
    """Add a `camera` element to the MJCF model for each mount with a camera sensor.

    The attribute `fovy` is the vertical field of view, which is always in degrees.
    """
    sites = merged_joints.sites(robot)
    for sensor in robot.assembly.sensors:
        if is_written(CAPABILITIES["sensors"][sensor.kind]) and (sensor.site or "") in sites and sensor.fovy is not None:
            site = sites[sensor.site or ""]
            # round the angle, because 60 deg would become 59.99999999999999
            degrees = numeric.round_significant(numeric.degrees(sensor.fovy), 12)
            attributes = {"name": sensor.path, **pose_attributes(site.pose @ LOOKING), "fovy": degrees}
            bodies[site.body].add("camera", attributes, sensor.origin)


def volumes(robot: Robot, bodies: Mapping[int, Element]) -> None:
    """For each touch sensor, add a site that has the shape of the sensor's volume."""
    sites = merged_joints.sites(robot)
    for sensor in robot.assembly.sensors:
        if sensor.volume is not None and (sensor.site or "") in sites:
            site = sites[sensor.site or ""]
            attributes: dict[str, XmlValue] = {"name": _volume(sensor), "type": sensor.volume.shape, "size": sensor.volume.size}
            bodies[site.body].add("site", attributes | pose_attributes(site.pose), sensor.origin)


def _volume(sensor: LinkedSensor) -> str:
    return f"{sensor.path}:volume"


def sensors(robot: Robot, section: Element) -> None:
    """Add the sensors of the robot to the section `sensor` of the MJCF model, in the order of the documents. Cameras have no readings."""
    for sensor in robot.assembly.sensors:
        if not is_written(CAPABILITIES["sensors"][sensor.kind]) or _missing(robot, sensor):
            continue
        for reading in SENSORS[sensor.kind].readings:
            attributes: dict[str, XmlValue] = {"name": sensor.part(reading.name), **_objects(robot, sensor, reading.name)}
            by_reading = {"noise": sensor.noise, "cutoff": sensor.cutoff}
            attributes |= {key: values[reading.name] for key, values in by_reading.items() if reading.name in values}
            section.add(ELEMENTS[sensor.kind][reading.name], attributes, sensor.origin)


def _objects(robot: Robot, sensor: LinkedSensor, reading: ReadingName) -> dict[str, str]:
    """Return the attributes that specify which object a sensor measures."""
    links, site = robot.assembly.links, {"site": sensor.site or ""}
    match sensor.kind:
        case "imu" if reading == "quat":
            return {"objtype": "site", "objname": sensor.site or ""}
        case "imu" | "force" | "accelerometer" | "gyro" | "magnetometer" | "velocimeter" | "rangefinder":
            return site
        case "touch":
            return {"site": _volume(sensor)}
        case "contact":
            bodies = {f"body{place}": links[link].name for place, link in enumerate(sensor.touching, 1)}
            return {**bodies, "reduce": "netforce", "data": "found force"}
        case "pose" | "twist":
            seen = {} if sensor.seen_from is None else {"reftype": "site", "refname": sensor.seen_from.path}
            return {"objtype": "site", "objname": sensor.site or "", **seen}
        case "centre":
            return {"body": links[robot.bodies[0].link].name}
        case "joint":
            return {"joint": sensor.joint or ""}
        case "tendon":
            return {"tendon": sensor.tendon or ""}
        case "drive":
            return {"actuator": robot.assembly.drives[sensor.joint or sensor.tendon or ""]}
        case "camera" | "clock" | "energy":
            return {}


def _missing(robot: Robot, sensor: LinkedSensor) -> str:
    """Return the reason why a mode does not support a sensor, as a text for the export loss. Return an empty string if the mode supports
    the sensor.
    """
    sites = merged_joints.sites(robot)
    if any(mount.path not in sites for mount in sensor.mounts):
        return "MuJoCo does not support sites between two joints of a body"
    if sensor.kind == "force" and on_free_root(robot, sensor):
        return "the root of a free base has no parent link"
    bodies = {body.link for body in merged_joints.model_bodies(robot).values()}
    if not bodies.issuperset(sensor.touching):
        return "the link of the sensor does not exist in MuJoCo"
    movable = {joint.path for body in robot.bodies for joint in body.joints}
    if sensor.joint is not None and sensor.joint not in movable:
        return f"a loop is cut at joint `{sensor.joint}`"
    if sensor.tendon is not None and sensor.tendon not in {tendon.path for tendon in tendons.present(robot)}:
        return f"the mode has no tendon `{sensor.tendon}`"
    driven = {*robot.present, *(tendon.path for tendon in tendons.driven_tendons(robot))}
    if sensor.kind == "drive" and (sensor.joint or sensor.tendon) not in driven:
        return f"the mode has no drive of `{sensor.joint or sensor.tendon}`"
    return ""


def losses(robot: Robot) -> Iterator[Loss]:
    """Yield an export loss for each sensor, or property of a sensor, that a mode does not support.

    The losses concern unsupported sensors, forces that are not measured at the mount, and accelerations of a fixed base. On a fixed body,
    MuJoCo's accelerometer reads 0. On any other body at rest, it reads 9.81 m/s^2.
    """
    for sensor in robot.assembly.sensors:
        how: How = "approximated"
        if missing := _missing(robot, sensor):
            what, how = f"the sensor: {missing}", "omitted"
        elif sensor.kind in ("imu", "accelerometer") and stays(robot.base) and body_of(robot, sensor) == 0:
            what = "gravity in the accelerometer: MuJoCo reports no acceleration for a body at rest"
        elif sensor.kind == "force" and (place := describe_force_place(robot, sensor)) is not None:
            what = f"the force at the mount: the sensor measures the force {place}"
        else:
            continue
        yield Loss("mjcf", robot.mode.name, sensor.path, what, how, sensor.origin)

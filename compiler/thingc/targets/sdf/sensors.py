"""Write the sensors of a robot that SDF supports. Sensors are written to links. Only a `force` sensor becomes a `force_torque` sensor on
the joint of its link.
"""

from __future__ import annotations

from collections.abc import Iterator

from thingc.base import numeric
from thingc.base.pose import Pose, Vector, make_translation, rpy_of
from thingc.model.assembly.types import LinkedSensor
from thingc.model.robot.types import Robot, Site
from thingc.targets.capabilities import written_as
from thingc.targets.name_mangling import MangledNames
from thingc.targets.sdf.capabilities import CAPABILITIES, SensorForm
from thingc.targets.sensors import body_of, on_free_root
from thingc.targets.xml_writer import Element

LOOKING = Pose(rotation=((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
"""Rotation from the camera of a document to the camera of SDF. The camera of a document looks along the z axis of the mount, with y up. The
camera of SDF looks along x, with z up.
"""

WIDTH, HEIGHT = 640, 480
"""Width and height of the pictures of a camera [pixels]. Documents do not specify this size."""

NEAR, FAR = 0.01, 100.0
"""Distances of the near and the far plane of a camera [m]."""

RATE = 30.0
"""Number of pictures that a camera takes per second."""


def sensors_of_link(robot: Robot, body: int, link: Element, names: MangledNames) -> None:
    """Add all sensors of a link, except force sensors, to its SDF element. The collision elements of the link must already have been
    added.
    """
    for sensor, site in _on(robot, body):
        form = written_as(CAPABILITIES["sensors"][sensor.kind])
        match form:
            case "imu" | "magnetometer":
                _sensor(link, sensor, form, site.pose, names)
            case "camera":
                if sensor.fovy is not None:
                    _camera(_sensor(link, sensor, form, site.pose @ LOOKING, names), sensor.fovy)
            case "gpu_lidar":
                _ray(_sensor(link, sensor, form, site.pose @ LOOKING, names), sensor.cutoff.get("distance", numeric.inf))
            case "force_torque" | "contact" | None:
                pass  # the sensor belongs to the joint of the link, or is not on a mount
    collisions = [child.get("name") for child in link.children if child.tag == "collision"]
    for sensor in robot.assembly.sensors:
        if written_as(CAPABILITIES["sensors"][sensor.kind]) == "contact" and sensor.touching[0] == robot.bodies[body].link and collisions:
            contact = _sensor(link, sensor, "contact", None, names).add("contact")
            for name in collisions:
                contact.add_text("collision", name)


def _sensor(parent: Element, sensor: LinkedSensor, form: SensorForm, pose: Pose | None, names: MangledNames) -> Element:
    element = parent.add("sensor", {"name": names.take(sensor.path, sensor.origin), "type": form}, sensor.origin)
    if pose is not None:
        element.add_text("pose", (*pose.translation, *rpy_of(pose.rotation)))
    element.add_text("always_on", "true")
    return element


def _camera(element: Element, fovy: float) -> None:
    """Add a `<camera>` element to an SDF sensor. The horizontal field of view is computed from the vertical field of view `fovy` [rad]."""
    element.add_text("update_rate", RATE)
    camera = element.add("camera")
    camera.add_text("horizontal_fov", 2.0 * numeric.atan(numeric.tan(fovy / 2.0) * WIDTH / HEIGHT))
    camera.add("image").fill({"width": WIDTH, "height": HEIGHT})
    camera.add("clip").fill({"near": NEAR, "far": FAR})


def _ray(element: Element, reach: float) -> None:
    """Add a single ray with a range of `reach` [m] to an SDF sensor."""
    element.add_text("update_rate", RATE)
    lidar = element.add("lidar")
    lidar.add("scan").add("horizontal").fill({"samples": "1", "min_angle": "0", "max_angle": "0"})
    lidar.add("range").fill({"min": "0", "max": "inf" if numeric.isinf(reach) else reach})


def sensors_of_joint(robot: Robot, body: int, at: Vector, joint: Element, names: MangledNames) -> None:
    """Add the force sensors of a link to its joint. `at` [m] is the position of the joint in the frame of the link.

    As in MuJoCo, the sensor measures the force that the link exerts on its parent.
    """
    for sensor, site in _on(robot, body):
        if written_as(CAPABILITIES["sensors"][sensor.kind]) == "force_torque" and not on_free_root(robot, sensor):
            element = _sensor(joint, sensor, "force_torque", make_translation(*at).inverse() @ site.pose, names)
            element.add("force_torque").fill({"frame": "sensor", "measure_direction": "child_to_parent"})


def _on(robot: Robot, body: int) -> Iterator[tuple[LinkedSensor, Site]]:
    """Yield the sensors whose mounts are on the body with index `body`, each with its site."""
    sites = {site.path: site for site in robot.sites}
    for sensor in robot.assembly.sensors:
        if sensor.site is not None and body_of(robot, sensor) == body:
            yield sensor, sites[sensor.site]

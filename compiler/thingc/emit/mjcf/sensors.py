"""Sensors in MJCF. Each has the same elements under the same names in every mode in which it can be, so that a controller reads
one layout: `imu` an accelerometer, a gyro and an orientation, `force` a force and a torque, `joint` its position, velocity and
the effort of its actuator, `camera` a camera.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from thingc.emit.artifact import Loss
from thingc.emit.capabilities import written
from thingc.emit.mjcf import joined
from thingc.emit.mjcf.capabilities import CAPABILITIES
from thingc.emit.mjcf.poses import pose_attributes
from thingc.emit.sensors import body_of, elsewhere, on_free_root
from thingc.emit.xml import Element, number
from thingc.joints.bases import stays
from thingc.pose import turned_y
from thingc.robot.types import Robot

LOOKING = turned_y(math.pi)
"""A camera of MuJoCo looks along its -z, up its y; ours looks along the mount's z, up the mount's y."""


def cameras(robot: Robot, bodies: Mapping[int, Element]) -> None:
    """A camera at each mount that has one. `fovy` is the vertical angle of view, in degrees whatever the file's angles are in."""
    sites = joined.sites(robot)
    for sensor in robot.assembly.sensors:
        if written(CAPABILITIES["sensors"][sensor.kind]) == "camera" and (sensor.site or "") in sites and sensor.fovy is not None:
            site = sites[sensor.site or ""]
            # MJCF has degrees here whatever the compiler's `angle` says; 60 deg must not come back as 59.99999999999999
            degrees = float(f"{math.degrees(sensor.fovy):.12g}")
            attributes = {"name": sensor.path, **pose_attributes(site.pose @ LOOKING), "fovy": number(degrees)}
            bodies[site.body].add("camera", attributes, sensor.origin)


def sensors(robot: Robot, section: Element) -> None:
    """The section `sensor`, in the order of the documents."""
    movable = {joint.path for body in robot.bodies for joint in body.joints}
    sites = joined.sites(robot)
    for sensor in robot.assembly.sensors:
        site, form = sensor.site or "", written(CAPABILITIES["sensors"][sensor.kind])
        if site and site not in sites:
            continue
        if form == "imu":
            section.add("accelerometer", {"name": f"{sensor.path}:accelerometer", "site": site}, sensor.origin)
            section.add("gyro", {"name": f"{sensor.path}:gyro", "site": site}, sensor.origin)
            section.add("framequat", {"name": f"{sensor.path}:quat", "objtype": "site", "objname": site}, sensor.origin)
        elif form == "force" and not on_free_root(robot, sensor):
            section.add("force", {"name": f"{sensor.path}:force", "site": site}, sensor.origin)
            section.add("torque", {"name": f"{sensor.path}:torque", "site": site}, sensor.origin)
        elif form == "joint" and sensor.joint in movable:
            section.add("jointpos", {"name": f"{sensor.path}:position", "joint": sensor.joint or ""}, sensor.origin)
            section.add("jointvel", {"name": f"{sensor.path}:velocity", "joint": sensor.joint or ""}, sensor.origin)
            section.add("jointactuatorfrc", {"name": f"{sensor.path}:effort", "joint": sensor.joint or ""}, sensor.origin)


def losses(robot: Robot) -> Iterator[Loss]:
    """Sensors that this mode cannot have, forces that it measures elsewhere than at the mount, and accelerations of what stands
    still (there MuJoCo's accelerometer reads 0, not the 9.81 m/s^2 of any that rests)."""
    cut = {joint.path for closure in robot.closures for joint in closure.joints}
    for sensor in robot.assembly.sensors:
        what, how = "", "omitted"
        if sensor.site is not None and joined.joins(robot, body_of(robot, sensor)):
            what = "it: MuJoCo has nothing between two joints of a body that it could sit on"
        elif sensor.kind == "imu" and stays(robot.base) and body_of(robot, sensor) == 0:
            what, how = "gravity in its accelerometer: MuJoCo gives no acceleration of a body that stands still", "approximated"
        elif sensor.kind == "force":
            if on_free_root(robot, sensor):
                what = "it: nothing carries the root of a free base"
            else:
                place = elsewhere(robot, sensor)
                if place is not None:
                    what, how = f"the force at its mount: it reads what passes {place}", "approximated"
        elif sensor.kind == "joint" and sensor.joint in cut:
            what = f"it: a loop is cut at joint `{sensor.joint}`"
        if what:
            yield Loss.of(sensor.origin, "mjcf", robot.mode.name, sensor.path, what, how)

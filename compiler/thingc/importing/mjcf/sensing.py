"""Sensors and cameras of the source."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from thingc.importing.mjcf.original import Original, pose_of
from thingc.importing.model import SourceSensor
from thingc.pose import Pose, turned_y

SITE = 6
Ours = Literal["imu", "force", "joint"]
AT_SITE: dict[str, tuple[Ours, str]] = {
    "accelerometer": ("imu", "accelerometer"), "gyro": ("imu", "gyro"), "force": ("force", "force"), "torque": ("force", "torque"),
    "framequat": ("imu", "quat"),
}
AT_JOINT = {"jointpos": "position", "jointvel": "velocity", "jointactuatorfrc": "effort"}
LOOKING = turned_y(math.pi)
"""A camera of MuJoCo looks along its -z, up its y; a document's along the mount's z, up the mount's y."""


def sensors(original: Original, on: Mapping[int, tuple[int, Pose]], kept: set[int]) -> tuple[SourceSensor, ...]:
    """Those of kinds that the language has, several that are of one together; all others are losses."""
    import mujoco

    model = original.model
    kinds = {int(value): name.removeprefix("mjSENS_").lower() for name, value in mujoco.mjtSensor.__members__.items()}
    found: dict[tuple[str, str], SourceSensor] = {}
    for number in range(model.nsensor):
        name, where, thing = original.sensors[number], original.where("sensor", number), int(model.sensor_objid[number])
        kind, at_site = kinds.get(int(model.sensor_type[number]), "sensor"), int(model.sensor_objtype[number]) == SITE
        site: str | None = None
        joint: str | None = None
        ours: Ours
        if at_site and kind in AT_SITE and int(model.site_bodyid[thing]) in kept:
            (ours, part), site = AT_SITE[kind], original.sites[thing]
        elif kind in AT_JOINT and int(model.jnt_bodyid[thing]) in kept:
            ours, part, joint = "joint", AT_JOINT[kind], original.joints[thing]
        else:
            original.lose(f"sensor `{name}` of kind `{kind}`", "a document has no such sensor", where)
            continue
        key = ours, site or joint or ""
        first = found.get(key)
        if first is None:
            first = SourceSensor(kind=ours, name=key[1], where=where, site=site, joint=joint)
        found[key] = SourceSensor(
            kind=first.kind, name=first.name, where=first.where, site=site, joint=joint, parts=(*first.parts, (name, part)),
        )
        if model.sensor_cutoff[number] or model.sensor_noise[number]:
            original.lose(f"cutoff and noise of sensor `{name}`", "a document does not say them", where)
    return (*found.values(), *_cameras(original, on))


def _cameras(original: Original, on: Mapping[int, tuple[int, Pose]]) -> list[SourceSensor]:
    model, found = original.model, []
    for number in range(model.ncam):
        body, where = int(model.cam_bodyid[number]), original.where("camera", number)
        why = "it follows what it looks at" if int(model.cam_mode[number]) else "" if body in on else "it is on no link of the robot"
        if why:
            original.lose(f"camera `{original.cameras[number]}`", why, where)
            continue
        link, pose = on[body]
        found.append(SourceSensor(
            kind="camera", name=original.cameras[number], where=where, link=original.bodies[link],
            pose=pose @ pose_of(model.cam_pos[number], model.cam_quat[number]) @ LOOKING, fovy=math.radians(model.cam_fovy[number]),
        ))
    return found

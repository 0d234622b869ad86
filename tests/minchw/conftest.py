"""MInchW, built once per run by the command line into a folder that all tests read, and its planar kinematics. Lengths are in mm, angles
in degrees. The numbers come from the drawings: an XM430 is 35.25 mm from its axis to its bottom, and its output corners pass at
hypot(14.25, 11.25) mm. An XM540 is 44.75 mm from its axis to its bottom."""

from __future__ import annotations

from collections.abc import Mapping
from math import asin, cos, degrees, hypot, radians, sin
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from conformance.harness import built
from thingc.geometry.worker.lazy_build123d import import_cheaply

import_cheaply("build123d")  # modules of tests use it, and a worker imports it in the same way, in half of the time

DOCUMENT = "assemblies/minchw/minchw.yaml"
MODES = tuple(f"{mode}{where}" for mode in ("front_foot", "rear_foot", "crawl") for where in ("", "_wall", "_ceiling"))

CASE, END, TRAY, HEAD = 94.7, 5.0, 74.0, 2.5 + 0.5
AXIS = 24.0 + 0.5
"""Height of the axes of the knees over the belly: the forks are 38 + 2 x 5 mm high, and half a millimetre above the floor."""
YAW_TO_KNEE = hypot(14.25, 11.25) + 0.5 + 5.0 + 44.75
THIGH = 64.0
ANKLE_TO_SOLE = 44.75 + 5.0 + 20.0
FRONT_YAW = TRAY / 2 + HEAD + END + 35.25
"""Distance from the front yaw axis to the frame of the body. The rear yaw axis is CASE + 2 x 35.25 mm behind it."""
REAR_YAW = CASE + 2 * 35.25 - FRONT_YAW

POSES = {
    "stretched": {},
    "arched": {"front/knee": 100, "front/ankle": 100, "rear/knee": 100, "rear/ankle": 100},
    "step_front": {"rear/knee": 56, "rear/ankle": 60, "front/knee": 49, "front/ankle": 45},
    "step_rear": {"front/knee": 54, "front/ankle": 60, "rear/knee": 106, "rear/ankle": 100},
    "lying": dict.fromkeys(("front/knee", "front/ankle", "rear/knee", "rear/ankle"), -degrees(asin(45.2 / 64))),
}
"""The poses of the document [deg]. The other joints are at 0."""


def sole(leg: str, q: Mapping[str, float]) -> tuple[float, float, float]:
    """Return x and z [mm] of the middle of a sole in the frame of the body with both yaw joints at 0, and the pitch of the foot [deg]."""
    knee, ankle = q.get(f"{leg}/knee", 0.0), q.get(f"{leg}/ankle", 0.0)
    out = (FRONT_YAW if leg == "front" else REAR_YAW) + YAW_TO_KNEE + THIGH * cos(radians(knee))
    up = ankle - knee
    x = out + ANKLE_TO_SOLE * sin(radians(up))
    z = AXIS - THIGH * sin(radians(knee)) - ANKLE_TO_SOLE * cos(radians(up))
    return (x if leg == "front" else -x), z, up


def pose_of(model: mujoco.MjModel, pose: str) -> mujoco.MjData:
    """Return the state of a named pose, whether or not the model has a keyframe for it. The base has the pose of the model."""
    data = mujoco.MjData(model)
    for joint, angle in POSES[pose].items():
        data.joint(joint).qpos = radians(angle)
    mujoco.mj_forward(model, data)
    return data


@pytest.fixture(scope="session")
def minchw(shared_store: str) -> Path:
    """The folder `minchw` of a build without `--emit`."""
    return built(DOCUMENT, shared_store)


@pytest.fixture(scope="session")
def models(minchw: Path) -> dict[str, mujoco.MjModel]:
    """The scene of each mode (the robot on a floor)."""
    return {mode: mujoco.MjModel.from_xml_path(str(minchw / "mjcf" / f"scene_{mode}.xml")) for mode in MODES}


@pytest.fixture(scope="session")
def vertices(minchw: Path) -> dict[str, trimesh.Trimesh]:
    """The mesh for display of each part by name, in the frame of the part [m]."""
    return {path.stem: trimesh.load(path, process=False, force="mesh") for path in (minchw / "mjcf" / "assets").glob("*.obj")}


def meshes_in(model: mujoco.MjModel) -> dict[str, str]:
    """Return the name of the mesh of each visible part."""
    names = {}
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        if model.geom_dataid[geom] >= 0 and ":" not in name:
            names[name] = model.mesh(int(model.geom_dataid[geom])).name
    return names


def matrix(location) -> np.ndarray:
    """Return the homogeneous matrix [mm] of a build123d Location, read from the transformation of the CAD kernel."""
    t = location.wrapped.Transformation()
    return np.array([[t.Value(i, j) for j in range(1, 5)] for i in range(1, 4)] + [[0.0, 0, 0, 1]])

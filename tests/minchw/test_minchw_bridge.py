"""The mode `bridge`, in which both feet are held, so that the world closes a loop; and the sensors. They are compared with MuJoCo's
kinematics and with matrices."""

from __future__ import annotations

import copy
import json
from math import cos, radians, sin
from pathlib import Path

import mujoco
import numpy as np
import pytest

from .conftest import FRONT_YAW, POSES, REAR_YAW, THIGH, YAW_TO_KNEE

BRIDGES = ("bridge", "bridge_wall", "bridge_ceiling")
EXACT = 1e-9
HELD = (0.006 - 0.20731 - 0.0947 - 0.128 * cos(radians(100)), 0.0, 0.008)
"""Where the document holds the rear sole [m], computed from the parameters of the document."""
MATE = np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, -1]])


@pytest.fixture(scope="module")
def bridges(minchw: Path) -> dict[str, mujoco.MjModel]:
    """The model of each mode."""
    return {mode: mujoco.MjModel.from_xml_path(str(minchw / "mjcf" / f"minchw_{mode}.xml")) for mode in BRIDGES}


def start(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return data


def pitched(degrees: float) -> np.ndarray:
    c, s = cos(radians(degrees)), sin(radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


@pytest.mark.parametrize("mode", BRIDGES)
def test_soles_are_at_the_held_poses(bridges: dict[str, mujoco.MjModel], mode: str) -> None:
    data = start(bridges[mode])
    front, rear = data.site("front/sole"), data.site("rear/sole")
    assert front.xpos == pytest.approx(np.zeros(3), abs=EXACT)
    assert front.xmat.reshape(3, 3) == pytest.approx(MATE, abs=EXACT)
    assert rear.xpos == pytest.approx(HELD, abs=EXACT)
    assert rear.xmat.reshape(3, 3) == pytest.approx(np.diag([-1.0, -1, 1]) @ pitched(3) @ MATE, abs=EXACT)


def test_hold_differs_from_the_pose(minchw: Path) -> None:
    """In the pose `arched` alone, the soles are below the ankles, which are up to 280 mm apart."""
    knee = radians(POSES["arched"]["front/knee"])
    apart = FRONT_YAW + REAR_YAW + 2 * YAW_TO_KNEE + 2 * THIGH * cos(knee)
    assert apart == pytest.approx(280.0, abs=1.0)
    away = 1000 * np.array(HELD) + [apart, 0, 0]
    assert np.linalg.norm(away) == pytest.approx(10.0, abs=0.1)
    described = json.loads((minchw / "modes.json").read_text())["bridge"]
    (path, hold), = described["holds"].items()
    assert path == "rear/sole" and hold["link"] == "rear/foot"
    assert set(described["poses"]) == {"arched"}
    moved = [abs(q - radians(POSES["arched"].get(joint, 0.0))) for joint, q in described["poses"]["arched"].items()]
    assert 0.01 < max(moved) < radians(30)


@pytest.mark.parametrize("mode", BRIDGES)
def test_loop_is_closed_and_stays_closed(bridges: dict[str, mujoco.MjModel], mode: str) -> None:
    model = bridges[mode]
    data = start(model)
    rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    assert rows.sum() == 6 and np.abs(data.efc_pos[rows]).max() < EXACT
    for _ in range(500):
        mujoco.mj_step(model, data)
    # what MuJoCo's softness leaves of two kilograms on a hold
    assert data.site("rear/sole").xpos == pytest.approx(HELD, abs=1e-4)


def test_camera_looks_out_of_the_lens_in_every_mode(models: dict[str, mujoco.MjModel], bridges: dict[str, mujoco.MjModel]) -> None:
    for mode, model in {**bridges, **models}.items():
        data = start(model)
        assert model.camera("eye").fovy[0] == 60.0
        # MuJoCo's cameras look along their own -z; a mount's z is out of the material
        lens = data.site("lens").xmat.reshape(3, 3)
        assert -data.camera("eye").xmat.reshape(3, 3)[:, 2] == pytest.approx(lens[:, 2], abs=1e-9), mode


def test_sensors_equal_statics(models: dict[str, mujoco.MjModel]) -> None:
    """The robot is held on the front foot. The sensor at the rear sole carries only its foot, and the sensor at the knee measures the
    holding torque."""
    model = copy.copy(models["front_foot"])
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    data = start(model)
    data.qacc[:] = 0.0
    mujoco.mj_inverse(model, data)
    data.qfrc_applied[:] = data.qfrc_inverse
    mujoco.mj_forward(model, data)
    assert np.abs(data.qacc).max() < 1e-6
    force = data.sensor("rear_force:force").data
    assert np.linalg.norm(force) == pytest.approx(model.body("rear/foot").mass[0] * 9.81, rel=1e-6)
    assert data.sensor("front_knee:position").data[0] == data.joint("front/knee").qpos[0]
    assert data.sensor("front_knee:velocity").data[0] == 0.0
    assert data.sensor("imu:gyro").data == pytest.approx(np.zeros(3), abs=1e-9)
    imu = data.site("body/imu").xmat.reshape(3, 3)
    assert data.sensor("imu:accelerometer").data == pytest.approx(imu.T @ [0, 0, 9.81], abs=1e-5)

"""Sensor readings in MuJoCo, compared with kinematics and mechanics computed in the test and with finite differences."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from loops.robots import Array, Built, compiled

FEELER = """\
thingc: assembly/1
name: feeler
materials: {steel: {density: 7800 kg/m^3}}
components:
  base:
    link: true
    material: steel
    shapes: [{box: 200 160 20 mm}]
    mounts: {top: {xyz: 30 -20 10 mm, rpy: 0 0 30 deg}, eye: {xyz: 10 0 -10 mm, rpy: 180 0 0 deg}, edge: {xyz: 100 0 -10 mm}}
  arm:
    link: true
    material: steel
    shapes: [{capsule: {radius: 10 mm, length: 100 mm}, at: {xyz: 0 0 60 mm}}]
    mounts: {tip: {xyz: 0 10 110 mm, rpy: 20 30 0 deg}, pin: {}}
joints:
  swing:
    type: revolute
    parent: base.top
    child: arm.pin
    axis: [1, 0, 0]
    limit: {lower: -90 deg, upper: 90 deg}
    dynamics: {stiffness: 50 N*m/rad, damping: 2 N*m*s/rad}
    drive: {kind: motor, effort: 5 N*m}
tendons:
  cable: {joints: {swing: 10 mm/rad}, drive: {kind: motor, effort: 30 N}}
  slack: {joints: {swing: 3}}
mounts: {tip: arm.tip}
modes:
  free: {root: base, base: free, at: {on: floor}}
  turned: {root: arm, base: free, at: {xyz: 0 0 1 m}}
  bare: {root: base, actuators: []}
sensors:
  shaken: {type: accelerometer, at: tip, noise: 0.02 m/s^2, cutoff: 3 m/s^2}
  rate: {type: gyro, at: arm.tip}
  north: {type: magnetometer, at: arm.tip}
  speed: {type: velocimeter, at: arm.tip}
  down: {type: rangefinder, at: base.eye, range: 3 m}
  edge: {type: touch, at: base.edge, volume: {box: 40 400 10 mm}}
  foot: {type: contact, of: base}
  mine: {type: contact, of: base, with: arm}
  seen: {type: pose, at: tip, in: base.top}
  there: {type: pose, at: tip}
  moving: {type: twist, at: tip, in: base.top, noise: {angular: 0.1 rad/s}}
  going: {type: twist, at: tip}
  whole: {type: centre}
  cable: {type: tendon, tendon: cable, cutoff: {length: 30 mm}}
  pull: {type: drive, tendon: cable}
  swing: {type: drive, joint: swing, noise: {effort: 0.1 N*m}}
  now: {type: clock}
  work: {type: energy}
"""


@pytest.fixture(scope="module")
def feeler(tmp_path_factory: pytest.TempPathFactory) -> Built:
    built = compiled(tmp_path_factory.mktemp("feeler"), FEELER)
    assert not built.compilation.report.failed, built.said
    return built


def moving(model: mujoco.MjModel) -> mujoco.MjData:
    """A robot in free flight that rotates, with the swing joint at 0.4 rad."""
    data = mujoco.MjData(model)
    data.qpos[:3] += [0.1, -0.2, 0.7]
    data.qpos[3:7] = np.array([0.8, 0.2, -0.4, 0.4])
    data.joint("swing").qpos[0] = 0.4
    data.qvel[:] = [0.3, -0.5, 0.2, 1.0, -2.0, 0.7, 1.5]
    data.ctrl[:] = [0.4, 7.0]
    mujoco.mj_forward(model, data)
    return data


def read(data: mujoco.MjData, name: str) -> Array:
    return np.array(data.sensor(name).data)


def later(model: mujoco.MjModel, data: mujoco.MjData, step: float) -> mujoco.MjData:
    """The state after a short time at the current velocities."""
    there = mujoco.MjData(model)
    there.qpos[:] = data.qpos
    mujoco.mj_integratePos(model, there.qpos, data.qvel, step)
    there.qvel[:] = data.qvel
    mujoco.mj_forward(model, there)
    return there


def site(data: mujoco.MjData, name: str) -> tuple[Array, Array]:
    return np.array(data.site(name).xpos), np.array(data.site(name).xmat).reshape(3, 3)


def turn(quaternion: Array) -> Array:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def spin(before: Array, after: Array, step: float) -> Array:
    """Angular velocity between two orientations, in the axes of their reference frame."""
    w = (after - before) @ before.T / step
    return np.array([w[2, 1], w[0, 2], w[1, 0]])


@pytest.mark.parametrize("mode", ["free", "turned"])
def test_pose_and_twist_sensors_match_kinematics(feeler: Built, mode: str) -> None:
    """Poses equal those of sites; velocities equal finite differences."""
    model, step = feeler.model(mode), 1e-6
    data = moving(model)
    next_, last = later(model, data, step), later(model, data, -step)
    (tip, r_tip), (top, r_top) = site(data, "tip"), site(data, "base/top")
    assert read(data, "seen:position") == pytest.approx(r_top.T @ (tip - top), abs=1e-12)
    assert turn(read(data, "seen:quat")) == pytest.approx(r_top.T @ r_tip, abs=1e-12)
    assert read(data, "there:position") == pytest.approx(tip, abs=1e-12)
    assert turn(read(data, "there:quat")) == pytest.approx(r_tip, abs=1e-12)
    for pose, twist in (("seen", "moving"), ("there", "going")):
        linear = (read(next_, f"{pose}:position") - read(last, f"{pose}:position")) / (2.0 * step)
        assert read(data, f"{twist}:linear") == pytest.approx(linear, abs=1e-7)
        turns = [turn(read(one, f"{pose}:quat")) for one in (last, next_)]
        assert read(data, f"{twist}:angular") == pytest.approx(spin(*turns, 2.0 * step), abs=1e-5)
    assert read(data, "speed:velocity") == pytest.approx(r_tip.T @ read(data, "going:linear"), abs=1e-9)
    assert read(data, "rate:gyro") == pytest.approx(r_tip.T @ read(data, "going:angular"), abs=1e-9)
    assert read(data, "north:magnetometer") == pytest.approx(r_tip.T @ model.opt.magnetic, abs=1e-12)


@pytest.mark.parametrize("mode", ["free", "turned"])
def test_whole_robot_sensors_match_mechanics(feeler: Built, mode: str) -> None:
    """Centre of mass, its velocity, angular momentum, energies and time."""
    model, step = feeler.model(mode), 1e-6
    data = moving(model)
    masses = model.body_mass[1:]

    def centre(one: mujoco.MjData) -> Array:
        return masses @ one.xipos[1:] / masses.sum()

    velocity = (centre(later(model, data, step)) - centre(later(model, data, -step))) / (2.0 * step)
    assert read(data, "whole:position") == pytest.approx(centre(data), abs=1e-12)
    assert read(data, "whole:velocity") == pytest.approx(velocity, abs=1e-7)
    momentum = np.zeros(3)
    inertias = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertias)
    for body in range(1, model.nbody):
        linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacBodyCom(model, data, linear, angular, body)
        r = data.ximat[body].reshape(3, 3)
        momentum += r @ (model.body_inertia[body] * (r.T @ angular @ data.qvel))
        momentum += model.body_mass[body] * np.cross(data.xipos[body] - centre(data), linear @ data.qvel - velocity)
    assert read(data, "whole:momentum") == pytest.approx(momentum, abs=1e-6)
    assert read(data, "work:kinetic") == pytest.approx([0.5 * data.qvel @ inertias @ data.qvel])
    spring = 0.5 * 50.0 * 0.4**2
    assert read(data, "work:potential") == pytest.approx([9.81 * masses @ data.xipos[1:, 2] + spring])
    mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    assert read(data, "now:time") == pytest.approx([model.opt.timestep])


@pytest.mark.parametrize("mode", ["free", "turned"])
def test_tendon_and_drive_sensors(feeler: Built, mode: str) -> None:
    data = moving(feeler.model(mode))
    expected = {
        "cable": {"length": 0.004, "velocity": 0.015, "effort": 7.0}, "pull": {"position": 0.004, "velocity": 0.015, "effort": 7.0},
        "swing": {"position": 0.4, "velocity": 1.5, "effort": 0.4},
    }
    for sensor, readings in expected.items():
        assert {name: float(read(data, f"{sensor}:{name}")[0]) for name in readings} == pytest.approx(readings), sensor


def test_noise_and_cutoff_are_applied(feeler: Built) -> None:
    model = feeler.model("free")
    assert {name: float(model.sensor(name).noise[0]) for name in ("shaken:accelerometer", "moving:angular", "swing:effort")} == {
        "shaken:accelerometer": 0.02, "moving:angular": 0.1, "swing:effort": 0.1,
    }
    data = moving(model)
    data.joint("swing").qpos[0] = 1.5
    data.joint("swing").qvel[0] = 40.0  # 0.1 m from its axis: 160 m/s^2
    mujoco.mj_forward(model, data)
    assert np.abs(read(data, "shaken:accelerometer")).max() == 3.0
    data.joint("swing").qpos[0] = 4.0
    mujoco.mj_forward(model, data)
    assert read(data, "cable:length") == pytest.approx([0.03])


def test_contact_and_distance_sensors_on_the_floor(feeler: Built) -> None:
    """At rest, the contact force is the weight, its share at the edge follows from the lever, and the rangefinder measures the distance
    to the floor."""
    model = feeler.scene("free")
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=3000)
    mujoco.mj_forward(model, data)
    weight = 9.81 * model.body_mass.sum()
    number, *force = read(data, "foot:contact")
    assert number == 4.0 and force == pytest.approx([0.0, 0.0, -weight], abs=0.02 * weight)
    centre = data.subtree_com[1]
    share = weight * (centre[0] + 0.1 - data.body("base").xpos[0]) / 0.2
    assert read(data, "edge:force") == pytest.approx([share], rel=0.03)
    assert read(data, "mine:contact").tolist() == [0.0, 0.0, 0.0, 0.0]
    data.qpos[2] += 0.5
    mujoco.mj_forward(model, data)
    assert read(data, "down:distance") == pytest.approx([data.site("base/eye").xpos[2]], abs=1e-6)
    assert read(data, "edge:force").tolist() == [0.0]
    data.qpos[2] += 5.0
    mujoco.mj_forward(model, data)
    assert read(data, "down:distance") == pytest.approx([3.0])


def test_sensors_of_absent_drives_are_losses(feeler: Built) -> None:
    assert [(loss.path, loss.what, loss.how) for loss in feeler.losses("bare")] == [
        ("pull", "the sensor: the mode has no drive of `cable`", "omitted"),
        ("swing", "the sensor: the mode has no drive of `swing`", "omitted"),
    ]
    names = {feeler.model("bare").sensor(k).name for k in range(feeler.model("bare").nsensor)}
    assert "cable:length" in names and not any(name.startswith(("pull:", "swing:")) for name in names)

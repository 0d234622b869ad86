"""Several joints on one body, compared with a written-out MuJoCo model, and the restrictions on massless links between joints."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np
import pytest

from loops.robots import compiled
from modes.switching_robots import mass_matrix
from thingc.base.diagnostics import Code
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.targets.artifact import Artifacts

INERTIA = "inertia: {ixx: 0.02 kg*m^2, iyy: 0.03 kg*m^2, izz: 0.025 kg*m^2, ixy: 0.001 kg*m^2}"
BASE = "torso: {frame: true, mass: 4 kg, inertia: {ixx: 0.03 kg*m^2, iyy: 0.04 kg*m^2, izz: 0.05 kg*m^2}"
LEGS = f"""\
thingc: assembly/1
name: legs
simulation: {{timestep: 2 ms}}
components:
  {BASE}, mounts: {{hip: {{xyz: 50 -20 30 mm, quat: [0.8, 0, 0.6, 0]}}, slot: {{xyz: 0 100 0 mm}}}}}}
  hip_x: {{frame: true}}
  hip_y: {{frame: true, mounts: {{z: {{xyz: 3 -2 11 mm}}}}}}
  thigh: {{frame: true, mass: 2 kg, com: 5 3 -100 mm, {INERTIA}, mounts: {{hip: {{xyz: -10 5 20 mm}}}}}}
  x: {{frame: true}}
  y: {{frame: true}}
  plate: {{frame: true, mass: 1 kg, com: 10 0 20 mm, {INERTIA}}}
joints:
  roll: {{type: revolute, parent: torso.hip, child: hip_x.origin, axis: [1, 0, 0], limit: {{lower: -1 rad, upper: 0.5 rad}}}}
  pitch:
    type: revolute
    parent: hip_x.origin
    child: hip_y.origin
    axis: [0, 3, 4]
    limit: {{lower: -0.7 rad, upper: 0.9 rad}}
    dynamics: {{damping: 0.1 N*m*s/rad, armature: 0.01 kg*m^2, stiffness: 2 N*m/rad}}
    drive: {{kind: position, kp: 30 N*m/rad, effort: 6 N*m}}
  yaw: {{type: continuous, parent: hip_y.z, child: thigh.hip, axis: [0, 0, 1]}}
  right: {{type: prismatic, parent: torso.slot, child: x.origin, axis: [1, 0, 0], limit: {{lower: -1 m, upper: 1 m}}}}
  ahead: {{type: prismatic, parent: x.origin, child: y.origin, axis: [0, 1, 0], limit: {{lower: -1 m, upper: 1 m}}}}
  spin: {{type: continuous, parent: y.origin, child: plate.origin, axis: [0, 0, 1], dynamics: {{damping: 0.02 N*m*s/rad}}}}
"""
MODES = "modes:\n  up: {root: torso, base: fixed}\n  down: {root: thigh, base: free}\n"
BY_HAND = """\
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002"/>
  <worldbody>
    <body name="torso">
      <inertial pos="0 0 0" mass="4" diaginertia="0.03 0.04 0.05"/>
      <body name="thigh" pos="0.05 -0.02 0.03" quat="0.8 0 0.6 0">
        <joint name="roll" axis="1 0 0" range="-1 0.5"/>
        <joint name="pitch" axis="0 3 4" range="-0.7 0.9" damping="0.1" armature="0.01" stiffness="2"/>
        <joint name="yaw" pos="0.003 -0.002 0.011" axis="0 0 1"/>
        <inertial pos="0.018 -0.004 -0.109" mass="2" fullinertia="0.02 0.03 0.025 0.001 0 0"/>
        <site name="thigh" pos="0.013 -0.007 -0.009"/>
      </body>
      <body name="plate" pos="0 0.1 0">
        <joint name="right" type="slide" axis="1 0 0" range="-1 1"/>
        <joint name="ahead" type="slide" axis="0 1 0" range="-1 1"/>
        <joint name="spin" damping="0.02"/>
        <inertial pos="0.01 0 0.02" mass="1" fullinertia="0.02 0.03 0.025 0.001 0 0"/>
        <site name="plate"/>
      </body>
    </body>
  </worldbody>
  <actuator><position name="pitch" joint="pitch" kp="30" forcerange="-6 6"/></actuator>
</mujoco>
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Artifacts]:
    """Artifacts by target."""
    folder = tmp_path_factory.mktemp("legs")
    (folder / "legs.yaml").write_text(LEGS + MODES)
    with Environment(str(folder / "legs.yaml"), Options(store=str(folder / "store"))) as environment:
        compilation = pipeline.compile(environment)
        assert compilation.report.diagnostics == []
        return pipeline.build(environment, compilation, ["mjcf", "urdf"])


@pytest.fixture(scope="module")
def legs(made: Mapping[str, Artifacts]) -> Artifacts:
    return made["mjcf"]


def data_of(artifacts: Artifacts, mode: str) -> mujoco.MjData:
    text = artifacts.files[f"mjcf/legs_{mode}.xml"]
    assert isinstance(text, bytes)
    return mujoco.MjData(mujoco.MjModel.from_xml_string(text.decode()))


def test_several_joints_match_written_model(legs: Artifacts) -> None:
    """Three hinges, one of them offset, and two slides and a hinge: compared in 50 states and over 200 steps."""
    ours, theirs = data_of(legs, "up"), mujoco.MjData(mujoco.MjModel.from_xml_string(BY_HAND))
    assert [ours.model.body(k).name for k in range(ours.model.nbody)] == ["world", "torso", "thigh", "plate"]
    assert [ours.model.joint(k).name for k in range(ours.model.njnt)] == ["roll", "pitch", "yaw", "right", "ahead", "spin"]
    for name in ("jnt_range", "jnt_limited", "jnt_stiffness", "dof_damping", "dof_armature", "actuator_trnid", "actuator_forcerange"):
        np.testing.assert_array_equal(getattr(ours.model, name), getattr(theirs.model, name), err_msg=name)
    random = np.random.default_rng(4)
    for _ in range(50):
        q, v = random.uniform(-1.5, 1.5, 6), random.uniform(-2, 2, 6)
        for data in (ours, theirs):
            data.qpos, data.qvel = q, v
            mujoco.mj_forward(data.model, data)
        for name in ("thigh", "plate"):
            np.testing.assert_allclose(ours.site(name).xpos, theirs.site(name).xpos, rtol=0, atol=1e-12)
            np.testing.assert_allclose(ours.site(name).xmat, theirs.site(name).xmat, rtol=0, atol=1e-12)
        np.testing.assert_allclose(mass_matrix(ours), mass_matrix(theirs), rtol=0, atol=1e-12)
        np.testing.assert_allclose(ours.qfrc_bias, theirs.qfrc_bias, rtol=0, atol=1e-10)
    for data in (ours, theirs):
        mujoco.mj_resetData(data.model, data)
        data.qvel[:] = [1.0, -2.0, 3.0, 0.1, -0.2, 4.0]
    for step in range(200):
        for data in (ours, theirs):
            data.ctrl[:] = np.sin(0.05 * step)
            mujoco.mj_step(data.model, data)
    np.testing.assert_allclose(ours.qpos, theirs.qpos, rtol=0, atol=1e-9)


def test_urdf_has_intermediate_links_of_tiny_mass(made: Mapping[str, Artifacts]) -> None:
    """The URDF, read by MuJoCo, has the same masses up to 1e-9 kg and six joints in chains."""
    text, ours = made["urdf"].files["urdf/legs_up.urdf"], data_of(made["mjcf"], "up")
    assert isinstance(text, bytes)
    theirs = mujoco.MjData(mujoco.MjModel.from_xml_string(text.decode()))
    random = np.random.default_rng(5)
    order = [theirs.model.joint(ours.model.joint(k).name).dofadr[0] for k in range(6)]
    armature = np.diag(ours.model.dof_armature)
    for _ in range(5):
        q, v = random.uniform(-1, 1, 6), random.uniform(-2, 2, 6)
        ours.qpos, ours.qvel, theirs.qpos[order], theirs.qvel[order] = q, v, q, v
        for data in (ours, theirs):
            mujoco.mj_forward(data.model, data)
        np.testing.assert_allclose(mass_matrix(theirs)[np.ix_(order, order)], mass_matrix(ours) - armature, rtol=0, atol=1e-7)
        np.testing.assert_allclose(theirs.qfrc_bias[order], ours.qfrc_bias, rtol=0, atol=1e-6)
    lost = {loss.path for loss in made["urdf"].losses if loss.what.startswith("the zero mass")}
    assert lost == {"hip_x", "hip_y", "x", "y"}


def test_joint_order_is_reversed_from_the_other_root(legs: Artifacts) -> None:
    """With the other root, the same joints are on the torso in reverse order, and the drive of the middle joint is unchanged."""
    up, down = data_of(legs, "up"), data_of(legs, "down")
    assert [down.model.joint(k).name for k in range(1, 4)] == ["yaw", "pitch", "roll"]
    q = {"roll": 0.4, "pitch": -0.3, "yaw": 1.2}
    for data in (up, down):
        for name, value in q.items():
            data.joint(name).qpos = value
        data.ctrl[:] = 0.5
        mujoco.mj_forward(data.model, data)
    relative = [np.linalg.inv(pose(data, "torso")) @ pose(data, "thigh") for data in (up, down)]
    np.testing.assert_allclose(relative[0], relative[1], rtol=0, atol=1e-12)
    assert up.joint("pitch").qfrc_actuator[0] == down.joint("pitch").qfrc_actuator[0] == pytest.approx(6.0)


def pose(data: mujoco.MjData, body: str) -> np.ndarray:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = data.body(body).xmat.reshape(3, 3), data.body(body).xpos
    return found


def test_neighbours_across_several_joints_do_not_collide(legs: Artifacts) -> None:
    """Contacts between the links on both sides are excluded, as for a single joint, in both directions and for a fixed base."""
    for mode in ("up", "down"):
        model = data_of(legs, mode).model
        pairs = {frozenset(model.body(int(body)).name for body in (s >> 16, s & 0xFFFF)) for s in model.exclude_signature}
        assert pairs == {frozenset(("torso", "thigh")), frozenset(("torso", "plate"))}


def test_frames_between_two_joints_are_losses(tmp_path: Path) -> None:
    """MuJoCo does not support sites between two joints of a body, so frames and sensors there are export losses."""
    more = "mounts: {knuckle: hip_y.z}\nsensors: {tilt: {type: imu, at: knuckle}, eye: {type: camera, at: hip_y.z, fovy: 60 deg}}\n"
    made = compiled(tmp_path, LEGS + more + "modes:\n  up: {root: torso, base: fixed}\n")
    assert made.said == [] and made.artifacts is not None
    lost = {loss.path: loss.what for loss in made.artifacts.losses if loss.how == "omitted"}
    assert lost["knuckle"] == "the frame: MuJoCo does not support sites between two joints of a body"
    assert lost["tilt"] == lost["eye"] == "the sensor: MuJoCo does not support sites between two joints of a body"
    model = data_of(made.artifacts, "up").model
    assert (model.nsensor, model.ncam) == (0, 0)


WRONG = {
    "three joints": ("spin: {type: continuous, parent: y.origin", "spin: {type: continuous, parent: hip_x.origin", "hip_x"),
    "one joint": ("spin: {type: continuous, parent: y.origin, child", "spin: {type: continuous, parent: x.origin, child", "y"),
    "a ball": ("spin: {type: continuous, parent: y.origin, child: plate.origin, axis: [0, 0, 1],",
               "spin: {type: ball, parent: y.origin, child: plate.origin,", "y"),
    "a loop's end": ("joints:\n", "joints:\n  closing: {type: ball, loop: true, parent: y.origin, child: thigh.origin}\n", "hip_x"),
    "a hold": ("base: fixed}", "base: fixed, hold: {hip_x.origin: here}}", "hip_x"),
    "a root that moves": ("root: thigh", "root: hip_y", "hip_y"),
}


@pytest.mark.parametrize("name", WRONG)
def test_other_moving_massless_links_are_errors(name: str, tmp_path: Path) -> None:
    """A massless link is allowed only between two joints. Loops, holds, balls, moving roots or more joints are TC507."""
    old, new, link = WRONG[name]
    assert old in LEGS + MODES
    said = [one for one in compiled(tmp_path, (LEGS + MODES).replace(old, new)).compilation.report.diagnostics if one.code is Code.MASSLESS]
    notes = {one.message: [note.message for note in one.notes] for one in said}
    mode = "down" if name == "a root that moves" else "up"
    assert notes[f"the moving link `{link}` has no mass"] == [
        f"the link contains component `{link}` and moves in mode `{mode}`",
        "a massless link must be between two joints, and must not be the root of the mode",
    ]
    assert {one.help for one in said} == {"add `mass:` to a component of the link, or use `attach` instead of a joint"}


def test_massless_link_may_be_a_held_root(tmp_path: Path) -> None:
    """Both neighbours are then children of the link, which is a body of its own."""
    made = compiled(tmp_path, LEGS + "modes:\n  middle: {root: hip_x, base: held}\n")
    assert made.said == [] and made.artifacts is not None
    model = data_of(made.artifacts, "middle").model
    assert [model.body(int(model.body_parentid[model.body(name).id])).name for name in ("torso", "thigh")] == ["hip_x", "hip_x"]

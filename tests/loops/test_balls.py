"""Ball joints: drives, holds and loops that are cut at a ball, compared with formulas and MuJoCo."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loops.robots import BALL, Array, Built, at_key, compiled
from thingc.base.pose import make_translation
from thingc.driver.testing.reach_search import farthest
from thingc.model.assembly.types import MountAt
from thingc.model.robot.kinematics import body_poses
from thingc.model.statics.efforts import static_efforts
from thingc.modes import Mode, Modes, caught

HIP = f"""
thingc: assembly/1
name: hip
components:
  ground: {{frame: true, mass: 2 kg, {BALL}, com: 10 20 -30 mm, mounts: {{socket: {{xyz: 5 -10 20 mm, rpy: 15 40 -60 deg}}}}}}
  thigh: {{frame: true, mass: 1 kg, {BALL}, com: 20 -10 250 mm, mounts: {{knob: {{xyz: 10 20 30 mm, rpy: 20 30 40 deg}}}}}}
joints:
  hip:
    type: ball
    parent: ground.socket
    child: thigh.knob
    turn: 25 deg
    limit: {{cone: 60 deg}}
    dynamics: {{damping: 0.1 N*m*s/rad, armature: 1e-3 kg*m^2, stiffness: 0.5 N*m/rad, friction: 0.01 N*m}}
    drive:
      - {{axis: [3, 0, 0], kind: motor, effort: 5 N*m}}
      - {{axis: [0, 3, 4], kind: position, kp: 3 N*m/rad}}
      - {{axis: [1, 2, 2], kind: motor}}
poses:
  home: {{hip: {{rpy: 20 -30 25 deg}}}}
  other: {{hip: {{quat: [2, -0.2, 0.6, 0.4]}}}}
modes:
  stand: {{root: ground, pose: home}}
  hand: {{root: thigh, base: held, pose: home}}
  weak: {{root: ground, actuators: ["hip[0]"], pose: home}}
"""
AXES = np.array([[1, 0, 0], [0, 0.6, 0.8], [1 / 3, 2 / 3, 2 / 3]])
KNOB = ["knob_0", "knob_1", "knob_2"]
COORDINATES = ["hip_0", "hip_1", "hip_2"]


@pytest.fixture(scope="module")
def hip(tmp_path_factory: pytest.TempPathFactory) -> Built:
    made = compiled(tmp_path_factory.mktemp("hip"), HIP)
    assert made.said == []
    return made


def to_rate_forces(mode: Mode, q: dict[str, float], force: Array) -> Array:
    """Convert MuJoCo forces to the rates of the ball: the torque on the child in its own joint axes."""
    rates = [mode.qvel(mode.state(q=q, v={name: 1.0})) for name in COORDINATES]
    return np.array(rates) @ force


def test_ball_poses_accept_rpy_and_quaternions(hip: Built) -> None:
    expected = {
        "home": Rotation.from_euler("xyz", [20, -30, 25], degrees=True), "other": Rotation.from_quat([-0.2, 0.6, 0.4, 2]),
    }
    for name, turn in expected.items():
        assert hip.modes["stand"]["poses"][name] == pytest.approx(dict(zip(COORDINATES, turn.as_rotvec(), strict=True)), abs=1e-12)
    for name, mode in Modes.parse(hip.text("modes.json")).items():
        for pose in expected:
            assert mode.qpos(mode.state(pose)) == pytest.approx(at_key(hip.model(name), pose).qpos, abs=1e-12)


@pytest.mark.parametrize("name", ["stand", "hand"])
def test_ball_drives_act_about_child_axes(hip: Built, name: str) -> None:
    """Torques of motors, position drives and springs equal the formulas, with the joint in both directions."""
    model, mode = hip.model(name), Modes.parse(hip.text("modes.json"))[name]
    assert model.joint("hip").range == pytest.approx([0, math.radians(60)])
    assert [model.joint("hip").damping[k] for k in range(3)] == [0.1] * 3
    data = at_key(model, "home")
    q = {path: float(value) for path, value in mode.state("home").q.items()}
    r = np.array([q[path] for path in COORDINATES])
    control = data.ctrl.copy()
    assert control == pytest.approx([0.0, AXES[1] @ r, 0.0])  # a position drive holds the pose that it is in
    for commands in ([2.0, control[1], 0.0], [0.0, 0.4, 0.0], [0.0, control[1], -1.5]):
        data.ctrl[:] = commands
        mujoco.mj_forward(model, data)
        torque = commands[0] * AXES[0] + 3.0 * (commands[1] - AXES[1] @ r) * AXES[1] + commands[2] * AXES[2]
        assert to_rate_forces(mode, q, data.qfrc_actuator) == pytest.approx(torque, abs=1e-10)
    assert to_rate_forces(mode, q, data.qfrc_passive) == pytest.approx(-0.5 * r, abs=1e-10)


@pytest.mark.parametrize("mode", ["stand", "hand"])
def test_unstable_ball_drive_is_reported(tmp_path: Path, mode: str) -> None:
    """Also if the tree traverses the joint backwards."""
    stiff = HIP.replace("kind: position, kp: 3 N*m/rad", "kind: position, kp: 3e5 N*m/rad")
    kept = "\n".join(line for line in stiff.splitlines() if not line.startswith("  ") or ": {root:" not in line or f"  {mode}:" in line)
    ((code, message, help, line),) = compiled(tmp_path, kept).said
    assert code == "TC612" and line == 1 + stiff[: stiff.index("kp: 3e5")].count("\n")
    assert message.startswith("`kp` of joint `hip_1` (300000 N*m/rad) makes the simulation of the joint unstable")
    assert help is not None and "to at most" in help


def test_dry_friction_of_a_reversed_ball_is_a_loss(hip: Built) -> None:
    assert hip.losses("stand") == []
    (loss,) = hip.losses("hand")
    assert (loss.path, loss.how) == ("hip", "approximated") and loss.what.startswith("the dry friction")


@pytest.mark.parametrize("name", ["stand", "hand"])
def test_static_efforts_balance_gravity_and_the_spring(hip: Built, name: str) -> None:
    robot, mode = hip.robot(name), Modes.parse(hip.text("modes.json"))[name]
    data = at_key(hip.model(name), "home")
    q = next(frame.q for frame in robot.keyframes if frame.name == "home")
    needed = to_rate_forces(mode, q, data.qfrc_bias - data.qfrc_passive)
    found = static_efforts(robot, q, body_poses(robot, q))
    assert [found.by_joint[path] for path in COORDINATES] == pytest.approx(np.linalg.solve(AXES.T, needed), abs=1e-9)
    assert found.unheld < 1e-9


def test_ball_with_one_drive_cannot_hold_a_pose(hip: Built) -> None:
    robot = hip.robot("weak")
    q = robot.keyframes[0].q
    assert static_efforts(robot, q, body_poses(robot, q)).unheld > 0.1


LEG = f"""
thingc: assembly/1
name: leg
components:
  ground: {{frame: true, mass: 2 kg, {BALL}, mounts: {{foot: {{xyz: 0 0 0}}, rail: {{xyz: 60 80 0 mm}}}}}}
  table: {{frame: true, mass: 1 kg, {BALL}, mounts: {{socket: {{xyz: 0 0 0, rpy: 30 40 50 deg}}}}}}
  cross: {{frame: true, mass: 0.1 kg, {BALL}}}
  rod: {{frame: true, mass: 0.1 kg, {BALL}, mounts: {{tip: {{rpy: 10 20 30 deg}}}}}}
joints:
  lift: {{type: prismatic, parent: ground.rail, child: table.origin, limit: {{lower: 0, upper: 1 m}}, drive: {{kind: motor}}}}
  foot: {{type: universal, parent: ground.foot, child: cross.origin}}
  ram: {{type: prismatic, parent: cross.origin, child: rod.origin, limit: {{lower: -1 m, upper: 1 m}}}}
  knob: {{type: ball, parent: rod.tip, child: table.socket, loop: true, LIMIT}}
poses:
  low: {{lift: 100 mm}}
  high: {{lift: 240 mm}}
modes:
  one: {{root: ground, pose: low}}
  two: {{root: table, base: held, pose: low}}
  three: {{root: ground, pose: low, cut: [ram]}}
"""


@pytest.fixture(scope="module")
def leg(tmp_path_factory: pytest.TempPathFactory) -> Built:
    made = compiled(tmp_path_factory.mktemp("leg"), LEG.replace("LIMIT", "limit: {cone: 180 deg}"))
    assert made.said == []
    return made


def test_ram_length_equals_the_distance_of_its_ends(leg: Built) -> None:
    for name in ("one", "two"):
        mode = leg.modes[name]
        for pose, height in (("low", 0.1), ("high", 0.24)):
            assert abs(mode["poses"][pose]["ram"]) == pytest.approx(math.hypot(0.06, 0.08, height), abs=1e-9)
            assert max(mode["residuals"][pose]) < 1e-9
        assert [cut["name"] for cut in mode["cuts"]] == ["knob"]


def test_loop_cut_at_a_ball_uses_a_connect_equality(leg: Built) -> None:
    for name in ("one", "two"):
        model = leg.model(name)
        assert model.neq == 1 and model.equality(0).type[0] == mujoco.mjtEq.mjEQ_CONNECT
        assert [loss.what for loss in leg.losses(name) if loss.path == "knob"] == ["the limits: the loop is cut at the joint"]
        for pose in ("low", "high"):
            data = at_key(model, pose)
            assert np.abs(data.efc_pos[:3]).max() < 1e-9
    assert [loss.what for loss in leg.losses("three") if loss.path == "ram" and "loop through" in loss.what]


def test_cut_ball_state_follows_its_ends(leg: Built) -> None:
    """After a switch to a mode with another cut, and back, position and velocity of the ball are recovered."""
    modes = Modes.parse(leg.text("modes.json"))
    one = modes["one"]
    state, _, _ = caught(one, one.state("low", v={"lift": 0.3, "foot_0": 0.2, "foot_1": -0.1}))  # a motion that the loop allows
    assert abs(state.v["lift"]) > 0.01 and abs(state.v["foot_0"]) > 0.01
    across = modes.switch(state, "three").state
    back = modes.switch(across, "one").state
    assert dict(back.q) == pytest.approx(dict(state.q), abs=1e-9) and dict(back.v) == pytest.approx(dict(state.v), abs=1e-9)
    low = leg.modes["three"]["poses"]["low"]
    assert {path: across.q[path] for path in KNOB} == pytest.approx({path: low[path] for path in KNOB}, abs=1e-9)


def test_cone_limit_of_a_cut_ball_is_respected(leg: Built, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A pose that needs a larger angle has no keyframe, and a cone that is too narrow is an error."""
    poses = leg.modes["one"]["poses"]
    low, high = (math.degrees(math.hypot(*(poses[pose][path] for path in KNOB))) for pose in ("low", "high"))
    assert low + 3.0 < high
    between, narrow = (
        compiled(tmp_path_factory.mktemp("cone"), LEG.replace("LIMIT", f"limit: {{cone: {cone} deg}}"))
        for cone in (0.5 * (low + high), 5.0)
    )
    assert [(code, line) for code, _, _, line in between.said] == [("TC618", 16)]
    assert [loss.path for loss in between.losses("one") if loss.what.startswith("the keyframe")] == ["high"]
    assert [(code, line) for code, _, _, line in narrow.said] == [("TC604", 13)]


def test_farthest_distance_respects_the_cone(tmp_path: Path) -> None:
    made = compiled(tmp_path, f"""
thingc: assembly/1
name: stick
components:
  post: {{frame: true, mass: 2 kg, {BALL}, mounts: {{far: {{xyz: 0 200 0 mm}}}}}}
  stick: {{frame: true, mass: 1 kg, {BALL}, mounts: {{tip: {{xyz: 0 0 -100 mm}}}}}}
joints:
  hip: {{type: ball, parent: post.origin, child: stick.origin, limit: {{cone: 30 deg}}}}
""")
    tip = MountAt(occurrence=1, mount="tip", pose=make_translation(0.0, 0.0, -0.1))
    far = MountAt(occurrence=0, mount="far", pose=make_translation(0.0, 0.2, 0.0))
    distance, q = farthest(made.compilation.robots[0], tip, far, ())
    assert distance == pytest.approx(math.hypot(0.2 + 0.1 * 0.5, 0.1 * math.sqrt(0.75)), abs=1e-9)
    assert [q[path] for path in COORDINATES] == pytest.approx([math.radians(30), 0, 0], abs=1e-4)

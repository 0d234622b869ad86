"""Free joints: models of all modes compared with each other and with the formula of the motion, and errors in documents."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loops.robots import MATE, Array, Built, compiled, pose_of
from modes.switching_robots import assert_said, same_motion
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.model.assembly.kinematics import joints_of
from thingc.model.robot.kinematics import body_poses
from thingc.model.statics.efforts import static_efforts
from thingc.modes import Modes

WEIGHT = "inertia: {ixx: 1e-3 kg*m^2, iyy: 2e-3 kg*m^2, izz: 1.5e-3 kg*m^2}"
GRIPPER = f"""\
thingc: assembly/1
name: gripper
components:
  palm: {{link: true, mass: 1 kg, com: 0 0 10 mm, {WEIGHT}, shapes: [{{box: 60 60 20 mm}}],
    mounts: {{centre: {{xyz: 0 10 40 mm, rpy: 10 20 30 deg}}, hinge: {{xyz: 30 0 10 mm, rpy: 0 90 0 deg}}}}}}
  finger: {{frame: true, mass: 100 g, com: 20 0 5 mm, {WEIGHT}}}
  ball: {{link: true, mass: 200 g, com: 1 2 3 mm, {WEIGHT}, shapes: [{{sphere: {{radius: 15 mm}}}}], mounts: {{top: {{xyz: 0 0 15 mm}}}}}}
  flag: {{frame: true, mass: 20 g, {WEIGHT}}}
joints:
  close: {{type: revolute, parent: palm.hinge, child: finger.origin, limit: {{lower: -1 rad, upper: 1 rad}}}}
  grasp: {{type: free, parent: palm.centre, child: ball.top}}
  spin: {{type: continuous, parent: ball.origin, child: flag.origin}}
poses:
  home: {{}}
  offered: {{grasp: {{xyz: 10 20 50 mm, rpy: 0 0 90 deg}}, close: 0.4 rad}}
  turned: {{grasp: {{quat: [0, 1, 0, 0]}}}}
modes:
  bench: {{root: palm, at: {{xyz: 0 0 500 mm, rpy: 0 40 0 deg}}, pose: offered}}
  by_ball: {{root: ball, base: free, pose: offered}}
  by_flag: {{root: flag, base: held, pose: offered}}
"""


@pytest.fixture(scope="module")
def gripper(tmp_path_factory: pytest.TempPathFactory) -> Built:
    made = compiled(tmp_path_factory.mktemp("gripper"), GRIPPER)
    assert {code for code, *_ in made.said} <= {"TC522", "TC792"}, made.said  # round numbers for masses and inertias
    return made


def ball_in_palm(xyz: Array, turn: Array) -> Array:
    """Pose of the ball in the palm, as the documentation of joints describes it."""
    mount, top, motion = np.eye(4), np.eye(4), np.eye(4)
    mount[:3, :3], mount[:3, 3] = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix(), (0, 0.01, 0.04)
    motion[:3, :3], motion[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), xyz
    top[2, 3] = 0.015
    return mount @ motion @ MATE @ np.linalg.inv(top)


@pytest.mark.parametrize("mode", ["bench", "by_ball", "by_flag"])
def test_keyframe_poses_match_the_document(gripper: Built, mode: str) -> None:
    model = gripper.model(mode)
    data = mujoco.MjData(model)
    expected = {
        "home": ball_in_palm(np.zeros(3), np.zeros(3)), "offered": ball_in_palm(np.array([0.01, 0.02, 0.05]), np.array([0, 0, np.pi / 2])),
        "turned": ball_in_palm(np.zeros(3), np.array([np.pi, 0, 0])),
    }
    for name, X in expected.items():
        mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
        mujoco.mj_forward(model, data)
        assert np.linalg.inv(pose_of(data.body("palm"))) @ pose_of(data.body("ball")) == pytest.approx(X, abs=1e-12)
    mujoco.mj_resetData(model, data)
    mujoco.mj_forward(model, data)
    assert np.linalg.inv(pose_of(data.body("palm"))) @ pose_of(data.body("ball")) == pytest.approx(expected["home"], abs=1e-12)


def test_free_child_is_a_child_of_the_world_body(gripper: Built) -> None:
    for mode, child in (("bench", "ball"), ("by_ball", "palm"), ("by_flag", "palm")):
        world = ET.fromstring(gripper.text(f"mjcf/gripper_{mode}.xml")).find("worldbody")
        assert world is not None
        free = [body.get("name") for body in world if body.find("freejoint[@name='grasp']") is not None]
        assert free == [child], mode
        assert gripper.model(mode).nexclude == 2  # palm and finger, ball and flag: the ball may touch the palm


def test_released_ball_is_dynamically_independent(gripper: Built) -> None:
    """The mass matrix has no coupling between the ball and the other joints."""
    model = gripper.model("bench")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    dof = model.joint("grasp").dofadr[0]
    with_ball = data.qacc[model.joint("close").dofadr[0]]
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    assert M[dof : dof + 7, model.joint("close").dofadr[0]] == pytest.approx(np.zeros(7))
    assert abs(with_ball) > 1.0


def test_switches_keep_poses_and_velocities(gripper: Built) -> None:
    """From each mode to each other mode, MuJoCo's poses and velocities of all bodies stay, and the coordinates q too."""
    modes = Modes.parse(gripper.text("modes.json"))
    rng = np.random.default_rng(3)
    start = modes["by_ball"].state(
        "offered", v={path: float(rng.normal()) for path in ("close", "spin", *(f"grasp_{k}" for k in range(6)))},
        base_twist=rng.normal(size=6),
    )
    one = mujoco.MjData(gripper.model("by_ball"))
    modes.write(start, one)
    assert_said(modes["by_ball"], start, one)
    other = mujoco.MjData(gripper.model("by_flag"))
    there = modes.switch(("by_ball", one), ("by_flag", other), on_motion="impact").state
    assert dict(there.q) == pytest.approx(dict(start.q), abs=1e-12)
    assert modes.read("by_flag", other).v == pytest.approx(dict(there.v), abs=1e-12)
    back = mujoco.MjData(gripper.model("by_ball"))
    modes.switch(("by_flag", other), ("by_ball", back))
    held, free = ({name: data.body(name).xpos.copy() for name in ("palm", "ball", "finger", "flag")} for data in forward_all(other, back))
    assert all(held[name] == pytest.approx(free[name], abs=1e-12) for name in held)
    again = mujoco.MjData(gripper.model("by_ball"))
    modes.write(modes.read("by_ball", one), again)
    same = mujoco.MjData(gripper.model("by_ball"))
    same.qpos[:], same.qvel[:] = one.qpos, one.qvel
    assert again.qpos == pytest.approx(one.qpos, abs=1e-12) and again.qvel == pytest.approx(one.qvel, abs=1e-12)
    same_motion(same, one)


def forward_all(*every: mujoco.MjData) -> tuple[mujoco.MjData, ...]:
    for data in every:
        mujoco.mj_forward(data.model, data)
    return every


def test_free_joints_in_other_formats(tmp_path: Path) -> None:
    """URDF has a floating joint; SDF and USD have a separate body without a joint. Nothing is lost."""
    tmp_path.joinpath("thingc.toml").write_text('thingc = "workspace/1"\n')
    tmp_path.joinpath("robot.yaml").write_text(GRIPPER)
    with Environment(str(tmp_path / "robot.yaml"), Options(store=str(tmp_path / "store"))) as environment:
        compilation = pipeline.compile(environment)
        made = pipeline.build(environment, compilation, ["urdf", "sdf", "usd", "ros", "glb", "html"])
    assert compilation.report.diagnostics == []
    files = {path: content for artifacts in made.values() for path, content in artifacts.files.items()}
    urdf = ET.fromstring(files["urdf/gripper_bench.urdf"])  # type: ignore[arg-type]
    joint = urdf.find("joint[@name='grasp']")
    assert joint is not None and joint.get("type") == "floating" and joint.find("limit") is None
    sdf = ET.fromstring(files["sdf/gripper_bench/model.sdf"])  # type: ignore[arg-type]
    assert [one.get("name") for one in sdf.iter("joint")] == ["root", "close", "spin"]
    links = {link.get("name"): link.find("pose") for link in sdf.iter("link")}
    assert links["ball"] is not None and links["ball"].get("relative_to") == "palm"
    usd = next(content for path, content in files.items() if path.endswith("bench.usda"))
    assert b'"grasp"' not in usd and b'"spin"' in usd  # type: ignore[operator]
    lost = [loss for artifacts in made.values() for loss in artifacts.losses if loss.path == "grasp"]
    assert lost == []


BAD = {
    "limit": ("type: free, limit: {lower: 0, upper: 1 mm}", "TC338", "joint `grasp` is free and cannot have `limit`"),
    "dynamics": ("type: free, dynamics: {damping: 1 N*m*s/rad}", "TC338", "joint `grasp` is free and cannot have `dynamics`"),
    "drive": ("type: free, drive: {kind: motor}", "TC338", "joint `grasp` is free and cannot have `drive`"),
    "offset": ("type: free, offset: [1 mm, 0, 0, 0, 0, 0]", "TC338", "joint `grasp` is free and cannot have `offset`"),
    "axis": ("type: free, axis: [0, 0, 1]", "TC338", "joint `grasp` is free and cannot have an `axis`"),
    "mimic": ("type: free, mimic: {joint: close}", "TC325", "joint `grasp` is free and cannot have `mimic`"),
    "keep": (
        "type: free, keep: true", "TC338", "joint `grasp` is free and cannot have `keep`",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_unsupported_options_of_free_joints_are_reported(tmp_path: Path, name: str) -> None:
    written, code, message = BAD[name]
    made = compiled(tmp_path, GRIPPER.replace("{type: free", "{" + written))
    line = 1 + GRIPPER[: GRIPPER.index("grasp:")].count("\n")
    assert [(one, text, number) for one, text, _, number in made.said] == [(code, message, line)]
    assert all(help for _, _, help, _ in made.said)


def test_free_joint_in_a_loop_is_reported(tmp_path: Path) -> None:
    loop = "  shut: {type: ball, parent: flag.origin, child: finger.origin, loop: true}\nposes:"
    made = compiled(tmp_path, GRIPPER.replace("poses:", loop, 1))
    assert [(code, line) for code, _, _, line in made.said] == [("TC513", 1 + GRIPPER[: GRIPPER.index("grasp:")].count("\n"))]
    assert "the free joint `grasp` is part of a loop" in made.said[0][1]


@pytest.mark.parametrize(("value", "message"), [
    ("10 mm", "the value of joint `grasp` (free) must be `xyz`, `rpy` or `quat`"),
    ("[0, 0, 0, 0, 0, 0]", "the value of joint `grasp` (free) must be `xyz`, `rpy` or `quat`"),
])
def test_invalid_pose_values_are_reported(tmp_path: Path, value: str, message: str) -> None:
    made = compiled(tmp_path, GRIPPER.replace("{grasp: {quat: [0, 1, 0, 0]}}", f"{{grasp: {value}}}"))
    assert [(code, text) for code, text, _, _ in made.said] == [("TC334", message)]


def test_feet_do_not_carry_released_bodies(tmp_path: Path) -> None:
    """Static efforts of a robot on its feet do not depend on the mass of the ball."""
    stool = f"""\
thingc: assembly/1
name: stool
components:
  seat: {{frame: true, mass: 2 kg, {WEIGHT}, mounts: {{a: {{xyz: 100 0 -200 mm, rpy: 180 0 0 deg}},
    b: {{xyz: -100 100 -200 mm, rpy: 180 0 0 deg}}, c: {{xyz: -100 -100 -200 mm, rpy: 180 0 0 deg}}}}}}
  head: {{frame: true, mass: 300 g, com: 50 0 0 mm, {WEIGHT}}}
  ball: {{frame: true, mass: BALL, {WEIGHT}, mounts: {{m: {{xyz: 0 0 10 mm}}}}}}
joints:
  nod: {{type: continuous, parent: seat.origin, child: head.origin, axis: [0, 1, 0], drive: {{kind: motor, effort: 1 N*m}}}}
  grasp: {{type: free, parent: head.origin, child: ball.m}}
modes:
  stands: {{root: seat, base: free, at: {{xyz: 0 0 200 mm}}, standing_on: {{mounts: [seat.a, seat.b, seat.c], friction: 1}}}}
"""
    found = []
    for number, mass in enumerate(("1 g", "5 kg")):
        tmp_path.joinpath(str(number)).mkdir()
        robot = compiled(tmp_path / str(number), stool.replace("BALL", mass)).robot("stands")
        q = {joint.path: 0.0 for joint in joints_of(robot.assembly)}
        found.append(static_efforts(robot, q, body_poses(robot, q)))
    assert found[0].by_joint == pytest.approx(found[1].by_joint) and found[0].fall is None
    assert found[0].by_joint["nod"] == pytest.approx(-0.3 * 9.81 * 0.05)

"""Scenes: assemblies whose components are robots and objects in one of their modes. Each robot moves as in its own model."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from loops.robots import Built, compiled, pose_of
from thingc.modes import Modes

WEIGHT = "inertia: {ixx: 1e-3 kg*m^2, iyy: 2e-3 kg*m^2, izz: 1.5e-3 kg*m^2}"
ARM = f"""\
thingc: assembly/1
name: arm
components:
  foot: {{frame: true, mass: 1 kg, {WEIGHT}, mounts: {{top: {{xyz: 0 0 50 mm}}, sole: {{rpy: 180 0 0 deg}}}}}}
  upper: {{frame: true, mass: 500 g, com: 0 0 100 mm, {WEIGHT}, mounts: {{end: {{xyz: 0 0 200 mm, rpy: 0 90 0 deg}}}}}}
  hand: {{frame: true, mass: 200 g, com: 30 0 0 mm, {WEIGHT}, mounts: {{grip: {{xyz: 80 0 0 mm}}}}}}
joints:
  shoulder: {{type: revolute, parent: foot.top, child: upper.origin, axis: [0, 1, 0], limit: {{lower: -2 rad, upper: 2 rad}},
    drive: {{kind: position, kp: 5 N*m/rad}}, dynamics: {{damping: 0.1 N*m*s/rad}}}}
  wrist: {{type: ball, parent: upper.end, child: hand.origin, dynamics: {{damping: 0.01 N*m*s/rad}},
    drive: [{{axis: [0, 0, 1], kind: motor, effort: 1 N*m}}]}}
poses:
  home: {{shoulder: 0.5 rad, wrist: {{rpy: 0 20 0 deg}}}}
  folded: {{shoulder: -0.7 rad}}
modes:
  bench: {{root: foot.sole, pose: home, at: {{xyz: 0 0 10 mm}}}}
  hanging: {{root: hand.grip, pose: folded, actuators: [shoulder], at: {{rpy: 0 90 0 deg}}}}
  adrift: {{root: hand, base: free, pose: folded, actuators: []}}
  rolling: {{root: foot, base: planar, contacts: {{exclude: [[foot, hand]]}}}}
  held: {{root: foot, base: held}}
"""
CUBE = f"""\
thingc: assembly/1
name: cube
components:
  cube: {{link: true, mass: 100 g, {WEIGHT}, shapes: [{{box: 20 20 20 mm}}], mounts: {{below: {{xyz: 0 0 -10 mm, rpy: 180 0 0 deg}}}}}}
modes: {{loose: {{root: cube.below, base: free}}}}
"""
SCENE = """\
thingc: assembly/1
name: desk
components:
  room: {link: true, shapes: [{box: 600 600 10 mm, at: {xyz: 0 0 300 mm}}], mounts: {table: {xyz: 0 0 400 mm, rpy: 0 0 30 deg}}}
  left: {assembly: arm.yaml, mode: bench, at: {in: room.table, xyz: 300 0 0 mm}}
  right: {assembly: arm.yaml, mode: hanging, at: {in: room.origin, xyz: -500 0 900 mm, rpy: 0 180 0 deg}}
  third: {assembly: arm.yaml, mode: adrift, at: {in: room.origin, xyz: 0 2 0 m}}
  fourth: {assembly: arm.yaml, mode: rolling, at: {in: room.origin, xyz: 0 -2 0 m}, mirror: y}
  cube: {assembly: cube.yaml, mode: loose, at: {in: room.table, rpy: 0 0 45 deg}}
poses:
  start: {}
  moved: {left: folded, cube.root: {xyz: 0 0 100 mm}, "fourth.root": [100 mm, 0, 90 deg]}
modes:
  scene: {root: room, pose: start}
"""
DOCUMENTS = {"desk.yaml": SCENE, "arm.yaml": ARM, "cube.yaml": CUBE}


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Built:
    made = compiled(tmp_path_factory.mktemp("desk"), DOCUMENTS)
    assert {code for code, *_ in made.said} <= {"TC522", "TC792"}, made.said  # round numbers for masses and inertias
    return made


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Built:
    made = compiled(tmp_path_factory.mktemp("arm"), ARM)
    assert {code for code, *_ in made.said} <= {"TC522", "TC792"}, made.said  # round numbers for masses and inertias
    return made


def at_start(model: mujoco.MjModel, pose: str) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
    mujoco.mj_forward(model, data)
    return data


PLACES = {
    "left": ("bench", "home", [0.3 * np.cos(np.pi / 6), 0.3 * np.sin(np.pi / 6), 0.4], [0, 0, np.pi / 6]),
    "right": ("hanging", "folded", [-0.5, 0, 0.9], [0, np.pi, 0]), "third": ("adrift", "folded", [0, 2, 0], [0, 0, 0]),
}


@pytest.mark.parametrize("name", PLACES)
def test_robots_have_the_poses_of_their_modes(desk: Built, arm: Built, name: str) -> None:
    """The pose of every link in the robot's own model, transformed to its place in the scene."""
    mode, pose, place, (roll, pitch, yaw) = PLACES[name]
    scene, alone = at_start(desk.model("scene"), "start"), at_start(arm.model(mode), pose)
    X = np.eye(4)
    for axis, angle in (("z", yaw), ("y", pitch), ("x", roll)):
        quaternion, turned = np.zeros(4), np.zeros(9)
        mujoco.mju_axisAngle2Quat(quaternion, np.eye(3)["xyz".index(axis)], angle)
        mujoco.mju_quat2Mat(turned, quaternion)
        X[:3, :3] = X[:3, :3] @ turned.reshape(3, 3)
    X[:3, 3] = place
    for link in ("foot", "upper", "hand"):
        assert pose_of(scene.body(f"{name}/{link}")) == pytest.approx(X @ pose_of(alone.body(link)), abs=1e-12), link


def test_robots_move_as_in_their_own_models(desk: Built, arm: Built) -> None:
    """The left arm and the drifting arm touch nothing, so their trajectories equal those of their own models."""
    model = desk.model("scene")
    scene = at_start(model, "start")
    alone = {name: at_start(arm.model(PLACES[name][0]), PLACES[name][1]) for name in ("left", "third")}
    for data, prefix in ((scene, "left/"), (alone["left"], "")):
        data.ctrl[data.model.actuator(f"{prefix}shoulder").id] = 0.2
    for _ in range(100):
        mujoco.mj_step(model, scene)
        for data in alone.values():
            mujoco.mj_step(data.model, data)
    for name, data in alone.items():
        for joint in ("shoulder", "wrist"):
            assert scene.joint(f"{name}/{joint}").qpos == pytest.approx(data.joint(joint).qpos, abs=1e-9), (name, joint)
    assert scene.joint("left/shoulder").qvel != pytest.approx([0.0], abs=1e-3)


def test_drives_and_excluded_contacts_follow_the_modes(desk: Built) -> None:
    model = desk.model("scene")
    driven = {model.actuator(number).name for number in range(model.nu)}
    assert driven == {"left/shoulder", "left/wrist_0", "right/shoulder", "fourth/shoulder", "fourth/wrist_0"}
    pairs = {frozenset(model.body(body).name for body in divmod(int(signature), 65536)) for signature in model.exclude_signature}
    assert frozenset({"fourth/foot", "fourth/hand"}) in pairs and frozenset({"left/foot", "left/hand"}) not in pairs
    assert not {pair for pair in pairs if "room" in pair} - {frozenset({"room", "left/foot"}), frozenset({"room", "right/hand"})}
    free = [model.joint(number).name for number in range(model.njnt) if model.jnt_type[number] == mujoco.mjtJoint.mjJNT_FREE]
    assert free == ["third/root", "cube/root"]


def test_scene_poses_place_objects(desk: Built) -> None:
    model = desk.model("scene")
    start, moved = (at_start(model, pose) for pose in ("start", "moved"))
    assert moved.joint("left/shoulder").qpos == pytest.approx([-0.7])
    assert moved.joint("left/wrist").qpos == pytest.approx([1, 0, 0, 0])  # 0 in the pose `folded`, unlike in the start pose `home`
    assert moved.body("cube/cube").xpos - start.body("cube/cube").xpos == pytest.approx([0, 0, 0.1], abs=1e-12)
    assert start.body("cube/cube").xpos == pytest.approx([0, 0, 0.41], abs=1e-12)  # it stands on the table
    assert moved.body("fourth/foot").xpos - start.body("fourth/foot").xpos == pytest.approx([0.1, 0, 0], abs=1e-12)


def test_scene_state_round_trips(desk: Built) -> None:
    modes = Modes.parse(desk.text("modes.json"))
    state = modes["scene"].state("moved", v={"third/root_1": 0.3, "cube/root_4": 1.0})
    data = mujoco.MjData(desk.model("scene"))
    modes.write(state, data)
    read = modes.read("scene", data)
    assert read.q == pytest.approx(dict(state.q), abs=1e-12) and read.v == pytest.approx(dict(state.v), abs=1e-12)


BAD = {
    "mode: bench, at": ("mode: bank, at", "TC308", "`left` (`arm.yaml`) has no mode `bank`"),
    "{assembly: arm.yaml, mode: bench": (
        "{assembly: arm.yaml, mode: held", "TC310", "mode `held` of `left` has `base: held`, which a nested assembly does not support",
    ),
    "mode: bench, at: {in: room.table, xyz: 300 0 0 mm}": (
        "mode: bench", "TC212", "`mode` of component `left` requires `at`",
    ),
    "cube.yaml, mode: loose": ("cube.yaml, mode: lost", "TC308", "`cube` (`cube.yaml`) has no mode `lost`"),
    "arm.yaml, mode: rolling": (
        "arm.yaml, mode: held", "TC310", "mode `held` of `fourth` has `base: held`, which a nested assembly does not support",
    ),
    "room: {link: true,": ("room: {link: true, mode: x,", "TC212", "`mode` can only be used with `assembly`"),
}


@pytest.mark.parametrize("written", BAD)
def test_invalid_scenes_are_reported(tmp_path: Path, written: str) -> None:
    instead, code, message = BAD[written]
    made = compiled(tmp_path, {**DOCUMENTS, "desk.yaml": SCENE.replace(written, instead)})
    assert [(one, text) for one, text, _, _ in made.said] == [(code, message)] and made.said[0][2]


def test_scenes_can_be_nested(tmp_path: Path) -> None:
    """Modes of robots in a nested scene, at any level, also determine drives, start poses and places."""
    hall = (
        "thingc: assembly/1\nname: hall\ncomponents:\n  floor: {frame: true}\n"
        "  one: {assembly: desk.yaml, at: {in: floor.origin}}\n  two: {assembly: corner.yaml, at: {in: floor.origin, xyz: 0 5 0 m}}\n"
        "poses: {zero: {}}\nmodes: {all: {root: floor, pose: zero}}\n"
    )
    corner = (
        "thingc: assembly/1\nname: corner\ncomponents:\n  floor: {frame: true}\n  desk: {assembly: desk.yaml, at: {in: floor.origin}}\n"
    )
    made = compiled(tmp_path, {"hall.yaml": hall, "corner.yaml": corner, **DOCUMENTS})
    assert {code for code, *_ in made.said} <= {"TC517", "TC522", "TC792"}, made.said
    data = at_start(made.model("all"), "zero")
    assert {data.model.actuator(number).name for number in range(data.model.nu)} == {
        f"{desk}/{drive}" for desk in ("one", "two/desk")
        for drive in ("left/shoulder", "left/wrist_0", "right/shoulder", "fourth/shoulder", "fourth/wrist_0")
    }
    shoulders = [data.joint(f"two/desk/{robot}/shoulder").qpos[0] for robot in ("left", "third")]
    assert shoulders == pytest.approx([0.5, -0.7])
    assert data.body("two/desk/cube/cube").xpos - data.body("one/cube/cube").xpos == pytest.approx([0, 5, 0])

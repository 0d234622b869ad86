"""Partially movable bases, `planar` and `ball`: poses and motions compared with MuJoCo, and switches into and out of them."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loops.robots import BALL, MATE, Array, Built, at_key, compiled
from modes.switching_robots import assert_said, bodies
from thingc.modes import BaseElsewhere, BaseMoves, Modes, RobotState

PUCK = f"""
thingc: assembly/1
name: puck
components:
  puck: {{frame: true, mass: 2 kg, {BALL}, com: 10 20 -30 mm, mounts: {{foot: {{xyz: 40 -30 20 mm, rpy: 15 40 -60 deg}}}}}}
  arm: {{frame: true, mass: 1 kg, {BALL}, com: 20 -10 250 mm, mounts: {{knob: {{xyz: 10 20 30 mm, rpy: 20 30 40 deg}}}}}}
joints:
  hinge: {{type: continuous, parent: puck.origin, child: arm.knob}}
poses: {{out: {{hinge: 30 deg}}}}
modes:
  sled: {{root: puck.foot, base: planar, pose: out, at: {{xyz: 100 200 300 mm, rpy: 10 20 30 deg}}}}
  gimbal: {{root: puck.foot, base: ball, pose: out, at: {{xyz: 100 200 300 mm, rpy: 10 20 30 deg}}}}
  plain: {{root: puck, base: planar, pose: out, at: {{xyz: 10 0 0 mm}}}}
  loose: {{root: arm, base: free, pose: out}}
"""
AT = np.eye(4)
AT[:3, :3], AT[:3, 3] = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix(), (0.1, 0.2, 0.3)
FOOT = np.eye(4)
FOOT[:3, :3], FOOT[:3, 3] = Rotation.from_euler("xyz", [15, 40, -60], degrees=True).as_matrix(), (0.04, -0.03, 0.02)


@pytest.fixture(scope="module")
def puck(tmp_path_factory: pytest.TempPathFactory) -> Built:
    made = compiled(tmp_path_factory.mktemp("puck"), PUCK)
    assert made.said == []
    return made


def moved(turn: Array, place: Array) -> Array:
    """Pose of the puck when its mount, mated to `at`, is displaced by a motion in that frame."""
    M = np.eye(4)
    M[:3, :3], M[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), place
    found: Array = AT @ M @ MATE @ np.linalg.inv(FOOT)
    return found


def data_of(puck: Built, state: RobotState) -> mujoco.MjData:
    model = puck.model(state.mode)
    data = mujoco.MjData(model)
    Modes.parse(puck.text("modes.json")).write(state, data)
    mujoco.mj_forward(model, data)
    return data


def test_base_moves_in_plane_or_about_origin(puck: Built) -> None:
    names = {name: [puck.model(name).joint(k).name for k in range(puck.model(name).njnt)] for name in ("sled", "gimbal", "plain")}
    assert names == {"sled": ["root_0", "root_1", "root_2", "hinge"], "gimbal": ["root", "hinge"], "plain": names["sled"]}
    for name, qpos, X in (
        ("sled", [0.3, -0.2, 0.7], moved(np.array([0, 0, 0.7]), np.array([0.3, -0.2, 0]))),
        ("sled", [0.0, 0.0, 0.0], moved(np.zeros(3), np.zeros(3))),
        ("gimbal", [1.0, 0.0, 0.0, 0.0], moved(np.zeros(3), np.zeros(3))),
    ):
        data = at_key(puck.model(name), "out")
        assert data.qpos[-1] == pytest.approx(np.radians(30))
        data.qpos[: len(qpos)] = qpos
        mujoco.mj_forward(puck.model(name), data)
        assert bodies(data)["puck"][0] == pytest.approx(X, abs=1e-12)


@pytest.mark.parametrize("name", ["sled", "gimbal"])
def test_states_match_mujoco(puck: Built, name: str) -> None:
    mode, h = Modes.parse(puck.text("modes.json"))[name], 1e-6
    planar = name == "sled"
    turn, place = (np.array([0, 0, -0.8]), np.array([0.4, 0.1, 0])) if planar else (np.array([0.5, -0.7, 0.9]), np.zeros(3))
    rate, slide = (np.array([0, 0, 0.6]), np.array([0.2, -0.3, 0])) if planar else (np.array([0.2, 0.3, -0.4]), np.zeros(3))

    def at(t: float) -> Array:
        after = Rotation.from_rotvec(turn) * Rotation.from_rotvec(t * rate)
        return moved(after.as_rotvec(), place + t * slide)

    X = at(0.0)
    dX = (at(h) - at(-h)) / (2 * h)
    spin = X[:3, :3].T @ dX[:3, :3]
    twist = [*dX[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]]
    state = mode.state("out", v={"hinge": 0.4}, base_pose=X, base_twist=twist)
    data = data_of(puck, state)
    assert bodies(data)["puck"][0] == pytest.approx(X, abs=1e-12)
    read = Modes.parse(puck.text("modes.json")).read(name, data)
    assert read.base_pose == pytest.approx(X, abs=1e-12) and read.base_twist == pytest.approx(twist, abs=1e-8)
    assert_said(mode, read, data)
    expected = np.zeros(puck.model(name).nv)
    mujoco.mj_differentiatePos(puck.model(name), expected, 2 * h, *(
        mode.qpos(mode.state(q={"hinge": 0.4 * t}, base_pose=at(t))) for t in (-h, h)))
    assert mode.qvel(state) == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("name", ["sled", "gimbal"])
def test_switches_into_and_out_of_partial_bases(puck: Built, name: str) -> None:
    modes = Modes.parse(puck.text("modes.json"))
    mode = modes[name]
    planar = name == "sled"
    X = moved(np.array([0, 0, -0.8]), np.array([0.4, 0.1, 0])) if planar else moved(np.array([0.5, -0.7, 0.9]), np.zeros(3))
    start = mode.state("out", v={"hinge": 0.4}, base_pose=X)
    assert mode.part is not None
    start = mode.state("out", v={"hinge": 0.4}, base_pose=X, base_twist=mode.part.twist(X, [0.3, -0.2, 0.5]))
    loose = modes.switch(start, "loose").state
    back = modes.switch(loose, name)
    assert back.state.base_pose == pytest.approx(X, abs=1e-12) and back.state.base_twist == pytest.approx(start.base_twist, abs=1e-12)
    assert np.abs(back.removed).max() < 1e-12
    # now with a motion that such a base does not have
    more = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    wild = modes["loose"].state(q=loose.q, v=loose.v, base_pose=loose.base_pose, base_twist=loose.base_twist + more)
    with pytest.raises(BaseMoves):
        modes.switch(wild, name)
    dropped = modes.switch(wild, name, on_motion="drop")
    before = modes["loose"].twists(wild)["puck"]
    assert dropped.state.base_twist + dropped.removed == pytest.approx(before, abs=1e-12)
    # a perfectly inelastic catch, by MuJoCo's own mass matrix: M (u' - u) does no work on what the base can do
    caught = modes.switch(wild, name, on_motion="impact").state
    data = data_of(puck, modes.switch(wild, "loose").state)
    M = np.zeros((puck.model("loose").nv,) * 2)
    mujoco.mj_fullM(puck.model("loose"), data, M)
    free = modes["loose"]
    after = free.qvel(modes.switch(caught, "loose").state)
    ways = []
    for k in range(4):
        unit = mode.state(
            q=caught.q, v={"hinge": float(k == 3)}, base_pose=caught.base_pose,
            base_twist=mode.part.twist(caught.base_pose, np.eye(4)[k, :3]),
        )
        ways.append(free.qvel(modes.switch(unit, "loose").state))
    assert np.array(ways) @ M @ (after - free.qvel(wild)) == pytest.approx(np.zeros(4), abs=1e-10)
    away = X.copy()
    away[:3, 3] += AT[:3, 2] * 0.01
    with pytest.raises(BaseElsewhere):
        modes.switch(modes.switch(mode.state("out", base_pose=away), "loose").state, name)

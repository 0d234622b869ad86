"""Screws: a lead screw and its nut with either root, in MuJoCo and in a loop."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

from loops.robots import BALL, Built, compiled, pose_of
from modes.switching_robots import assert_said
from thingc.modes import Modes

LEAD = 0.008
PITCH = LEAD / (2.0 * math.pi)

ROBOT = f"""
thingc: assembly/1
name: press
components:
  frame: {{frame: true, mass: 2 kg, {BALL}}}
  ram: {{frame: true, mass: 1 kg, {BALL}, mounts: {{nut: {{xyz: 20 0 0 mm}}}}}}
  tool: {{frame: true, mass: 0.2 kg, {BALL}}}
joints:
  lead:
    {{type: screw, lead: 8 mm, parent: frame.origin, child: ram.nut, offset: 1 rad,
      limit: {{lower: -20 rad, upper: 400 rad, effort: 0.2 N*m}},
      dynamics: {{armature: 2e-5 kg*m^2, damping: 1e-4 N*m*s/rad}}, drive: {{kind: motor, effort: 0.2 N*m}}}}
  wheel: {{type: continuous, parent: ram.origin, child: tool.origin, mimic: {{joint: lead, multiplier: 0.5}}}}
poses: {{up: {{lead: 30 rad}}}}
modes:
  stand: {{root: frame, pose: up}}
  hung: {{root: ram, base: held, pose: up}}
  loose: {{root: tool, base: free, pose: up, gravity: 0 0 0 m/s^2}}
"""


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> Built:
    made = compiled(tmp_path_factory.mktemp("press"), ROBOT)
    assert made.said == []
    return made


def data_at(model: mujoco.MjModel, q: float) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for name, ratio in (("lead", 1.0), ("lead:slide", PITCH), ("wheel", 0.5)):
        data.joint(name).qpos = ratio * q
    mujoco.mj_forward(model, data)
    return data


@pytest.mark.parametrize("q", [-2.0, 0.0, 41.5])
def test_screw_pose_follows_the_thread_for_each_root(press: Built, q: float) -> None:
    """The oracle is `X_PC = Rz(q + offset) Tz(lead (q + offset) / turn) M inv(X_CB)`, written out."""
    c, s = math.cos(q + 1.0), math.sin(q + 1.0)
    nut = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, PITCH * (q + 1.0)], [0, 0, 0, 1]])
    expected = nut @ np.array([[0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]) @ np.array(
        [[1, 0, 0, -0.02], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    )
    for mode in ("stand", "hung", "loose"):
        data = data_at(press.model(mode), q)
        found = np.linalg.inv(pose_of(data.body("frame"))) @ pose_of(data.body("ram"))
        assert np.abs(found - expected).max() < 1e-12


def effective_dynamics(press: Built, mode: str, q: float) -> tuple[float, float]:
    """Effective inertia data_at the drive [kg m^2] with the frame held, and the torque [N m] of gravity along (1, 2, 3) of the frame. Both
    are computed by MuJoCo from hinge, slide and mimic."""
    model = press.model(mode)
    data = data_at(model, q)
    down = pose_of(data.body("frame"))[:3, :3] @ [1.0, 2.0, 3.0]
    model.opt.gravity[:] = down
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    along = np.zeros(model.nv)
    for name, ratio in (("lead", 1.0), ("lead:slide", PITCH), ("wheel", 0.5)):
        along[model.joint(name).dofadr[0]] = ratio
    held = np.zeros((6, model.nv))
    mujoco.mj_jacBody(model, data, held[:3], held[3:], model.body("frame").id)
    if mode == "loose":  # the base moves so that the frame does not
        along[:6] = -np.linalg.solve(held[:, :6], held[:, 6:] @ along[6:])
        return float(along @ full @ along), float(-along @ data.qfrc_bias)
    if mode == "stand":
        return float(along @ full @ along), float(-along @ data.qfrc_bias)
    raise ValueError(mode)


def test_screw_dynamics_do_not_depend_on_the_root(press: Built) -> None:
    for q in (0.0, 7.3):
        one, other = effective_dynamics(press, "stand", q), effective_dynamics(press, "loose", q)
        assert other == pytest.approx(one, rel=1e-8, abs=1e-12)
        # weight along the thread: 1.2 kg, 3 m/s^2 along z of the frame; what is off the axis turns with it
        assert one[0] > 1.2 * PITCH**2 + 2e-5


def test_thread_does_not_slip_under_load(press: Built) -> None:
    """With 1.2 kg on the thread and full drive effort up and down, the ram stays on its thread within 0.2 mm."""
    model = press.model("stand")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert data.joint("lead").qpos[0] == 30.0 and data.joint("lead:slide").qpos[0] == pytest.approx(30.0 * PITCH)
    worst, turned = 0.0, 0.0
    for step in range(500):
        data.ctrl[0] = 0.2 if step % 100 < 50 else -0.2
        mujoco.mj_step(model, data)
        worst = max(worst, abs(data.joint("lead:slide").qpos[0] - PITCH * data.joint("lead").qpos[0]))
        turned = max(turned, abs(data.joint("lead").qpos[0] - 30.0))
    assert turned > 3.0
    assert worst < 0.0002
    data.ctrl[0] = 0.0
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(2000):  # 4 s, only friction of the thread against the weight
        mujoco.mj_step(model, data)
        worst = max(worst, abs(data.joint("lead:slide").qpos[0] - PITCH * data.joint("lead").qpos[0]))
    assert worst < 0.0002


def test_thread_is_an_approximation(press: Built) -> None:
    losses = [(loss.path, loss.how) for loss in press.losses(None) if "thread" in loss.what]
    assert losses == [("lead", "approximated")]


def test_mode_switch_with_a_screw(press: Built) -> None:
    modes = Modes.parse(press.text("modes.json"))
    start = modes["loose"].state("up", v={"lead": 2.0, "wheel": 1.0}, base_twist=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    model = press.model("loose")
    data = mujoco.MjData(model)
    modes.write(start, data)
    mujoco.mj_forward(model, data)
    assert data.joint("lead:slide").qvel[0] == pytest.approx(2.0 * PITCH)
    assert list(data.qpos) == pytest.approx(list(modes["loose"].qpos(start))) and list(data.qvel) == pytest.approx(
        list(modes["loose"].qvel(start))
    )
    assert_said(modes["loose"], start, data)
    there = modes.switch(start, "hung", on_motion="drop").state
    back = modes.switch(there, "loose").state
    assert back.q == pytest.approx(start.q, abs=1e-12)


LOOP = f"""
thingc: assembly/1
name: jack
components:
  base: {{frame: true, mass: 2 kg, {BALL}}}
  nut: {{frame: true, mass: 1 kg, {BALL}}}
joints:
  guide: {{type: prismatic, parent: base.origin, child: nut.origin, limit: {{lower: 0, upper: 100 mm}}}}
  thread: {{type: screw, lead: 5 mm, parent: base.origin, child: nut.origin, loop: true}}
modes:
  stand: {{root: base}}
"""


def test_loop_cut_at_a_screw_is_a_loss(tmp_path: Path) -> None:
    """MuJoCo cannot close this loop, so it stays open and an export loss is reported."""
    made = compiled(tmp_path, LOOP)
    assert made.said == []
    (closure,) = made.robot("stand").closures
    model = made.model("stand")
    joints = [model.joint(number).name for number in range(model.njnt)]
    losses = [(loss.path, loss.how) for loss in made.losses("stand") if "loop" in loss.what]
    assert closure.path in ("guide", "thread") and model.neq == sum(name.endswith(":slide") for name in joints)
    assert losses == [(closure.path, "omitted")]




DIFFERENTIAL = f"""
thingc: assembly/1
name: differential
components:
  frame: {{frame: true, mass: 2 kg, {BALL}}}
  spindle: {{frame: true, mass: 0.3 kg, {BALL}}}
  nut: {{frame: true, mass: 0.2 kg, {BALL}, mounts: {{top: {{rpy: 180 0 -90 deg}}}}}}
joints:
  coarse: {{type: screw, lead: 5 mm, parent: frame.origin, child: spindle.origin}}
  fine: {{type: screw, lead: 4 mm, parent: spindle.origin, child: nut.origin}}
  guide: {{type: prismatic, parent: frame.origin, child: nut.top, limit: {{lower: -1 m, upper: 1 m}}, loop: true}}
poses: {{quarter: {{coarse: 90 deg}}, back: {{coarse: -60 deg}}}}
modes:
  bench: {{root: frame}}
  other: {{root: nut, base: held}}
"""


def test_differential_screw_advances_by_lead_difference(tmp_path: Path) -> None:
    made = compiled(tmp_path, DIFFERENTIAL)
    assert made.said == []
    for mode in ("bench", "other"):
        for pose, turns in (("quarter", 0.25), ("back", -1 / 6)):
            q = made.modes[mode]["poses"][pose]
            assert q["coarse"] == pytest.approx(2 * math.pi * turns, abs=1e-12)
            assert q["fine"] == pytest.approx(q["coarse"], abs=1e-9) and q["guide"] == pytest.approx(0.001 * turns, abs=1e-12)
        assert [loss.how for loss in made.losses(mode) if "the loop through the joint" in loss.what] == ["omitted"]

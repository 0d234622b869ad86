"""Joints with several coordinates: states converted between modes, compared with MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from loops.robots import BALL, Built, compiled
from modes.switching_robots import assert_said
from thingc.modes import Modes

GANTRY = f"""
thingc: assembly/1
name: gantry
components:
  ground: {{frame: true, mass: 2 kg, {BALL}}}
  sled: {{frame: true, mass: 1 kg, {BALL}, mounts: {{knob: {{xyz: 10 20 30 mm, rpy: 20 30 40 deg}}}}}}
  wrist: {{frame: true, mass: 0.5 kg, {BALL}, mounts: {{knob: {{xyz: 10 -20 30 mm, rpy: 20 -30 40 deg}}}}}}
  rod: {{frame: true, mass: 0.25 kg, {BALL}}}
joints:
  table:
    type: planar
    parent: ground.origin
    child: sled.knob
    offset: [10 mm, 0, 30 deg]
    limit: {{0: {{lower: -1 m, upper: 1 m}}, 2: {{lower: -90 deg, upper: 170 deg}}}}
    drive: {{0: {{kind: motor, effort: 5 N}}, 2: {{kind: position, kp: 20 N*m/rad, effort: 3 N*m}}}}
  wrist:
    {{type: universal, parent: sled.origin, child: wrist.knob, dynamics: [{{damping: 0.1 N*m*s/rad}}, {{}}], offset: [10 deg, 20 deg]}}
  ram: {{type: cylindrical, parent: wrist.origin, child: rod.origin, mimic: {{0: {{joint: "wrist[1]", multiplier: -0.5}}}}}}
poses:
  home: {{table: [100 mm, 20 mm, 30 deg], wrist: {{0: 10 deg}}, "ram[1]": 5 mm}}
sensors:
  bend: {{type: joint, joint: "wrist[1]"}}
modes:
  stand: {{root: ground, pose: home}}
  hand: {{root: rod, base: held, pose: home}}
  loose: {{root: wrist, base: free, pose: home, actuators: [table]}}
  slid: {{root: wrist, base: free, pose: home, actuators: ["table[0]"]}}
"""
V = {"table_0": 0.3, "table_1": -0.2, "table_2": 1.1, "wrist_0": 0.7, "wrist_1": -0.4, "ram_0": 0.2, "ram_1": 0.05}


@pytest.fixture(scope="module")
def gantry(tmp_path_factory: pytest.TempPathFactory) -> Built:
    made = compiled(tmp_path_factory.mktemp("gantry"), GANTRY)
    assert made.said == []
    return made


def test_coordinate_settings_appear_in_the_model(gantry: Built) -> None:
    model = gantry.model("stand")
    assert [model.joint(k).name for k in range(model.njnt)] == list(V)
    assert model.joint("table_0").range == pytest.approx([-1, 1]) and not model.joint("table_1").limited[0]
    assert model.joint("wrist_0").damping[0] == 0.1 and model.joint("wrist_1").damping[0] == 0.0
    assert [model.actuator(k).name for k in range(model.nu)] == ["table_0", "table_2"]
    assert [gantry.model("slid").actuator(k).name for k in range(gantry.model("slid").nu)] == ["table_0"]
    assert gantry.model("loose").nu == 2
    assert model.equality("ram_0:mimic").data[:2] == pytest.approx([0.0, -0.5])
    assert model.sensor("bend:position").objid[0] == model.joint("wrist_1").id
    pose = gantry.modes["stand"]["poses"]["home"]
    assert pose == pytest.approx({
        "table_0": 0.1, "table_1": 0.02, "table_2": np.radians(30), "wrist_0": np.radians(10), "wrist_1": 0.0, "ram_0": 0.0, "ram_1": 0.005,
    })
    backward = gantry.model("hand")
    assert [backward.joint(k).name for k in range(backward.njnt)] == [
        "ram_1", "ram_0", "wrist_1", "wrist_0", "table_2", "table_1", "table_0",
    ]


def test_state_in_another_mode_is_the_same_motion(gantry: Built) -> None:
    modes = Modes.parse(gantry.text("modes.json"))
    start = modes["loose"].state("home", v=V, base_twist=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    back = modes.switch(modes.switch(start, "slid").state, "loose").state
    assert back.q == pytest.approx(start.q) and back.v == pytest.approx(start.v)
    held = modes.switch(start, "hand", on_motion="drop").state
    for name, state in (("loose", start), ("hand", held)):
        model = gantry.model(name)
        data = mujoco.MjData(model)
        modes.write(state, data)
        mujoco.mj_forward(model, data)
        assert modes.read(name, data).q == pytest.approx(state.q)
        assert list(modes[name].qpos(state)) == pytest.approx(list(data.qpos))
        assert_said(modes[name], state, data)
    one, other = modes["loose"].poses(start), modes["hand"].poses(held)
    for link in one:
        assert np.linalg.inv(one["rod"]) @ one[link] == pytest.approx(np.linalg.inv(other["rod"]) @ other[link], abs=1e-12)


LOOP = f"""
thingc: assembly/1
name: jack
components:
  base: {{frame: true, mass: 2 kg, {BALL}}}
  nut: {{frame: true, mass: 1 kg, {BALL}}}
joints:
  guide: {{type: cylindrical, parent: base.origin, child: nut.origin}}
  way: {{type: TYPE, parent: base.origin, child: nut.origin, loop: true}}
poses: {{up: {{guide: [0.3 rad, 0]}}}}
modes:
  one: {{root: base, cut: [guide]}}
  two: {{root: base, cut: [way]}}
"""


@pytest.mark.parametrize("kind", ["planar", "cylindrical"])
def test_loop_cut_at_several_coordinates_is_a_loss(kind: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    """MuJoCo has no equality for the cut, but position and velocity of the cut joint are still computed."""
    made = compiled(tmp_path_factory.mktemp("jack"), LOOP.replace("TYPE", kind))
    assert made.said == []
    for mode, path in (("one", "guide"), ("two", "way")):
        losses = [(loss.path, loss.how, loss.what) for loss in made.losses(mode) if loss.how == "omitted"]
        assert losses == [(path, "omitted", "the loop through the joint: MuJoCo has no equality for joints with several coordinates")]
        assert made.model(mode).neq == 0
    modes = Modes.parse(made.text("modes.json"))
    turn = "way_2" if kind == "planar" else "way_0"
    start = modes["one"].state(q={turn: 0.4}, v={turn: 0.7})
    found = modes.switch(start, "two").state
    assert found.q == pytest.approx({"guide_0": 0.4, "guide_1": 0.0}, abs=1e-12)
    assert found.v == pytest.approx({"guide_0": 0.7, "guide_1": 0.0}, abs=1e-12)

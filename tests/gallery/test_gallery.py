"""The robots of the gallery: they have no diagnostics, their tests pass, and every mode can be simulated from its start pose."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import thingc
from thingc.model.robot.kinematics import body_poses
from thingc.modes import Modes
from thingc.tools.cli.main import main

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("balancer", "biped", "delta", "dropper", "gecko", "gripper", "hand", "hexapod", "so101", "wrist")
ROOTS = {  # the links that trees begin with, and the modes: another root is another tree of the same robot
    "balancer": ({"body", "left_wheel"}, 4), "biped": ({"torso", "leg_0/shank"}, 3),
    "dropper": ({"palm", "ball"}, 3), "delta": ({"top", "platform"}, 3),
    "gecko": ({"chest", "left_front/arm", "right_front/arm", "left_rear/arm", "right_rear/arm"}, 6),
    "gripper": ({"base", "left_finger"}, 3), "hand": ({"forearm", "index/distal"}, 3),
    "hexapod": ({"chassis", "leg_0/knee_servo", "leg_1/knee_servo"}, 5), "so101": ({"base_link", "gripper_link"}, 2),
    "wrist": ({"forearm", "hand"}, 3),
}
_MADE: dict[str, thingc.Compiled] = {}


def document(name: str) -> str:
    return str(ROOT / "gallery" / name / f"{name}.yaml")


def compiled(name: str, store: str) -> thingc.Compiled:
    """The robot, compiled once. Warnings are errors."""
    if name not in _MADE:
        _MADE[name] = thingc.compile(document(name), store=store, strict=True)
    return _MADE[name]


def scene(mode: thingc.CompiledMode) -> mujoco.MjModel:
    """The scene of the mode: the robot on its floor."""
    files = {path.removeprefix("mjcf/"): data for path, data in mode.files.items() if path.endswith(".xml")}
    name = next(path for path in files if path == f"scene_{mode.name}.xml")
    return mujoco.MjModel.from_xml_string(files[name].decode(), {**files, **mode.assets()})


def root_of(mode: thingc.CompiledMode) -> str:
    return mode.robot.assembly.links[mode.robot.bodies[0].link].name


def test_every_folder_is_a_robot() -> None:
    assert sorted(path.name for path in (ROOT / "gallery").iterdir() if path.is_dir()) == list(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_modes_can_be_simulated(name: str, shared_store: str) -> None:
    """Half a second from the first keyframe, with drives at its positions: values are finite, MuJoCo does not warn, loops stay closed,
    and no body moves far."""
    robot = compiled(name, shared_store)
    assert robot.diagnostics == ()
    roots, number = ROOTS[name]
    assert len(robot.modes) == number and {root_of(mode) for mode in robot.modes.values()} == roots
    for mode in robot.modes.values():
        model = scene(mode)
        data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        start = data.xipos.copy()
        while data.time < 0.5:
            mujoco.mj_step(model, data)
        assert sum(warning.number for warning in data.warning) == 0, mode
        assert np.isfinite(data.qpos).all() and np.abs(data.qvel).max() < 30.0, mode
        assert np.linalg.norm(data.xipos - start, axis=1).max() < 0.15, mode
        closed = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        assert not closed.any() or np.abs(data.efc_pos[: data.nefc][closed]).max() < 2e-3, mode


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("biped", "delta", "hexapod", "wrist")])
def test_tests_of_the_robot_pass(name: str, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The page `docs/gallery.md`, which is tested, shows the results of the other robots."""
    assert main(["test", document(name), "--strict", "--store", shared_store]) == 0, capsys.readouterr()


def test_platform_of_the_delta_does_not_rotate(shared_store: str) -> None:
    """In all poses of all modes. The loops can also be closed in other ways, with crossed rods."""
    for mode in compiled("delta", shared_store).modes.values():
        robot = mode.robot
        names = [robot.assembly.links[body.link].name for body in robot.bodies]
        for keyframe in robot.keyframes:
            placed = dict(zip(names, body_poses(robot, keyframe.q), strict=True))
            turned = (placed["top"].inverse() @ placed["platform"]).rotation
            assert np.allclose(turned, np.eye(3), atol=1e-6), (mode.name, keyframe.name)


def test_balancer_stays_upright(shared_store: str) -> None:
    """Feedback of the inclination and its rate to both wheels keeps the robot upright. Without feedback, it falls."""
    model = scene(compiled("balancer", shared_store).modes["balancing"])
    body, (left, right) = model.body("body").id, (model.joint(name).dofadr[0] for name in ("left", "right"))
    signs = [np.sign(model.joint(name).axis[2]) for name in ("left", "right")]

    def leans(gain: float) -> float:
        data = mujoco.MjData(model)
        data.qvel[4] = 0.3  # a push
        greatest = 0.0
        while data.time < 3.0:
            axes = data.xmat[body].reshape(3, 3)
            lean = np.arctan2(axes[0, 2], axes[2, 2])
            forwards = (data.qvel[left] - data.qvel[right]) / 2.0
            torque = gain * (1.6 * lean + 0.16 * data.qvel[4] + 0.012 * forwards)
            data.ctrl[:] = (torque, -torque)
            mujoco.mj_step(model, data)
            greatest = max(greatest, abs(lean))
        return greatest

    assert signs == [1.0, 1.0]
    assert leans(0.0) > 1.0
    assert leans(1.0) < 0.2


def test_dropper_holds_its_ball_until_it_opens(shared_store: str) -> None:
    """The command acts after 10 ms, also if the mode changes in between. Then the ball falls."""
    robot = compiled("dropper", shared_store)
    bench, carried = (mujoco.MjData(scene(robot.modes[name])) for name in ("bench", "carried"))
    mujoco.mj_resetDataKeyframe(bench.model, bench, 0)
    height = bench.body("ball").xpos[2] if mujoco.mj_forward(bench.model, bench) is None else 0.0
    mujoco.mj_step(bench.model, bench, 500)
    assert bench.body("ball").xpos[2] == pytest.approx(height, abs=1e-3)
    bench.ctrl[:] = bench.model.actuator_ctrlrange[:, 1]
    mujoco.mj_step(bench.model, bench, 6)
    Modes.parse(robot.modes["bench"].files["modes.json"]).switch(("bench", bench), ("carried", carried))
    carried.ctrl[:] = 0.0  # the jaws would not open without the commands that have not yet acted
    forces = []
    for _ in range(12):
        mujoco.mj_step(carried.model, carried)
        forces.append(carried.actuator_force[0])
    assert [force > 0.0 for force in forces] == [False] * 4 + [True] * 6 + [False] * 2
    carried.ctrl[:] = carried.model.actuator_ctrlrange[:, 1]
    mujoco.mj_step(carried.model, carried, 300)
    assert carried.body("ball").xpos[2] < height - 0.1

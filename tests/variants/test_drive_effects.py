"""Delays, torque-speed lines, deadbands and noise of drives, in environments and in MuJoCo, each compared with a separate computation."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import thingc
from thingc.base.diagnostics import Report
from thingc.batch.gym.family_env import FamilyEnv, make_env
from thingc.tools.cli.main import main
from thingc.tools.importing.importing import import_robot

Array = Any
INERTIA = "inertia: {ixx: 2e-3 kg*m^2, iyy: 3e-3 kg*m^2, izz: 4e-3 kg*m^2}"
WALKER = f"""\
thingc: assembly/1
name: walker
components:
  front: {{frame: true, mass: 1 kg, {INERTIA}}}
  body: {{frame: true, mass: 2 kg, {INERTIA}, mounts: {{end: {{xyz: 200 0 0 mm}}}}}}
  rear: {{frame: true, mass: 1 kg, {INERTIA}}}
joints:
  knee: {{type: revolute, parent: front.origin, child: body.origin, axis: [0, 1, 0], limit: {{lower: -2 rad, upper: 2 rad}},
    dynamics: {{damping: 0.1 N*m*s/rad}}, drive: {{kind: position, kp: 8 N*m/rad, kv: 0.2 N*m*s/rad, effort: 5 N*m}}}}
  ankle: {{type: continuous, parent: body.end, child: rear.origin, axis: [0, 1, 0],
    dynamics: {{damping: 0.1 N*m*s/rad}}, drive: {{kind: motor, effort: 2 N*m}}}}
poses: {{arched: {{knee: 0.4 rad, ankle: -0.7 rad}}}}
simulation: {{integrator: euler}}
modes:
  front: {{root: front, base: fixed, pose: arched}}
  rear: {{root: front, base: fixed, pose: arched, simulation: {{timestep: 1 ms}}}}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


def walker(folder: Path, knee: str = "", ankle: str = "", **more: str) -> thingc.RobotFamily:
    text = WALKER.replace("effort: 5 N*m}", f"effort: 5 N*m{knee}}}").replace("effort: 2 N*m}", f"effort: 2 N*m{ankle}}}")
    for old, new in more.items():
        text = text.replace(old, new)
    path = folder / f"walker_{len(list(folder.iterdir()))}.yaml"
    path.write_text(text)
    return thingc.family(path)


def actions(count: int) -> Any:
    return np.random.default_rng(5).uniform(-1.0, 1.0, (count, 2))


def path_of(env: FamilyEnv, count: int = 40, **reset: Any) -> Any:
    env.reset(seed=3, **reset)
    path = []
    for action in actions(count):
        env.step(action)
        path.append([*env.data.qpos, *env.data.qvel])
    return np.array(path)


def test_delay_equals_that_of_the_environment_and_of_mujoco(folder: Path) -> None:
    """A delay of 20 ms is 2 actions of 5 steps of 2 ms. Before, the controls are those of the keyframe."""
    with walker(folder) as plain, walker(folder, ", delay: 20 ms", ", delay: 20 ms") as late:
        of_env, of_drive = path_of(make_env(plain, action_delay=2)), path_of(make_env(late))
        assert abs(of_env - of_drive).max() <= 1e-12
        assert abs(of_drive - path_of(make_env(late, action_delay=2))).max() <= 1e-12
        assert abs(path_of(make_env(plain)) - path_of(make_env(late, action_delay=0))).max() <= 1e-12
        assert abs(of_drive - path_of(make_env(plain))).max() > 0.1
        model = next(iter(plain.models([{}], floor=True)))
    assert isinstance(model, mujoco.MjModel)
    data, past = mujoco.MjData(model), []
    mujoco.mj_resetDataKeyframe(model, data, 0)
    first = data.ctrl.copy()
    for action, row in zip(actions(40), of_drive, strict=True):
        for _ in range(5):
            past.append([2.0 * action[0], 2.0 * action[1]])
            data.ctrl[:] = past[-11] if len(past) > 10 else first
            mujoco.mj_step(model, data)
        assert abs(np.array([*data.qpos, *data.qvel]) - row).max() <= 1e-12


@pytest.mark.parametrize(("delay", "steps"), [("1 ms", 1), ("2 ms", 1), ("3 ms", 2), ("7 ms", 4), ("20 ms", 10), ("0.3 s", 150)])
def test_delay_is_rounded_up_to_steps(folder: Path, delay: str, steps: int) -> None:
    with walker(folder, "", f", delay: {delay}") as late:
        model = next(iter(late.models([{}])))
    assert isinstance(model, mujoco.MjModel)
    data, lags = mujoco.MjData(model), set()
    for step in range(5000):
        data.ctrl[1] = 1e-6 * step
        mujoco.mj_step(model, data)
        lags |= {round(step - 1e6 * data.actuator_force[1])} if step > steps else set()
    assert lags == {steps}


@pytest.mark.parametrize("effects", ["", ", noise: 0"])
def test_switch_transfers_pending_commands(folder: Path, effects: str) -> None:
    """`rear` has half of the time step, so the trajectory only by the integration error. `same` has the same time step."""
    more = {", simulation: {timestep: 1 ms}": ""}
    with walker(folder, ", delay: 24 ms", f", delay: 14 ms{effects}", **more) as same:
        switching = make_env(same, modes=("front", "rear"), observation="qpos", action_scale=None)
        staying = make_env(same, modes=("front", "rear"), observation="qpos")
        for env, modes in ((switching, [0, 1, 1, 0] * 10), (staying, [0] * 40)):
            env.reset(seed=3)
            path = []
            for mode, action in zip(modes, actions(40), strict=True):
                env.step({"mode": mode, "joints": action})
                path.append([*env.data.qpos, *env.data.qvel])
            if env is switching:
                expected = np.array(path)
        assert abs(expected - np.array(path)).max() <= 1e-12
    with walker(folder, ", delay: 24 ms", ", delay: 14 ms") as finer:
        robot = finer.modes({}, "front", "rear")
        models = [next(iter(finer.models([{}], mode=mode))) for mode in ("front", "rear")]
    coarse, fine = (mujoco.MjData(model) for model in models)  # type: ignore[arg-type]
    for command in range(8):
        coarse.ctrl[:] = 0.1 * command
        mujoco.mj_step(models[0], coarse)
    robot.switch(("front", coarse), ("rear", fine))  # type: ignore[union-attr]
    acted = []
    for _ in range(14):
        mujoco.mj_step(models[1], fine)
        acted.append(round(10.0 * fine.actuator_force[1]))
    assert acted == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7]  # each command of the coarse steps acts for two fine steps


def by_hand(family: thingc.RobotFamily, torques: Callable[[Array, Array, Array], Array], count: int = 40) -> Array:
    """Simulate the robot without its actuators. `torques` computes their torques from the commands, the positions and the speeds."""
    model = next(iter(family.models([{}], floor=True)))
    assert isinstance(model, mujoco.MjModel)
    model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0.0
    data, path = mujoco.MjData(model), []
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for action in actions(count):
        for _ in range(5):
            data.qfrc_applied[:] = torques(2.0 * action, data.qpos, data.qvel)
            mujoco.mj_step(model, data)
        path.append([*data.qpos, *data.qvel])
    return np.array(path)


def test_torque_stays_within_the_torque_speed_line(folder: Path) -> None:
    line, cut = ", stall: 1.5 N*m, velocity: 3 rad/s", [0]

    def torques(command: Array, q: Array, v: Array) -> Array:
        wanted = np.clip([8.0 * (command[0] - q[0]) - 0.2 * v[0], command[1]], [-5.0, -2.0], [5.0, 2.0])
        limited = np.clip(wanted, -1.5 * (1.0 + v / 3.0), 1.5 * (1.0 - v / 3.0))
        cut[0] += int((wanted != limited).sum())
        return limited

    with walker(folder, line, line) as family:
        env = make_env(family)
        assert abs(path_of(env) - by_hand(family, torques)).max() <= 1e-12
        assert cut[0] > 50
        q, v, command = env.data.qpos, env.data.qvel, 2.0 * actions(40)[-1]
        assert env.data.actuator_force == pytest.approx(torques(command, q, v), abs=1e-12)  # of the state after the last step
        assert env.data.ctrl == pytest.approx(command)


def test_drive_ignores_errors_in_its_deadband(folder: Path) -> None:
    def torques(command: Array, q: Array, v: Array) -> Array:
        error = command[0] - q[0]
        knee = (8.0 * error if abs(error) > 0.5 else 0.0) - 0.2 * v[0]
        return np.array([np.clip(knee, -5.0, 5.0), command[1] if abs(command[1]) > 0.7 else 0.0])

    def turning(command: Array, q: Array, v: Array) -> Array:
        error = command - v
        return np.clip(np.where(abs(error) > 0.6, 0.3 * error, 0.0), -1.0, 1.0)

    with walker(folder, ", deadband: 0.5 rad", ", deadband: 700 mN*m") as family:
        assert abs(path_of(make_env(family)) - by_hand(family, torques)).max() <= 1e-12
    wheel = "{kind: velocity, kv: 0.3 N*m*s/rad, effort: 1 N*m, velocity: 2 rad/s, deadband: 0.6 rad/s}"
    changes = {"{kind: position, kp: 8 N*m/rad, kv: 0.2 N*m*s/rad, effort: 5 N*m}": wheel, "{kind: motor, effort: 2 N*m}": wheel}
    with walker(folder, **changes) as family:
        assert abs(path_of(make_env(family)) - by_hand(family, turning)).max() <= 1e-12


def test_noise_has_the_given_deviation_and_no_delay(folder: Path) -> None:
    """The torque of the motor is the command 0 plus noise. The noise is reproducible by seeds, and delays do not add it twice."""
    for delay in ("", ", delay: 10 ms"):
        with walker(folder, "", f", noise: 0.05 N*m{delay}") as family:
            env = make_env(family, frame_skip=1, max_steps=10_000)
            torques = []
            for _ in range(2):
                env.reset(seed=4)
                episode = env._world._worlds[0][2]  # type: ignore[index]
                source = np.random.default_rng(7)
                for _ in range(2000):
                    episode.simulations[0].effects.step(episode.data, 1, source)
                    torques.append(episode.data.actuator_force[1])
            assert np.std(torques) == pytest.approx(0.05, rel=0.05) and torques[:2000] == torques[2000:]
            assert abs(np.mean(torques)) < 0.005


def test_custom_data_are_reflected_to_the_joint(folder: Path) -> None:
    """The expected values are computed with the ratio 9 and the efficiency 85 %."""
    actuator = "{kind: motor, effort: 0.4 N*m, velocity: 300 rad/s, stall: 0.6 N*m, delay: 9 ms, deadband: 10 mN*m, noise: 2 mN*m}"
    text = WALKER.replace(", drive: {kind: motor, effort: 2 N*m}", "").replace(
        "poses:", f"transmissions: {{belt: {{actuator: {actuator}, joint: ankle, ratio: -9, efficiency: 85 %}}}}\nposes:",
    )
    (folder / "geared.yaml").write_text(text)
    mode = thingc.compile(folder / "geared.yaml").modes["front"]
    model = mode.model()
    assert model.actuator_delay[1] == 0.009 and model.actuator_history[1].tolist() == [5, 0]
    assert model.numeric("ankle:stall").data == pytest.approx([0.6 * 9 * 0.85, 300 / 9])
    assert model.numeric("ankle:deadband").data == pytest.approx([0.01 * 9 * 0.85])
    assert model.numeric("ankle:noise").data == pytest.approx([0.002 * 9 * 0.85])
    finer = thingc.compile(folder / "geared.yaml").modes["rear"].model()
    assert finer.actuator_history[1].tolist() == [9, 0]


def test_other_formats_report_the_effects_as_losses(folder: Path) -> None:
    effects = "stall: 3 N*m, velocity: 9 rad/s, delay: 5 ms, deadband: 1 mN*m, noise: 1 mN*m"
    (folder / "walker.yaml").write_text(WALKER.replace("effort: 2 N*m}", f"effort: 2 N*m, {effects}}}"))
    targets = ("mjcf", "urdf", "ros", "sdf", "usd")
    main(["build", str(folder / "walker.yaml"), "-o", str(folder / "build"), *(f"--emit={target}" for target in targets)])
    losses = json.loads((folder / "build/walker/manifest.json").read_text())["losses"]
    lost = {(one["target"], one["what"], one["how"]) for one in losses if one["path"] == "ankle"}
    for what in ("the torque-speed line", "the deadband", "the noise"):
        assert {(target, what, "carried as custom data" if target == "mjcf" else "omitted") for target in targets} <= lost
    assert {one for one in lost if "delay" in one[1]} == {(target, "the delay of 0.005 s", "omitted") for target in targets[1:]}


def test_delay_is_a_setting_of_a_family(folder: Path) -> None:
    """Plans write delays into models, including the number of past commands."""
    with walker(folder, "", ", delay: 20 ms") as family:
        name = "joints.ankle.drive.delay"
        models = list(family.models([{name: delay} for delay in ("19.5 ms", "19.9 ms", "31 ms")]))
        found = [(model.actuator_delay[1], model.actuator_history[1, 0]) for model in models]  # type: ignore[union-attr]
        assert found == [(0.0195, 10), (0.0199, 10), (0.031, 16)]


def test_import_of_a_mujoco_model_keeps_effects(folder: Path) -> None:
    effects = "stall: 3 N*m, velocity: 9 rad/s, delay: 5 ms, deadband: 1 mN*m, noise: 2 mN*m"
    (folder / "walker.yaml").write_text(WALKER.replace("effort: 2 N*m}", f"effort: 2 N*m, {effects}}}"))
    mode = thingc.compile(folder / "walker.yaml").modes["front"]
    (folder / "source.xml").write_bytes(mode.files["mjcf/walker_front.xml"])
    found = import_robot(str(folder / "source.xml"), Report())
    assert found is not None
    name = next(name for name in found.files if name.endswith(".yaml"))
    assert "nsample" not in found.files[name].decode()
    (folder / "again.yaml").write_bytes(found.files[name])
    model, again = mode.model(), thingc.compile(folder / "again.yaml").modes["source"].model()
    for field in ("actuator_delay", "actuator_history", "actuator_gainprm", "actuator_ctrlrange"):
        assert getattr(again, field) == pytest.approx(getattr(model, field)), field
    for key in ("stall", "deadband", "noise"):
        assert again.numeric(f"ankle:{key}").data == pytest.approx(model.numeric(f"ankle:{key}").data)


def test_models_for_mjx_and_drake_report_delays(folder: Path) -> None:
    (folder / "walker.yaml").write_text(WALKER.replace("effort: 2 N*m}", "effort: 2 N*m, delay: 5 ms}"))
    said = [one.message for one in thingc.compile(folder / "walker.yaml", compat="mjx").diagnostics]
    assert said == ["MJX cannot load modes `front`, `rear`: delays are not supported"]
    main(["build", str(folder / "walker.yaml"), "-o", str(folder / "build"), "--emit=mjcf", "--compat=drake"])
    losses = json.loads((folder / "build/walker/manifest.json").read_text())["losses"]
    assert "the delay of the drive: not supported by Drake" in [one["what"] for one in losses if one["path"] == "ankle"]


@pytest.mark.parametrize("integrator", ["euler", "rk4", "implicit", "implicitfast"])
def test_negligible_effects_change_nothing(folder: Path, integrator: str) -> None:
    """A tiny deadband only selects the steps in which effects can act, with and without a delay."""
    more = {"integrator: euler": f"integrator: {integrator}"}
    for delay in ("", ", delay: 6 ms"):
        with walker(folder, delay, delay, **more) as plain, walker(folder, f"{delay}, deadband: 1e-200 rad", delay, **more) as tiny:
            assert abs(path_of(make_env(plain)) - path_of(make_env(tiny))).max() <= 1e-12

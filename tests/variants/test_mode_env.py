"""Environments in which actions switch the mode: observations, controls and disturbances, compared with separate computations."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import thingc
from thingc.batch import FamilyError, UnknownVariant
from thingc.batch.gym.env_options import EnvOptions, EnvRules
from thingc.batch.gym.family_env import ENVIRONMENT, make_env, make_vec_env

INERTIA = "inertia: {ixx: 2e-3 kg*m^2, iyy: 3e-3 kg*m^2, izz: 4e-3 kg*m^2}"
CRAWLER = f"""\
thingc: assembly/1
name: crawler
parameters: {{span: {{value: 200 mm, min: 100 mm, max: 400 mm}}}}
components:
  front:
    link: true
    mass: 1 kg
    {INERTIA}
    mounts: {{sole: {{rpy: 20 30 40 deg}}}}
    shapes: [{{box: 60 40 20 mm, color: red, for: visual}}]
  body: {{frame: true, mass: 2 kg, {INERTIA}, mounts: {{end: {{xyz: [=span, 0, 0]}}}}}}
  rear: {{frame: true, mass: 1 kg, {INERTIA}}}
joints:
  knee: {{type: revolute, parent: front.origin, child: body.origin, axis: [0, 1, 0], limit: {{lower: -2 rad, upper: 2 rad}},
    dynamics: {{damping: 0.1 N*m*s/rad}}, drive: {{kind: position, kp: 8 N*m/rad, effort: 5 N*m}}}}
  ankle: {{type: revolute, parent: body.end, child: rear.origin, axis: [0, 1, 0], limit: {{lower: -1 rad, upper: 1 rad}},
    dynamics: {{damping: 0.1 N*m*s/rad}}, drive: {{kind: position, kp: 5 N*m/rad, effort: 5 N*m}}}}
sensors: {{bend: {{type: joint, joint: ankle}}}}
poses: {{arched: {{knee: 0.4 rad, ankle: -0.7 rad}}, flat: {{knee: 0.1 rad}}}}
modes:
  front: {{root: front.sole, base: held, pose: arched}}
  rear: {{root: rear, base: held, pose: arched, actuators: [ankle]}}
  loose: {{root: body, base: free, pose: arched}}
  bolted: {{root: front.sole, base: fixed, pose: arched}}
"""
MODES = ("front", "rear", "loose")


@pytest.fixture(scope="module")
def family(tmp_path_factory: pytest.TempPathFactory) -> Iterator[thingc.RobotFamily]:
    folder = tmp_path_factory.mktemp("crawler")
    (folder / "crawler.yaml").write_text(CRAWLER)
    with thingc.family(folder / "crawler.yaml") as family:
        yield family


def acting(mode: int, *joints: float) -> dict[str, Any]:
    return {"mode": mode, "joints": np.array(joints or (0.0, 0.0))}


def test_switch_equals_that_of_modes(family: thingc.RobotFamily) -> None:
    """The models, the switch and the controls are computed separately. `rear` has no drive at the knee."""
    env = make_env(family, modes=MODES, settings=[{"span": 0.3}], observation=("joints", "mode"), frame_skip=4)
    first, _ = env.reset(seed=1)
    assert first.tolist() == pytest.approx([0.4, -0.7, 0.0, 0.0, 1.0, 0.0, 0.0])
    models = {mode: next(iter(family.models([{"span": 0.3}], mode=mode, floor=True))) for mode in MODES}
    robot = family.modes({"span": 0.3}, *MODES)
    assert robot
    data = {mode: mujoco.MjData(model) for mode, model in models.items()}  # type: ignore[arg-type]
    for mode in MODES:
        mujoco.mj_resetDataKeyframe(models[mode], data[mode], 0)
    before = "front"
    for mode, knee, ankle in ((0, 0.3, -0.2), (1, 0.5, 0.6), (1, -0.5, 0.1), (2, 0.1, 0.2), (0, 1.0, -1.0)):
        seen, _, _, _, info = env.step(acting(mode, knee, ankle))
        name = MODES[mode]
        if name != before:
            robot.switch((before, data[before]), (name, data[name]), on_motion="impact")
        data[name].ctrl[:] = [2 * knee, ankle] if name != "rear" else [ankle]
        mujoco.mj_step(models[name], data[name], 4)
        before = name
        assert env.model.body(1).name == models[name].body(1).name and info["mode"] == name and "refused" not in info
        np.testing.assert_allclose(env.data.qpos, data[name].qpos, atol=1e-12)
        np.testing.assert_allclose(env.data.qvel, data[name].qvel, atol=1e-12)
        own = [data[name].joint(joint) for joint in ("knee", "ankle")]
        expected = [*(one.qpos[0] for one in own), *(one.qvel[0] for one in own), *np.eye(3)[mode]]
        assert seen.tolist() == pytest.approx(expected, abs=1e-12)
    assert env.data.time == pytest.approx(20 * env.model.opt.timestep)


def test_new_episode_has_a_clean_state(family: thingc.RobotFamily) -> None:
    """The episode starts in the requested pose, without data of other modes."""
    env = make_env(family, modes=MODES, pose="flat")
    assert env.reset(seed=1)[0][:4].tolist() == pytest.approx([0.1, 0.0, 0.0, 0.0])
    env.step(acting(1))
    left = env.data
    left.warning[int(mujoco.mjtWarning.mjWARN_BADQPOS)].number = 1
    assert env.step(acting(1))[4]["unstable"]
    env.reset(seed=1)
    assert "unstable" not in env.step(acting(1))[4] and env.data is left and left.time == pytest.approx(5 * env.model.opt.timestep)


def test_refused_switch_is_in_info_and_can_set_the_reward(family: thingc.RobotFamily) -> None:
    def reward(step: Any) -> float:
        return -1.0 if step.refused else 0.5

    env = make_env(family, modes=("loose", "bolted"), reward=reward)
    env.reset(seed=1)
    assert env.step(acting(0))[1] == 0.5
    _, rewarded, ended, _, info = env.step(acting(1))
    assert rewarded == -1.0 and not ended and info["mode"] == "loose"
    assert info["refused"].startswith("link `front` is ")
    guarded = make_vec_env(
        family, 2, modes=MODES, may_switch=lambda data, old, new: (old, new) != ("front", "rear") or data.time > 0.0,
    )
    guarded.reset(seed=1)
    infos = guarded.step({"mode": np.array([1, 2]), "joints": np.zeros((2, 2))})[4]
    assert infos["refused"].tolist() == ["`may_switch` does not allow a switch from `front` to `rear`", None]
    assert infos["mode"].tolist() == ["front", "loose"]
    assert guarded.step({"mode": np.array([1, 2]), "joints": np.zeros((2, 2))})[4]["mode"].tolist() == ["rear", "loose"]
    moving = make_env(family, modes=MODES, on_motion="raise")
    moving.reset(seed=1)
    moving.step(acting(0, 1.0, 1.0))
    assert "link `rear` must not move in mode" in moving.step(acting(1))[4]["refused"]


def everything(family: Any, **given: Any) -> dict[str, Any]:
    return {
        "modes": MODES, "settings": [{"span": 0.2}, {"span": 0.3}], "noise": 0.1, "max_steps": 7, "action_scale": 0.5,
        "action_delay": (0, 3), "push": (2, 0.05),
        "observation": ("joints", "sensors", "gravity", "action", "mode"), "observation_noise": 0.01, **given,
    }


def test_the_same_seed_gives_the_same_episodes(family: thingc.RobotFamily) -> None:
    def run(threads: int, seed: int) -> list[Any]:
        worlds = make_vec_env(family, 5, threads=threads, **everything(family))
        seen: list[Any] = [worlds.reset(seed=seed)[0].tolist()]
        worlds.action_space.seed(1)
        for _ in range(16):
            observations, rewards, *_, infos = worlds.step(worlds.action_space.sample())
            seen.append([observations.tolist(), rewards.tolist(), infos["mode"].tolist()])
        worlds.close()
        return seen

    first = run(1, 4)
    assert first == run(2, 4) != run(1, 5)
    alone = make_env(family, **everything(family))
    assert alone.reset(seed=4)[0].tolist() == first[0][0]


@pytest.mark.filterwarnings("error", "ignore:.*A Box observation space m..imum value is.*", "ignore::DeprecationWarning")
def test_gymnasium_checker_finds_no_errors(tmp_path: Path) -> None:
    if "mujoco.egl" not in sys.modules:  # MuJoCo selects its backend when it is imported: run this test in another process
        own = ("--basetemp", str(tmp_path / "own"), "-k", "checker_finds")
        words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *own, __file__]
        done = subprocess.run(words, capture_output=True, text=True, env={**os.environ, "MUJOCO_GL": "egl"})
        assert done.returncode == 0 and "1 passed" in done.stdout, done.stdout + done.stderr
        return
    (tmp_path / "crawler.yaml").write_text(CRAWLER)
    made = gymnasium.make(
        ENVIRONMENT, family=str(tmp_path / "crawler.yaml"), modes=MODES, render_mode="rgb_array", push=(3, 0.1), observation_noise=0.01,
    )
    check_env(made.unwrapped)
    made.reset(seed=1)
    images = []
    for mode in (0, 1, 2, 1):
        made.step(acting(mode, 0.5, 0.5))
        images.append(made.render())
        with mujoco.Renderer(made.unwrapped.model, 480, 640) as renderer:  # type: ignore[attr-defined]
            renderer.update_scene(made.unwrapped.data)  # type: ignore[attr-defined]
            assert (images[-1] == renderer.render()).all()
    assert {image.shape for image in images} == {(480, 640, 3)} and (images[1] != images[0]).any() and made.metadata["render_fps"] == 100
    made.close()


def test_observations(family: thingc.RobotFamily) -> None:
    terms = ("joints", "sensors", "gravity", "action", "mode")
    env = make_env(family, modes=MODES, observation=terms, descriptor="span", settings=[{"span": 0.25}])
    noisy = make_env(family, modes=MODES, observation=terms, observation_noise={"gravity": 0.5}, settings=[{"span": 0.25}])
    env.reset(seed=2)
    noisy.reset(seed=2)
    for mode in (0, 1, 2, 0):
        action = acting(mode, 0.2, 3.0)
        seen, other = env.step(action)[0], noisy.step(action)[0]
        data = env.data
        own = [data.joint(joint) for joint in ("knee", "ankle")]
        expected = np.concatenate([
            [one.qpos[0] for one in own], [one.qvel[0] for one in own], data.sensordata,
            data.body("front").xmat.reshape(3, 3).T @ [0, 0, -1], [0.2, 1.0], np.eye(3)[mode], [0.0],
        ])
        np.testing.assert_allclose(seen, expected, atol=1e-14)
        away = np.abs(other - seen[:-1])
        start = 4 + len(data.sensordata)
        assert (away[start : start + 3] > 0.0).all() and (away[start : start + 3] < 0.5).all()
        assert np.delete(away, [start, start + 1, start + 2]).max() == 0.0
    blurred = make_env(family, modes=MODES, observation=terms, observation_noise=0.1, settings=[{"span": 0.25}])
    env.reset(seed=2)
    blurred.reset(seed=2)
    away = np.abs(blurred.step(acting(1, 0.2, 3.0))[0] - env.step(acting(1, 0.2, 3.0))[0][:-1])
    assert (away[:-5] > 0.0).all() and away.max() < 0.1 and away[-5:].max() == 0.0
    alone = make_env(family, mode="loose", observation=("gravity", "qvel", "action"))
    seen = alone.reset(seed=1)[0]
    assert seen[:3].tolist() == pytest.approx(list(alone.data.body("body").xmat.reshape(3, 3).T @ [0, 0, -1])) and len(seen) == 3 + 8 + 2


def test_controls(family: thingc.RobotFamily) -> None:
    """Scale, offset, ranges and delay, in modes with different drives."""
    env = make_env(family, modes=MODES, action_scale=(0.5, 0.2), action_delay=2)
    env.reset(seed=1)
    assert env.data.ctrl.tolist() == pytest.approx([0.4, -0.7])
    controls = []
    for mode, knee, ankle in ((0, 1.0, 0.5), (0, -1.0, 0.1), (0, 0.2, -1.0), (1, 0.0, 0.0), (0, 0.0, 0.0)):
        env.step(acting(mode, knee, ankle))
        controls.append(env.data.ctrl.tolist())
    expected = [[0.4, -0.7], [0.4, -0.7], [0.9, -0.6], [-0.68], [0.5, -0.9]]
    assert [pytest.approx(one) for one in expected] == controls
    env = make_env(family, mode="front", action_scale=5.0, action_offset=[0.1, 0.2])
    env.reset(seed=1)
    env.step(np.array([0.1, 1.0]))
    assert env.data.ctrl.tolist() == pytest.approx([0.6, 1.0])  # within the range of the joint
    env = make_env(family, modes=("rear",), action_scale=0.5, action_offset=[0.1])
    env.reset(seed=1)
    env.step({"mode": 0, "joints": np.array([0.2])})
    assert env.data.ctrl.tolist() == pytest.approx([0.2])
    env = make_env(family, modes=MODES, action_scale=0.5, action_offset=[0.1, 0.3])
    env.reset(seed=1)
    env.step(acting(1, 0.2, 0.4))
    assert env.data.ctrl.tolist() == pytest.approx([0.5])
    env = make_env(family, mode="front", action_scale=0.5, action_delay=(0, 3))
    late = set()
    for seed in range(12):
        env.reset(seed=seed)
        late.add(next(k for k in range(9) if [env.step(np.ones(2)), env.data.ctrl[0] > 0.5][1]))
    assert late == {0, 1, 2, 3}


def test_push_is_an_impulse(family: thingc.RobotFamily) -> None:
    """The robot floats. Without its weight, its momentum changes by the sideways impulse."""
    env = make_env(family, mode="loose", push=(3, 0.5), frame_skip=4, floor=False)
    env.reset(seed=6)
    mass, weight = env.model.body_mass.sum(), env.model.opt.gravity
    moved, directions = [], []
    for step in range(9):
        before = momentum(env.data)
        env.step(np.zeros(2))
        change = momentum(env.data) - before - mass * weight * 4 * env.model.opt.timestep
        moved.append(float(np.linalg.norm(change)))
        if step % 3 == 2:
            assert abs(change[2]) < 5e-3
            directions.append(np.arctan2(change[1], change[0]))
    assert moved == pytest.approx([0.0, 0.0, 0.5] * 3, abs=5e-3) and np.ptp(directions) > 0.1


def momentum(data: mujoco.MjData) -> np.ndarray:
    mujoco.mj_subtreeVel(data.model, data)
    momenta: np.ndarray = data.subtree_linvel[0] * data.model.body_mass.sum()
    return momenta


def test_errors(family: thingc.RobotFamily) -> None:
    for given, kind, words in (
        ({"observation": ("sensor",)}, UnknownVariant, "there is no observation `sensor`: did you mean `sensors`"),
        (
            {"modes": (), "mode": "front", "observation": "joints"}, FamilyError,
            "the observation `joints` requires an environment with `modes`",
        ),
        ({"observation": ("qpos",)}, FamilyError, "expected an observation of 2 numbers in mode `loose`, found 9"),
        ({"observation_noise": -1.0}, FamilyError, "expected `observation_noise` to be numbers of at least 0, found -1.0 for `joints`"),
        ({"observation_noise": {"sensor": 1.0}}, UnknownVariant, "`observation_noise` contains `sensor`, but `observation` does not"),
        ({"observation_noise": {"sensors": 1.0}}, UnknownVariant, "`observation_noise` contains `sensors`, but `observation` does not"),
        ({"action_delay": (2, 1)}, FamilyError, r"expected `action_delay` to be a whole number .* found \(2, 1\)"),
        ({"push": (0, 1.0)}, FamilyError, r"expected `push` to be a pair \(number of actions, impulse \[N s\]\), found \(0, 1.0\)"),
        *(({"push": push}, FamilyError, "expected `push` to be a pair") for push in (3, "ab", (3, "x"), (3, float("inf")), (3, 1.0, 2.0))),
        *(({"seed": seed}, FamilyError, f"expected `seed` to be a whole number of at least 0, found {seed}") for seed in ("x", -1, 1.5)),
        ({"noise": float("inf")}, FamilyError, "expected `noise` to be a number of at least 0, found inf"),
        ({"observation_noise": "x"}, FamilyError, "expected `observation_noise` to be numbers of at least 0, found x for `joints`"),
        ({"mode": "front"}, FamilyError, "^`mode` and `modes` cannot be used together"),
        *(
            ({name: value}, FamilyError, f"expected `{name}` to be a number or a list of 2 numbers .* found {re.escape(str(value))}")
            for name in ("action_scale", "action_offset") for value in ("x", np.nan, True, [0.5], (0.5, "x"), [[0.1, 0.2]], [1.0, np.inf])
        ),
        ({"on_motion": "stop"}, FamilyError, "expected `on_motion` to be .* found `stop`"),
        ({"render_mode": "human"}, FamilyError, 'expected `render_mode` to be "rgb_array" or None, found `human`'),
    ):
        with pytest.raises(kind, match=words):
            env = make_env(family, **{"modes": MODES, **given})  # type: ignore[arg-type]
            env.reset(seed=1)
            env.step(acting(2))
    with pytest.raises(TypeError, match="environments have no option `rewards`: did you mean `reward`"):
        make_env(family, rewards="hold")  # type: ignore[call-arg]
    assert list(EnvOptions.__annotations__) == list(EnvRules.__struct_fields__)
    env = make_env(family, modes=MODES)
    env.reset(seed=1)
    for action, words in (
        (np.zeros(2), "expected actions as a mapping with `mode` and `joints`, found"),
        (acting(3), "expected `mode` to be 1 mode indices from 0 to 2, found `[3]`"),
        (acting(-1), "from 0 to 2, found `[-1]`"),
        ({"mode": 0.5, "joints": np.zeros(2)}, "found `[0.5]`"),
        (acting(0, 1.0), "expected actions of shape (1, 2), found (1, 1)"),
    ):
        with pytest.raises(FamilyError, match=re.escape(words)):
            env.step(action)

"""Environments in MJX have the episodes of environments in MuJoCo."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import thingc
from families.documents import WORKSPACE
from thingc.batch.gym.family_env import make_env
from thingc.batch.gym.mjx_env import MjxEnv
from thingc.batch.results import FamilyError

pytestmark = pytest.mark.usefixtures("in_double_precision")

TWO_FEET = """\
thingc: assembly/1
name: feet
parameters: {load: {value: 200 g, min: 50 g, max: 1 kg}, length: 200 mm}
simulation: {timestep: 2 ms, integrator: euler}
components:
  front: {frame: true, mass: 0.3 kg, inertia: {ixx: 0.0002 kg*m^2, iyy: 0.0003 kg*m^2, izz: 0.0004 kg*m^2}}
  rear:
    frame: true
    mass: =load
    com: [100 mm, 0, 10 mm]
    inertia: {ixx: 0.0012 kg*m^2, iyy: 0.002 kg*m^2, izz: 0.003 kg*m^2}
    mounts: {hip: {xyz: [=-length, 0, 0]}}
joints:
  hip:
    type: continuous
    parent: front.origin
    child: rear.hip
    axis: [0, -1, 0]
    dynamics: {damping: 0.05 N*m*s/rad}
    drive: {kind: position, kp: 8 N*m/rad}
modes:
  front_foot: {root: front, base: held}
  adrift: {root: rear, base: free}
"""
MODES = ("front_foot", "adrift")
EFFECTS = "kp: 8 N*m/rad, delay: 5 ms, deadband: 2 deg, stall: 1.5 N*m, velocity: 10 rad/s}"
LEVERS = """\
thingc: assembly/1
name: levers
parameters: {load: {value: 1 kg, min: 0.1 kg}, slack: {value: 1 deg, min: 0 deg}, strength: 2 N*m}
components:
  post: {frame: true, mass: 1 kg, inertia: &inertia {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
  arm: {frame: true, mass: =load, com: [100 mm, 0, 0], inertia: *inertia}
  wheel: {frame: true, mass: 1 kg, inertia: *inertia}
joints:
  lift:
    type: continuous
    parent: post.origin
    child: arm.origin
    axis: [0, 1, 0]
    drive: {kind: position, kp: 8 N*m/rad, kv: 0.2 N*m*s/rad, delay: 5 ms, deadband: =slack, stall: 1.5 N*m, velocity: 3 rad/s}
  spin:
    type: continuous
    parent: post.origin
    child: wheel.origin
    axis: [0, 1, 0]
    drive: {kind: motor, effort: =strength, noise: 0.05 N*m}
modes:
  turned: {root: wheel, base: fixed}
  standing: {root: post, base: fixed}
  finer: {root: post, base: fixed, simulation: {timestep: 1 ms}}
  coarse: {root: post, base: fixed, simulation: {integrator: rk4}}
"""
BALL = """\
  neck: {type: ball, parent: post.origin, child: arm.origin}
  tail: {type: ball, parent: post.origin, child: wheel.origin}
modes: {standing: {root: post, base: fixed}}
"""


@pytest.fixture(scope="module")
def feet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[thingc.RobotFamily]:
    folder: Path = tmp_path_factory.mktemp("mjx_env")
    with family_of(folder, TWO_FEET.replace("kp: 8 N*m/rad}", EFFECTS)) as family:
        yield family


def family_of(folder: Path, document: str) -> thingc.RobotFamily:
    for name, text in {**WORKSPACE, "robot.yaml": document}.items():
        (folder / name).write_text(text)
    return thingc.family(folder / "robot.yaml", verify=0)


def velocity(step: Any) -> Any:
    return step.velocity[0]


def test_robots_switch_modes_as_in_mujoco(feet: thingc.RobotFamily) -> None:
    loads = [0.1, 0.7]
    env = MjxEnv(
        feet, ["load"], MODES, reward=velocity, terminated=lambda step: step.robot.q[0] > 0.2, floor=False, max_steps=9, noise=0.1,
    )
    models, axes, ok = env.batch(np.array(loads)[:, None])
    assert ok.all() and env.action_size == 1
    states = jax.jit(jax.vmap(env.reset, in_axes=(axes, 0)))(models, jax.random.split(jax.random.key(0), len(loads)))
    step = jax.jit(jax.vmap(env.step, in_axes=(axes, 0, 0, 0)))
    worlds = [
        make_env(
            feet, settings=[{"load": load}], modes=MODES, floor=False, max_steps=9,
            reward=lambda step: (step.after[0] - step.before[0]) / step.seconds,
        ) for load in loads
    ]
    starts = states.data[0].qpos[:, 0]
    assert starts[0] != starts[1] and 0.0 < np.abs(starts).max() < 0.1
    for k, world in enumerate(worlds):
        seen, _ = world.reset(seed=1)
        np.testing.assert_allclose(states.observation[k], [starts[k], *seen[1:]], atol=1e-14)
        world.data.qpos[:] = starts[k]
        mujoco.mj_forward(world.model, world.data)
    rng, ends = np.random.default_rng(2), 0
    for number in range(9):
        actions, modes = rng.uniform(0.0, 1.0, (len(loads), 1)), np.array([number // 2 % 2, (number + 1) // 3 % 2])
        states = step(models, states, jnp.asarray(actions), jnp.asarray(modes))
        for k, world in enumerate(worlds):
            seen, reward, _, truncated, info = world.step({"mode": modes[k], "joints": actions[k]})
            np.testing.assert_allclose(states.observation[k], seen, atol=1e-11)
            np.testing.assert_allclose(states.reward[k], reward, atol=1e-11)
            assert (states.terminated[k], states.truncated[k], states.refused[k]) == (seen[0] > 0.2, truncated, "refused" in info)
            ends += states.terminated[k]
    assert states.truncated.all() and 0 < ends < 18 and np.abs(states.reward).min() > 1e-3
    unknown = step(models, states, jnp.asarray(actions), jnp.asarray([2, -1]))
    assert unknown.refused.all() and (unknown.mode == states.mode).all() and (unknown.steps > states.steps).all()
    for action, mode, words in (
        (np.zeros(2), 0, r"expected 1 numbers, found an array of shape \(2,\)"), (actions, 0, r"of shape \(2, 1\): for many rows"),
        (np.zeros(1), 1.0, "expected `mode` to be the index of a mode, found 1.0"), (np.zeros(1), True, "index of a mode, found True"),
        (np.zeros(1), "adrift", "expected `mode` to be the index of a mode, found `'adrift'`"), (["x"], 0, r"1 numbers, found `\['x'\]`"),
    ):
        with pytest.raises(FamilyError, match=words):
            env.step(models, states, action, mode)
    with pytest.raises(FamilyError, match=r"expected rows of 1 numbers \(load\), found `'abc'`"):
        env.batch("abc")


def test_numbers_that_move_mounts_are_refused(feet: thingc.RobotFamily) -> None:
    with pytest.raises(FamilyError, match="do not support a variable `.*`, which depends on length") as caught:
        MjxEnv(feet, ["length"], MODES, reward=velocity)
    assert caught.value.help == "use `at` to fix the numbers that move links, joints or mounts"
    assert MjxEnv(feet, ["length"], (), reward=velocity).modes == ("front_foot",)
    for option, value, words in (
        ("noise", "x", "a number of at least 0, found x"), ("noise", float("nan"), "a number of at least 0, found nan"),
        ("noise", -0.1, "a number of at least 0, found -0.1"), ("frame_skip", "5", "a whole number of at least 1, found 5"),
    ):
        with pytest.raises(FamilyError, match=f"expected `{option}` to be {words}"):
            MjxEnv(feet, ["load"], MODES, reward=velocity, **{option: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(("option", "value", "words"), [
    ("reward", lambda step: jnp.ones(2), "expected `reward` to return a number, found float64[2]: return a value of type float64[]"),
    ("reward", lambda step: None, "expected `reward` to return a number, found `None`"),
    ("terminated", lambda step: step.robot.v > 0.0, "`terminated` to return True or False, found bool[1]: return a value of type bool[]"),
    ("terminated", lambda step: step.velocity[0], "to return True or False, found float64[]: return a value of type bool[]"),
    ("terminated", lambda step: "no", "expected `terminated` to return True or False, found `'no'`"),
    ("observation", lambda step: jnp.ones(2 + step.mode), "an array of numbers, found float64[3]: return a value of type float64[2]"),
    ("observation", lambda step: None, "expected `observation` to return an array of numbers, found `None`"),
    ("reward", None, "expected `reward` to be a function of an `MjxStep`, found `None`"),
    ("terminated", True, "expected `terminated` to be a function of an `MjxStep`, found `True`"),
    ("observation", "qpos", "expected `observation` to be a function of an `MjxStep`, found `qpos`"),
])
def test_wrong_functions_are_reported(feet: thingc.RobotFamily, option: str, value: Any, words: str) -> None:
    with pytest.raises(FamilyError) as caught:
        env = MjxEnv(feet, ["load"], MODES, **{"reward": velocity, option: value})
        models, _ = env.models(jnp.array([0.5]))
        jax.eval_shape(lambda key, action: env.step(models, env.reset(models, key), action), jax.random.key(0), jnp.zeros(1))
    assert words in str(caught.value)


def test_values_are_converted_to_the_types_of_the_state(feet: thingc.RobotFamily) -> None:
    env = MjxEnv(
        feet, ["load"], MODES, reward=lambda step: 1, terminated=lambda step: False, observation=lambda step: [step.velocity[0], 0],
    )
    models, _ = env.models(jnp.array([0.5]))
    state = jax.eval_shape(lambda key, action: env.step(models, env.reset(models, key), action), jax.random.key(0), jnp.zeros(1))
    assert [f"{one.dtype}{list(one.shape)}" for one in (state.reward, state.terminated, state.observation)] == [
        "float64[]", "bool[]", "float64[2]",
    ]


def test_imperfect_drives_move_as_in_mujoco(tmp_path: Path) -> None:
    """The wheel of the second drive, which has noise, does not affect the arm. The derivatives of the observations by the actions equal
    finite differences."""
    settings, count = [{"load": 0.3, "strength": 1.0}, {"load": 1.2, "strength": 3.0}], 20
    with family_of(tmp_path, f"{LEVERS}simulation: {{timestep: 2 ms, integrator: implicitfast}}\n") as family:
        env = MjxEnv(family, ["load", "strength"], "standing", reward=velocity, floor=False)
        models, axes, _ = env.batch(np.array([list(one.values()) for one in settings] * 16))
        states = jax.jit(jax.vmap(env.reset, in_axes=(axes, 0)))(models, jax.random.split(jax.random.key(3), 32))
        step = jax.vmap(env.step, in_axes=(axes, 0, 0))

        @jax.jit
        def run(models: Any, states: Any, actions: Any) -> Any:
            """Return the next states, and the derivatives of the observations by a factor of the actions. A single function takes less time
            to compile."""
            def observed(own: Any) -> Any:
                following = step(models, states, own)
                return following.observation, following

            _, slope, following = jax.jvp(observed, (actions,), (actions,), has_aux=True)
            return following, slope

        worlds = [make_env(family, settings=[one], mode="standing", floor=False) for one in settings]
        for world in worlds:
            world.reset(seed=1)
        speeds = [states.observation[:, 3]]
        for angle in np.random.default_rng(2).uniform(-1.0, 1.0, count):
            states, _ = run(models, states, np.tile([angle, 0.0], (32, 1)))
            speeds.append(states.observation[:, 3])
            for k, world in enumerate(worlds):
                seen = world.step(np.array([angle, 0.0]))[0]
                np.testing.assert_allclose(states.observation[k, [0, 2]], seen[[0, 2]], atol=1e-11)
        # Beyond the deadband, and within the torque-speed line. For an array that JAX has computed, it would compile the function again.
        actions = np.stack([states.observation[:, 0] + 0.1, np.full(32, 0.5)], axis=1)
        ahead, behind, (_, slope) = (run(models, states, actions * (1.0 + change)) for change in (1e-6, -1e-6, 0.0))
        difference = (ahead[0].observation - behind[0].observation)[:, [0, 2]] / 2e-6
        np.testing.assert_allclose(slope[:, [0, 2]], difference, rtol=1e-6, atol=1e-8)
        assert np.abs(slope[:, 2]).min() > 1e-2
        np.testing.assert_allclose(ahead[0].data[0].ctrl[:, 1], [0.5, 1.5] * 16, rtol=2e-6)  # a part of the own range of each robot
    changes = np.diff(speeds, axis=0)
    assert changes.std() == pytest.approx(5**0.5 * 0.05 * 2e-3 / 0.01, rel=0.1)
    assert abs(np.corrcoef(changes.T)[0, 1:]).max() < 0.8 and abs(states.data[0].actuator_force[:, 1]).max() == 0.0


def test_ball_joints_require_an_observation(tmp_path: Path) -> None:
    with family_of(tmp_path, LEVERS[: LEVERS.index("  lift:")] + BALL) as family:
        with pytest.raises(FamilyError, match="the default observation does not support ball joints or free joints: use `observation`"):
            MjxEnv(family, ["load"], "standing", reward=velocity)
        env = MjxEnv(family, ["load"], "standing", reward=velocity, observation=lambda step: step.data.qpos)
        models, _ = env.models(jnp.array([0.5]))
        assert jax.eval_shape(env.reset, models, jax.random.key(0)).observation.shape == (8,)


def test_drives_that_vary_are_refused(tmp_path: Path) -> None:
    with family_of(tmp_path, LEVERS) as family:
        with pytest.raises(FamilyError, match="the deadband, noise, delay or torque-speed line of a drive depends on slack: use `at`"):
            MjxEnv(family, ["slack"], "standing", reward=velocity)
        for mode in (["standing", "finer"], ["coarse"]):
            with pytest.raises(FamilyError, match="drives with a `delay` require the same time step, and not `rk4` as integrator"):
                MjxEnv(family, ["load"], mode, reward=velocity)


def test_numbers_that_change_the_start_are_refused(tmp_path: Path) -> None:
    document = LEVERS.replace("turned: {root: wheel, base: fixed", "turned: {root: wheel, base: fixed, pose: leaning")
    with family_of(tmp_path, f"{document}poses: {{level: {{lift: 0.2 rad}}, leaning: {{lift: =load * 1 rad/kg}}}}\n") as family:
        MjxEnv(family, ["load"], "standing", reward=velocity)  # starts in the pose `level`
        with pytest.raises(FamilyError, match="the first keyframe of mode `turned` depends on load: use `at` to fix these values"):
            MjxEnv(family, ["load"], "turned", reward=velocity)

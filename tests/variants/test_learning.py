"""The environment of a batch, checked by Gymnasium's checker, in its vector environments, and against MuJoCo."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from thingc.batch import FamilyError, UnknownVariant, load
from thingc.batch.gym.variants_env import ENVIRONMENT, make_env


def episode(env: Any, steps: int, seed: int) -> list[Any]:
    """Return all results of an episode with random actions of this seed, as plain values."""
    random = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed)
    seen = [observation.tolist(), str(info)]
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(random.uniform(-1, 1, env.action_space.shape))
        seen.append([observation.tolist(), float(reward), bool(terminated), bool(truncated), str(info)])
    return seen


@pytest.mark.filterwarnings("ignore:.*A Box observation space m..imum value is.*")
@pytest.mark.parametrize("mode", ["hanging", "flying"])
def test_gymnasium_checker_finds_no_errors(some: Path, mode: str) -> None:
    env = gymnasium.make(ENVIRONMENT, folder=str(some), mode=mode, descriptor=("parameters.length", "mass"), noise=0.1, max_steps=50)
    check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("vectorization", ["sync", "async"])
def test_vector_environments_equal_single_environments(some: Path, vectorization: str) -> None:
    given: dict[str, Any] = {"folder": str(some), "mode": "hanging", "reward": "forward", "max_steps": 500}
    vector = gymnasium.make_vec(ENVIRONMENT, num_envs=3, vectorization_mode=vectorization, **given)
    try:
        observations, infos = vector.reset(seed=[4, 5, 6])
        actions = np.random.default_rng(1).uniform(-1, 1, (40, 3, 1))
        outcomes = [vector.step(action) for action in actions]
        for k, seed in enumerate((4, 5, 6)):
            env = make_env(**given)
            observation, info = env.reset(seed=seed)
            assert infos["variant"][k] == info["variant"]
            np.testing.assert_array_equal(observations[k], observation)
            for action, outcome in zip(actions, outcomes, strict=True):
                observation, reward, *_ = env.step(action[k])
                np.testing.assert_array_equal(outcome[0][k], observation)
                assert outcome[1][k] == reward
    finally:
        vector.close()


def test_episode_equals_a_simulation_of_the_file(some: Path) -> None:
    env = make_env(some, mode="hanging", frame_skip=4, max_steps=30, reward=lambda step: float(step.data.qpos[0]))
    variant = load(some)[3]
    observation, info = env.reset(seed=1, options={"variant": variant.name})
    assert info == {"variant": variant.id}
    model = mujoco.MjModel.from_xml_path(str(Path(variant.folder, "mjcf", "scene_hanging.xml")))
    data = mujoco.MjData(model)
    data.qpos[:] = np.deg2rad(20.0), 0.0
    assert observation == pytest.approx([*data.qpos, 0.0, 0.0], abs=1e-15)
    for k in range(30):
        action = np.sin(0.3 * k)
        observation, reward, terminated, truncated, _ = env.step(np.array([action]))
        data.ctrl[0] = action * np.pi / 2.0  # the range is 90 degrees to each side
        for _ in range(4):
            mujoco.mj_step(model, data)
        np.testing.assert_allclose(observation, [*data.qpos, *data.qvel], rtol=0, atol=1e-9)
        assert reward == observation[0] and not terminated and truncated == (k == 29)


def test_the_same_seed_gives_the_same_episodes(some: Path) -> None:
    made = [make_env(some, mode="hanging", noise=0.2, cache=cache) for cache in (1, 16, 16)]
    first, second = (episode(env, 15, 3) + episode(env, 15, 8) for env in made[:2])
    assert first == second
    assert episode(made[2], 15, 8) == second[17:] != second[:17]
    seeded = [make_env(some, mode="hanging", seed=11) for _ in range(2)]
    drawn = [[env.reset()[1]["variant"] for _ in range(12)] for env in seeded]
    assert drawn[0] == drawn[1] and len(set(drawn[0])) > 2


def test_variants_are_sampled_by_weight(some: Path) -> None:
    family = load(some)
    env = make_env(some, mode="hanging", seed=1)
    counts = Counter(env.reset()[1]["variant"] for _ in range(800))
    assert set(counts) == {variant.id for variant in family}
    assert all(60 < count < 145 for count in counts.values())  # 100 each; a standard deviation is 9.4
    long = make_env(some, mode="hanging", seed=1, weights=lambda variant: 3.0 * (variant.settings["length"] > 0.35) + (variant.index == 1))
    counts = Counter(long.reset()[1]["variant"] for _ in range(700))
    likely = [variant.id for variant in family if variant.settings["length"] > 0.35]
    assert set(counts) == {*likely, family["some_01"].id} and len(likely) == 2
    assert 60 < counts[family["some_01"].id] < 145 and all(240 < counts[one] < 360 for one in likely)
    assert len(make_env(some, mode="hanging", weights="mass")._weights) == len(family)


def test_the_descriptor_spans_the_family(some: Path) -> None:
    env = make_env(some, mode="flying", descriptor=("mass", "parameters.effort", "parameters.length"))
    family = load(some)
    masses, lengths = (np.array(family.column(name)) for name in ("mass", "parameters.length"))
    for k, variant in enumerate(family):
        observation, _ = env.reset(options={"variant": k})
        wanted = [(masses[k] - masses.min()) / np.ptp(masses), 0.5, (lengths[k] - lengths.min()) / np.ptp(lengths)]
        assert observation[9 + 8:] == pytest.approx(2.0 * np.array(wanted) - 1.0, abs=1e-12), variant
    assert env.observation_space.shape == (9 + 8 + 3,)


@pytest.mark.filterwarnings("ignore:.*A Box observation space m..imum value is.*")
def test_other_sizes_are_rejected_or_padded(arms: Path) -> None:
    with pytest.raises(FamilyError, match=r"`arms_0` and `arms_1` differ in nq .1 and 2. in mode `standing`: .*`pad=True`"):
        make_env(arms, reward="hold")
    env = make_env(arms, pad=True, descriptor=("mass",))
    assert env.observation_space.shape == (2 + 2 + 1,) and env.action_space.shape == (2,)
    check_env(gymnasium.make(ENVIRONMENT, folder=str(arms), pad=True).unwrapped)
    for name, count in (("arms_0", 1), ("arms_1", 2)):
        env.reset(options={"variant": name})
        observation, *_ = env.step(np.array([0.5, -0.5]))
        assert observation[-1] == (-1.0, 1.0)[count - 1]
        qpos, qvel = observation[:2], observation[2:4]
        assert np.all(qpos[:count] != 0) and np.all(qvel[:count] != 0) and not qpos[count:].any() and not qvel[count:].any()
    assert make_env(load(arms).filter({"name": "arms_1"})).action_space.shape == (2,)


def test_models_in_memory_are_bounded(some: Path) -> None:
    env = make_env(some, mode="hanging", cache=3, seed=2)
    for _ in range(40):
        env.reset()
        env.step(np.zeros(1))
        assert env._of.cache_info().currsize <= 3


def test_tasks(some: Path) -> None:
    rewards = set()
    for task in ("forward", "hold"):
        env = make_env(some, mode="hanging", reward=task, seed=3)
        start, _ = env.reset()
        model, data = env.model, env.data

        def centre(model: mujoco.MjModel = model, data: mujoco.MjData = data) -> np.ndarray:
            return np.sum(model.body_mass[:, None] * data.xipos, axis=0) / model.body_mass.sum()

        for action in (0.3, -0.8):
            before, now = centre(), data.time
            observation, reward, *_ = env.step(np.array([action]))
            cost = 1e-3 * action**2
            if task == "forward":
                assert reward == pytest.approx((centre()[0] - before[0]) / (data.time - now) - cost, rel=1e-9, abs=1e-12)
            else:
                assert reward == pytest.approx(np.exp(-np.sum((observation[:2] - start[:2]) ** 2)) - cost, rel=1e-9)
            rewards.add(reward)
    assert len(rewards) == 4


def test_episode_ends(some: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes MUJOCO_LOG.TXT
    env = make_env(some, mode="hanging", terminated=lambda step: step.data.time > 0.0249, frame_skip=3, seed=2)
    env.reset()
    ends = [env.step(np.ones(1))[2] for _ in range(5)]
    assert ends == [False, False, False, False, True]  # 3 steps of 2 ms each
    env = make_env(some, mode="hanging", seed=2)
    env.reset()
    env.data.qvel[:] = 1e12
    observation, reward, terminated, truncated, info = env.step(np.ones(1))
    assert terminated and not truncated and reward == 0.0 and info["unstable"] and np.isfinite(observation).all()
    env.reset()
    assert not env.step(np.ones(1))[2]


def test_errors(some: Path) -> None:
    for given, words in (
        ({}, "has 2 modes \\(`hanging`, `flying`\\): select a mode with `mode="),
        ({"mode": "hangin"}, "did you mean `hanging`"),
        ({"mode": "hanging", "reward": "fast"}, "unknown task `fast`: known tasks: `forward`, `hold`"),
        ({"mode": "hanging", "descriptor": ("weight",)}, "has no column `weight`"),
        ({"mode": "hanging", "descriptor": ("name",)}, "expected numbers in the column `name`, found `some_01` for variant `some_01`"),
        ({"mode": "hanging", "weights": lambda variant: -1.0}, "expected non-negative weights"),
        ({"mode": "hanging", "weights": [1.0]}, "expected `weights` to be a column, or a function of a variant, found `\\[1.0\\]`"),
        ({"mode": "hanging", "frame_skip": 0}, "expected `frame_skip` to be a whole number of at least 1, found 0"),
    ):
        with pytest.raises(FamilyError, match=words):
            make_env(some, **given)  # type: ignore[arg-type]
    with pytest.raises(FamilyError, match="has no built variant to simulate"):
        make_env(load(some).filter({"mass": 0.0}))
    env = make_env(some, mode="hanging", pose="titled")
    with pytest.raises(UnknownVariant, match="has no pose `titled`: did you mean `tilted`"):
        env.reset()
    env = make_env(some, mode="hanging", descriptor="parameters.length")
    with pytest.raises(FamilyError, match="reset the environment first"):
        env.step(np.zeros(1))
    with pytest.raises(UnknownVariant, match="has no variant `some_77`"):
        env.reset(options={"variant": "some_77"})
    with pytest.raises(FamilyError, match="`reset` has no option `varient`"):
        env.reset(options={"varient": "some_01"})
    env.reset(seed=1)
    with pytest.raises(FamilyError, match=r"expected an action of numbers, found \[nan\]"):
        env.step(np.array([np.nan]))
    with pytest.raises(FamilyError, match=r"expected actions of shape \(1,\), found \(2,\)"):
        env.step(np.zeros(2))


def test_missing_gymnasium_is_reported() -> None:
    program = "import sys; sys.modules['gymnasium'] = None\nimport thingc.batch.gym.variants_env"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert said.returncode == 1 and said.stderr.endswith("ImportError: environments require Gymnasium: pip install 'thingc[learning]'\n")

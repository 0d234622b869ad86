"""Vector environments of a family in one process. Each world equals a single environment over a batch of the same variants, bit by bit."""

from __future__ import annotations

import re
import textwrap
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

import thingc
from thingc.batch import FamilyError, UnknownVariant, load
from thingc.batch.gym import family_env
from thingc.batch.gym.family_env import ENVIRONMENT, FamilyVectorEnv, make_vec_env
from thingc.batch.gym.variants_env import make_env
from thingc.driver.pipeline import UnknownChoice
from variants.families import documents

CRANE = """\
thingc: assembly/1
name: crane
parameters: {arm: {value: 300 mm, min: 100 mm, max: 900 mm}, rope: {value: =2 * arm, min: 0 mm, max: 2 m}, braced: false}
components:
  base: {frame: true, mass: 2 kg}
  hook: {frame: true, mass: 1 kg, com: [=rope, 0, 0], inertia: {ixx: 0.1 kg*m^2, iyy: 0.1 kg*m^2, izz: 0.1 kg*m^2}}
joints: {turn: {type: revolute, parent: base.origin, child: hook.origin, limit: {lower: -1 rad, upper: 1 rad}}}
modes: {standing: {root: base}}
"""


@pytest.fixture(scope="module")
def family(tmp_path_factory: pytest.TempPathFactory) -> Iterator[thingc.RobotFamily]:
    with thingc.family(documents(tmp_path_factory.mktemp("vector")) / "some.yaml") as family:
        yield family


def same(one: Any, other: Any) -> None:
    """Compare the results of two vector environments, including infos, bit by bit."""
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            same(one[key], other[key])
    elif isinstance(one, tuple):
        for a, b in zip(one, other, strict=True):
            same(a, b)
    elif isinstance(one, np.ndarray) and one.dtype.hasobject:
        for mine, others in zip(one, other, strict=True):
            same(mine, others)
    else:
        np.testing.assert_array_equal(one, other)
        assert getattr(one, "dtype", None) == getattr(other, "dtype", None)


@pytest.mark.parametrize("autoreset", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_worlds_equal_single_environments(some: Path, family: thingc.RobotFamily, autoreset: AutoresetMode) -> None:
    """The episodes contain contacts, noise, ends by the caller and by MuJoCo, and other robots afterwards."""
    given: dict[str, Any] = {
        "mode": "flying", "reward": "forward", "noise": 0.3, "max_steps": 7, "frame_skip": 3,
        "terminated": lambda step: bool(step.data.qpos[7] > 0.25),
    }
    single = SyncVectorEnv([lambda: make_env(some, **given) for _ in range(5)], autoreset_mode=autoreset)
    worlds = make_vec_env(family, 5, threads=2, autoreset_mode=autoreset, **given)
    assert isinstance(worlds, VectorEnv) and worlds.metadata["autoreset_mode"] is single.metadata["autoreset_mode"] is autoreset
    for name in ("single_observation_space", "single_action_space", "observation_space", "action_space", "num_envs", "render_mode"):
        assert getattr(worlds, name) == getattr(single, name)
    source = np.random.default_rng(5)
    same(worlds.reset(seed=11), single.reset(seed=11))
    ended: set[str] = set()
    for step in range(40):
        actions = source.uniform(-1.2, 1.2, (5, 1))
        mine, others = worlds.step(actions), single.step(actions)
        same(mine, others)
        ended |= {kind for kind, flags in (("terminated", mine[2]), ("truncated", mine[3])) if flags.any()}
        if step == 20:
            mask = np.array([True, False, True, False, False])
            same(worlds.reset(seed=3, options={"reset_mask": mask.copy()}), single.reset(seed=3, options={"reset_mask": mask.copy()}))
    assert ended == {"terminated", "truncated"}
    assert len({tuple(one.items()) for one in worlds.settings}) > 2
    worlds.close()
    single.close()


def test_objects_fall_on_a_floor_as_in_a_batch(sliders: Path, shared_store: str) -> None:
    given: dict[str, Any] = {"reward": "hold", "max_steps": 60}
    with thingc.family(sliders.parent.parent / "sliders.yaml", store=shared_store) as family:
        worlds = make_vec_env(family, 8, **given)
        single = SyncVectorEnv([lambda: make_env(sliders, **given) for _ in range(8)])
        for place in range(len(load(sliders))):
            same(worlds.reset(seed=1, options={"variant": place}), single.reset(seed=1, options={"variant": place}))
            for _ in range(25):
                actions = np.full((8, 1), 0.4)
                same(worlds.step(actions), single.step(actions))
        assert max(data.ncon for data in worlds.data) > 0


def test_gymnasium_can_create_and_check_it(tmp_path: Path) -> None:
    document = str(documents(tmp_path) / "some.yaml")
    worlds = gymnasium.make_vec(ENVIRONMENT, num_envs=3, family=document, mode="hanging", descriptor=("length", "bob"), max_steps=4)
    assert isinstance(worlds.unwrapped, FamilyVectorEnv) and worlds.spec is not None and worlds.spec.id == ENVIRONMENT
    observations, infos = worlds.reset(seed=2)
    checked = gymnasium.wrappers.vector.RecordEpisodeStatistics(worlds)
    for _ in range(9):
        actions = worlds.action_space.sample()
        assert actions in worlds.action_space
        observations, rewards, terminated, truncated, infos = checked.step(actions)
        assert observations in worlds.observation_space and observations.dtype == worlds.observation_space.dtype
        assert rewards.dtype == np.float64 and terminated.dtype == truncated.dtype == np.bool_ and infos["_variant"].all()
    assert (np.abs(observations[:, -2:]) <= 1.0).all()
    before = observations.copy()
    worlds.step(actions)
    np.testing.assert_array_equal(observations, before)  # what was given is not written over
    worlds.close()
    worlds.close()
    for act in (lambda: worlds.step(actions), lambda: worlds.reset(seed=2)):
        with pytest.raises(ClosedEnvironmentError, match=re.escape("Trying to operate on `FamilyVectorEnv`, after a call to `close()`.")):
            act()


@pytest.mark.filterwarnings("ignore:.*A Box observation space m..imum value is.*", "ignore:.*alternative render modes.*")
def test_single_world_is_an_environment(family: thingc.RobotFamily, some: Path) -> None:
    """It equals the environment over a batch of the same variants, bit by bit. Gymnasium can create it, and its checker finds no errors."""
    given: dict[str, Any] = {"mode": "flying", "reward": "forward", "noise": 0.3, "max_steps": 7, "frame_skip": 3}
    one, other = family_env.make_env(family, **given), make_env(some, **given)
    check_env(one)
    for seed in (5, None, None):
        same(one.reset(seed=seed), other.reset(seed=seed))
        assert one.model.body_mass.tolist() == other.model.body_mass.tolist() and one.settings
        for action in np.random.default_rng(1).uniform(-1, 1, (7, *one.action_space.shape)):
            same(one.step(action), other.step(action))
        assert one.data.time == other.data.time
        with pytest.raises(FamilyError, match="have ended: reset them"):
            one.step(action)
    made = gymnasium.make(ENVIRONMENT, family=family, mode="flying")
    made.reset(seed=1, options={"variant": 1})
    first, second, *_ = (built.model("flying").body_mass.tolist() for built in load(some))
    assert made.unwrapped.model.body_mass.tolist() == second != first  # type: ignore[attr-defined]
    chance = one.np_random
    assert one.np_random_seed == -1 and one.np_random is chance  # who asks after the seed gets no other chance
    with pytest.raises(FamilyError, match="`reset` has no option `reset_mask`"):
        one.reset(options={"reset_mask": [True]})
    with pytest.raises(FamilyError, match=r"expected actions of shape \(\d+,\), found"):
        one.step(action[None])


def test_episodes_do_not_depend_on_the_number_of_threads(family: thingc.RobotFamily) -> None:
    def run(threads: int, seed: Any, cache: int = 100) -> list[Any]:
        worlds = make_vec_env(family, 6, mode="hanging", noise=0.1, max_steps=5, threads=threads, cache=cache, seed=4)
        seen = [worlds.reset(seed=seed)[0].tolist()]
        source = np.random.default_rng(1)
        for _ in range(14):
            observations, rewards, *_, infos = worlds.step(source.uniform(-1, 1, (6, 1)))
            seen.append([observations.tolist(), rewards.tolist(), infos["variant"].tolist()])
        worlds.close()
        return seen

    first = run(1, None)
    assert first == run(3, None) == run(2, 4, cache=1) == run(1, [4, 5, 6, 7, 8, 9]) != run(1, 5)


def test_single_values_and_numpy_integers_are_accepted(family: thingc.RobotFamily) -> None:
    """One of what there may be many of, and whole numbers as numpy has them."""
    one = make_vec_env(family, 2, mode="hanging", settings={"length": 0.3}, descriptor="length")  # type: ignore[arg-type]
    many = make_vec_env(family, 2, mode="hanging", settings=[{"length": 0.3}], descriptor=("length",))
    same(one.reset(seed=np.int64(7)), many.reset(seed=7))  # type: ignore[arg-type]
    same(one.reset(seed=[np.int64(1), None], options={"variant": np.int64(0)}), many.reset(seed=[1, None], options={"variant": 0}))


def test_settings_are_listed_or_sampled(family: thingc.RobotFamily) -> None:
    many = [{"length": 0.2}, {"length": "30 cm", "bob": 0.3, "joints.swing.dynamics.damping": "0.3 N*m*s/rad"}]
    worlds = make_vec_env(family, 4, settings=many, mode="hanging", descriptor=("length",))
    observations, infos = worlds.reset(seed=1)
    assert infos["variant"].dtype == int and [many[place] for place in infos["variant"]] == list(worlds.settings)
    assert observations[:, -1] == pytest.approx([-1.0 if place == 0 else 0.0 for place in infos["variant"]], abs=1e-12)
    for model, settings in zip(worlds.models, worlds.settings, strict=True):
        assert model.body("weight").pos[0] == pytest.approx(0.2 if settings == many[0] else 0.3)
        assert model.joint("swing").damping[0] == (0.0 if settings == many[0] else 0.3)
    assert worlds.reset(options={"variant": -1})[1]["variant"].tolist() == [1] * 4

    drawn = make_vec_env(family, 4, settings=lambda source: {"bob": source.uniform(0.1, 0.4)}, mode="hanging", max_steps=2)
    _, infos = drawn.reset(seed=1)
    masses = {settings["bob"] for settings in drawn.settings}
    assert "variant" not in infos and len(masses) == 4
    assert sorted(masses) == sorted(model.body("weight").mass[0] for model in drawn.models)
    for _ in range(3):
        drawn.step(np.zeros((4, 1)))
    assert masses.isdisjoint(settings["bob"] for settings in drawn.settings)
    states = [id(data) for data in drawn.data]
    for _ in range(3):
        drawn.step(np.zeros((4, 1)))
    assert [id(data) for data in drawn.data] == states  # no new memory for another robot


def test_the_last_of_two_matching_settings_applies(family: thingc.RobotFamily) -> None:
    many = [{"joints.swing.dynamics.damping": 0.3, "joints.*.dynamics.damping": 0.1}]
    many.append(dict(reversed(many[0].items())))
    left = iter(many)
    listed, drawn = (make_vec_env(family, 1, settings=settings, mode="hanging") for settings in (many, lambda source: next(left)))
    for place, damping in enumerate((0.1, 0.3)):
        listed.reset(options={"variant": place})
        drawn.reset()
        assert listed.models[0].joint("swing").damping[0] == drawn.models[0].joint("swing").damping[0] == damping


def test_observation_ends_with_scaled_settings(tmp_path: Path) -> None:
    """Flags, expressions, and parameters that depend on a setting, scaled by their bounds."""
    (tmp_path / "crane.yaml").write_text(CRANE)
    many = [{"arm": 0.2}, {"arm": "=100 mm * 4", "braced": True}, {"rope": "=arm + 100 mm"}, {}]
    with thingc.family(tmp_path / "crane.yaml") as crane:
        worlds = make_vec_env(crane, 1, settings=many, descriptor=("arm", "rope", "braced"))
        seen = [worlds.reset(options={"variant": place})[0][0, -3:].tolist() for place in range(4)]
    assert seen == [pytest.approx(row) for row in ([-0.75, -0.6, -1.0], [-0.25, -0.2, 1.0], [-0.5, -0.6, -1.0], [-0.5, -0.4, -1.0])]


def test_a_boolean_is_not_a_number(tmp_path: Path) -> None:
    """`True == 1` in Python, but only one of both is a valid value of a parameter that is true or false."""
    (tmp_path / "crane.yaml").write_text(CRANE)
    drawn = iter([{"braced": True}, {"braced": 1}, {"braced": np.bool_(True)}, {"arm": True}, {"arm": 1.0}, {"arm": 0.2}])
    with thingc.family(tmp_path / "crane.yaml") as crane:
        worlds = make_vec_env(crane, 1, settings=lambda source: next(drawn))
        seen = [repr(worlds.settings[0]) for _ in range(3) if worlds.reset()]
    assert seen == ["{'braced': True}", "{'braced': True}", "{'arm': 0.2}"] and sum(worlds.refused.values()) == 3


def test_worlds_with_equal_settings_share_a_model(family: thingc.RobotFamily) -> None:
    worlds = make_vec_env(family, 3, settings=[{"length": 0.25}], mode="hanging")
    worlds.reset(seed=1)
    assert len({id(model) for model in worlds.models}) == 1 and len({id(data) for data in worlds.data}) == 3
    observations, *_ = worlds.step(np.array([[0.25], [0.22], [0.2]]))
    assert len({row.tobytes() for row in observations}) == 3


def test_worlds_are_simulated_in_parallel(family: thingc.RobotFamily, monkeypatch: pytest.MonkeyPatch) -> None:
    worlds = make_vec_env(family, 8, mode="hanging", threads=2)
    worlds.reset(seed=1)
    step, seen = mujoco.mj_step, set()
    both = threading.Barrier(2, timeout=20)

    def noting(*given: Any) -> None:
        if threading.get_ident() not in seen:
            seen.add(threading.get_ident())
            both.wait()  # which goes on when two are here
        step(*given)

    monkeypatch.setattr(mujoco, "mj_step", noting)
    worlds.step(np.zeros((8, 1)))
    assert len(seen) == 2


def test_step_after_the_end_is_an_error_without_autoreset(family: thingc.RobotFamily) -> None:
    worlds = make_vec_env(family, 2, mode="hanging", max_steps=1, autoreset_mode="Disabled")
    worlds.reset(seed=1)
    assert worlds.step(np.zeros((2, 1)))[3].all()
    with pytest.raises(FamilyError, match=r"the episodes of the worlds \[0, 1\] have ended: reset them"):
        worlds.step(np.zeros((2, 1)))
    worlds.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(FamilyError, match=r"worlds \[1\] have ended"):
        worlds.step(np.zeros((2, 1)))


def test_refused_settings_are_sampled_again(family: thingc.RobotFamily) -> None:
    """Each world samples from its own random source until the settings are valid. The result is the first valid sample of this source."""
    def draw(source: np.random.Generator) -> dict[str, float]:
        return {"length": source.uniform(0.2, 1.6)}  # at most 0.9 m is sound

    worlds = make_vec_env(family, 6, mode="hanging", settings=draw, max_steps=1)
    worlds.reset(seed=3)
    expected = []
    for k in range(6):
        source = np.random.default_rng(3 + k)
        expected.append(next(one["length"] for one in iter(lambda source=source: draw(source), None) if one["length"] <= 0.9))
    assert [settings["length"] for settings in worlds.settings] == expected
    for _ in range(4):
        worlds.step(np.zeros((6, 1)))
    assert sum(worlds.refused.values()) > 3 and all("at most 900 mm" in reason for reason in worlds.refused)
    listed = make_vec_env(family, 3, mode="hanging", settings=[{"length": 7.0}, {"length": 0.3}, {"length": 0.4}])
    listed.reset(seed=0)
    assert {settings["length"] for settings in listed.settings} <= {0.3, 0.4}
    with pytest.raises(FamilyError, match="at most 900 mm"):
        listed.reset(options={"variant": 0})
    never = make_vec_env(family, 2, mode="hanging", settings=lambda source: {"length": 1.0 + source.random()})
    with pytest.raises(FamilyError, match="at most 900 mm"):
        never.reset(seed=1)


def test_errors(family: thingc.RobotFamily, tmp_path: Path) -> None:
    for given, kind, words in (
        ({"mode": "hangin"}, UnknownChoice, "has no mode `hangin`"),
        ({"num_envs": 0}, FamilyError, "expected `num_envs` to be a whole number of at least 1, found 0"),
        ({"num_envs": 2.5}, FamilyError, "expected `num_envs` to be a whole number of at least 1, found 2.5"),
        ({"threads": -1}, FamilyError, "expected `threads` to be a whole number of at least 1, found -1"),
        ({"autoreset_mode": "SameSteps"}, FamilyError, "unknown `autoreset_mode` `SameSteps`: did you mean `SameStep`"),
        ({"reward": "fast"}, UnknownVariant, "unknown task `fast`: known tasks: `forward`, `hold`"),
        ({"descriptor": ("lenght",)}, UnknownVariant, "`pendulum` has no setting `lenght`: did you mean `length`"),
        ({"settings": []}, FamilyError, "expected at least one item in `settings`"),
        ({"settings": [5]}, FamilyError, "expected settings as a mapping from names to numbers or strings, found `5`"),
        ({"settings": 5}, FamilyError, "expected settings as a mapping from names to numbers or strings, found `5`"),
        ({"descriptor": "lenght"}, UnknownVariant, "`pendulum` has no setting `lenght`: did you mean `length`"),
        ({"reward": 5}, FamilyError, "expected `reward` to be a function of a `StepInfo`, found `5`"),
        ({"reward": None}, FamilyError, "expected `reward` to be a function of a `StepInfo`, found `None`"),
        ({"terminated": True}, FamilyError, "expected `terminated` to be a function of a `StepInfo`, found `True`"),
        ({"may_switch": "yes"}, FamilyError, "`may_switch` to be a function of an `MjData` and the names of two modes, found `yes`"),
        ({"noise": -0.1}, FamilyError, "expected `noise` to be a number of at least 0, found -0.1"),
        ({"noise": "much"}, FamilyError, "expected `noise` to be a number of at least 0, found much"),
        ({"num_envs": True}, FamilyError, "expected `num_envs` to be a whole number of at least 1, found True"),
        ({"descriptor": None}, FamilyError, "expected `descriptor` to be a list of names, found `None`"),
        ({"descriptor": [5]}, UnknownVariant, "`pendulum` has no setting `5`"),
        ({"settings": [{"length": 7.0}]}, FamilyError, r"the settings \{'length': 7.0\} are rejected: .*at most 900 mm"),
    ):
        with pytest.raises(kind, match=words):
            make_vec_env(family, **{"num_envs": 2, "mode": "hanging", **given})
    worlds = make_vec_env(family, 2, mode="hanging", pose="titled")
    with pytest.raises(FamilyError, match="reset the environments first"):
        worlds.step(np.zeros((2, 1)))
    with pytest.raises(UnknownVariant, match="has no pose `titled`: did you mean `tilted`"):
        worlds.reset()
    worlds = make_vec_env(family, 2, mode="hanging")
    for wanted in ("some_77", 77, -77, 1.0, True, [1], float("nan")):
        with pytest.raises(UnknownVariant, match=re.escape(f"there is no variant `{wanted}`")):
            worlds.reset(options={"variant": wanted})
    with pytest.raises(FamilyError, match="`reset` has no option `varient`: did you mean `variant`"):
        worlds.reset(options={"varient": 1})
    for seed in ([1, 2, 3], "ab", 1.5, [1, 2.5]):
        with pytest.raises(FamilyError, match=re.escape(f"expected a seed, or 2 seeds (one per world), found `{seed}`")):
            worlds.reset(seed=seed)
    with pytest.raises(FamilyError, match="expected `reset_mask` to be 2 flags"):
        worlds.reset(options={"reset_mask": np.zeros(2, dtype=bool)})
    worlds.reset()
    with pytest.raises(FamilyError, match=r"expected actions of shape \(2, 1\), found \(1, 2\)"):
        worlds.step(np.zeros((1, 2)))
    with pytest.raises(FamilyError, match=r"expected an action of numbers, found \[nan\]"):
        worlds.step(np.array([[0.0], [np.nan]]))
    with pytest.raises(FamilyError, match="expected actions of numbers, found `fast`"):
        worlds.step("fast")
    with pytest.raises(FamilyError, match="expected `options` to be a mapping from names to values, found `5`"):
        worlds.reset(options=5)
    for reward in (None, "much", float("nan")):
        worlds = make_vec_env(family, 2, mode="hanging", reward=lambda step, reward=reward: reward)
        worlds.reset()
        with pytest.raises(FamilyError, match=f"expected `reward` to return a number, found `{reward}`"):
            worlds.step(np.zeros((2, 1)))
    worlds = make_vec_env(family, 2, mode="hanging", terminated=lambda step: step.data.qpos > np.zeros(2))
    worlds.reset()
    with pytest.raises(FamilyError, match=r"expected `terminated` to return True or False, found `\[ *(True|False) +(True|False)\]`"):
        worlds.step(np.zeros((2, 1)))
    folder = documents(tmp_path)
    (folder / "none.yaml").write_text(textwrap.dedent("""
        thingc: variants/1
        assembly: pendulum.yaml
        name: none
        parameters: {length: [200 mm]}
        keep: [length > 1 m]
    """))
    with pytest.raises(FamilyError, match="`pendulum` has no valid variants that satisfy the rules"):
        make_vec_env(folder / "none.yaml", 2)
    different = "expected nq, nv, nu = 1.*found nq, nv, nu = 2, 2, 2"
    with thingc.family(folder / "arms.yaml") as arms, pytest.raises(FamilyError, match=different):
        make_vec_env(arms, 1).reset(options={"variant": 1})

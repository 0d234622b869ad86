"""The example robots of this repository, switched between every pair of their modes."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import mujoco
import numpy as np
import pytest

import thingc
from modes.switching_robots import Made, bodies, jacobian, joints_of, mass_matrix, same_motion, stir
from thingc.modes import BaseMoves, Modes

ROBOTS = {"arm": "assemblies/arm.yaml", "minchw": "assemblies/minchw/minchw.yaml"}


@pytest.fixture(scope="module", params=ROBOTS)
def made(request: pytest.FixtureRequest, root: Path, shared_store: str) -> Made:
    compiled = thingc.compile(str(root / ROBOTS[request.param]), store=shared_store)
    described = next(iter(compiled.modes.values())).files["modes.json"]
    return Made(
        modes=Modes.parse(described), xml={name: mode.mjcf() for name, mode in compiled.modes.items()},
        models={name: mode.model() for name, mode in compiled.modes.items()}, described=described,
    )


def modes_without_holds(made: Made, base: str) -> list[str]:
    return [name for name, mode in made.modes.items() if mode.base == base and not mode.holds]


def test_masses_and_kinematics_match_mujoco(made: Made) -> None:
    rng = np.random.default_rng(1)
    for name, mode in made.modes.items():
        data = stir(rng, made.data(name))
        state = made.modes.read(name, data)
        own = slice(0 if mode.base == "free" else 6, None)
        expected = mass_matrix(data)
        for inertias in (None, made.modes.inertias(name, data)):
            assert np.allclose(mode.mass_matrix(state, inertias)[own, own], expected, rtol=1e-9, atol=1e-12)
        poses, twists = mode.poses(state), mode.twists(state)
        for link, (X, velocity) in bodies(data).items():
            np.testing.assert_allclose(poses[link], X, rtol=0, atol=1e-12)
            expected_twist = np.concatenate([velocity[:3], X[:3, :3].T @ velocity[3:]])
            np.testing.assert_allclose(twists[link], expected_twist, rtol=0, atol=1e-12)
        assert [joint.qpos for joint in mode.joints] == [data.model.joint(joint.name).qposadr[0] for joint in mode.joints]
        assert [joint.dof for joint in mode.joints] == [data.model.joint(joint.name).dofadr[0] for joint in mode.joints]


def test_named_poses_equal_keyframes(made: Made) -> None:
    for name, mode in made.modes.items():
        for pose in mode.named:
            one, other = made.data(name), made.data(name)
            mujoco.mj_resetDataKeyframe(one.model, one, one.model.key(pose).id)
            made.modes.write(mode.state(pose), other)
            if not mode.holds:
                same_motion(one, other)


def test_round_trip_through_every_pair_of_modes(made: Made) -> None:
    rng = np.random.default_rng(2)
    # A random state of a robot with a further mount held is none that it can have: there is no way back into it.
    whole = [name for name, mode in made.modes.items() if not mode.holds]
    for source, target in product(whole, modes_without_holds(made, "free")):
        one, other, back = stir(rng, made.data(source)), made.data(target), made.data(source)
        made.modes.switch((source, one), (target, other))
        same_motion(one, other)
        switched = made.modes.switch((target, other), (source, back))
        same_motion(one, back)
        if made.modes[source].base != "free":
            assert np.abs(switched.removed).max() < 1e-12


def test_held_modes_can_be_entered_at_rest(made: Made) -> None:
    rng = np.random.default_rng(3)
    held = [name for name, mode in made.modes.items() if mode.base == "held"]
    for source, target in product(made.modes, held):
        one, other = stir(rng, made.data(source), moving=False), made.data(target)
        made.modes.switch((source, one), (target, other))
        same_motion(one, other)


def test_impact_matches_mujoco_projection(made: Made) -> None:
    rng = np.random.default_rng(4)
    for source, target in product(modes_without_holds(made, "free"), modes_without_holds(made, "held")):
        one, other = stir(rng, made.data(source)), made.data(target)
        with pytest.raises(BaseMoves):
            made.modes.switch((source, one), (target, other))
        made.modes.switch((source, one), (target, other), on_motion="impact")
        M, J = mass_matrix(one), jacobian(one, made.modes[target].root_link)
        after = one.qvel - np.linalg.solve(M, J.T @ np.linalg.solve(J @ np.linalg.solve(M, J.T), J @ one.qvel))
        for name, (_, v) in joints_of(other).items():
            assert v == pytest.approx(after[one.model.joint(name).dofadr[0]], rel=1e-9, abs=1e-10)
